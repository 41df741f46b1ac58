"""How the normals of a rough surface's facets are spread: distributions over the angle to its normal."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.shading.parameters import EXPONENT, FACET_C, ROUGHNESS
from aobake.shading.vectors import Floats, as_floats

__all__ = [
    "beckmann",
    "beckmann_of_slope",
    "cosine_power",
    "gaussian_angles",
    "gaussian_angles_of_slope",
    "trowbridge_reitz",
]

SMOOTHEST = 1e-4  # a mirror has no density; this one is still told apart by float32 directions
NODES = 48  # of Gauss and Legendre's rule: 14 digits over seven standard deviations


def beckmann(cos_alpha: ArrayLike, m: ArrayLike) -> Floats:
    """D = exp(-tan^2 alpha / m^2) / (pi m^2 cos^4 alpha), of Gaussian slopes.

    cos_alpha : (...,) cosine of the angle between facet and surface; 0 and below give 0
    m : root mean square slope, 0 to 10, one number or (...,); below 1e-4 it counts as 1e-4
    Returns (...,) in 1/sr; the integral of D cos over the hemisphere is 1. Raises SettingsError for another m.
    Source: P. Beckmann, A. Spizzichino, 1963; R. L. Cook, K. E. Torrance, ACM TOG 1(1), 1982, which
    leaves out pi; B. Walter et al., EGSR 2007, equation 25.
    """
    cosine = _cosine(cos_alpha)
    return beckmann_of_slope(_tan2(cosine), ROUGHNESS.checked(m, cosine.shape))


def beckmann_of_slope(tan2: Floats, m: NDArray[np.float64]) -> Floats:
    """`beckmann` for tan^2 of the angle, up to 1/eps^2, and a checked m."""
    m2 = np.maximum(m, SMOOTHEST) ** 2
    steepness = tan2 * (-1.0 / m2).astype(tan2.dtype)
    secant2 = 1.0 + tan2
    return np.exp(steepness) * (secant2 * secant2) * (1.0 / (np.pi * m2)).astype(tan2.dtype)


def trowbridge_reitz(cos_alpha: ArrayLike, m: ArrayLike) -> Floats:
    """D = m^2 / (pi (cos^2 alpha (m^2 - 1) + 1)^2), of half-ellipsoids; long tails. Also called GGX.

    Arguments, result and errors are those of `beckmann`; cosines below 0 give 0.
    Source: T. S. Trowbridge, K. P. Reitz, JOSA 65(5), 1975; D3 of Blinn 1977 is pi m^2 times it.
    """
    cosine = _cosine(cos_alpha)
    m2 = np.maximum(ROUGHNESS.checked(m, cosine.shape), SMOOTHEST) ** 2
    inner = _sin2(cosine) + m2.astype(cosine.dtype) * np.square(np.maximum(cosine, 0.0))
    density = (m2 / np.pi).astype(cosine.dtype) / (inner * inner)
    return np.where(cosine < 0.0, cosine.dtype.type(0.0), density)


def cosine_power(cos_alpha: ArrayLike, exponent: ArrayLike) -> Floats:
    """D = (exponent + 2)/(2 pi) cos^exponent alpha: Blinn's D1 as a density.

    cos_alpha : (...,) cosine of the angle between facet and surface; below 0 it counts as 0
    exponent : 0 to 1e6, one number or (...,)
    Returns (...,) in 1/sr; the integral of D cos is 1. Raises SettingsError for another exponent.
    Source: J. F. Blinn, SIGGRAPH 1977, D1; constant: B. Walter et al., EGSR 2007, equation 30.
    """
    cosine = _cosine(cos_alpha)
    power = EXPONENT.checked(exponent, cosine.shape)
    peak = ((power + 2.0) / (2.0 * np.pi)).astype(cosine.dtype)
    return peak * np.power(np.maximum(cosine, 0.0), power.astype(cosine.dtype))


def gaussian_angles(cos_alpha: ArrayLike, c: ArrayLike) -> Floats:
    """D = b exp(-(c alpha)^2), of Gaussian angles; b, free in the paper, makes it a density.

    cos_alpha : (...,) cosine of the angle between facet and surface; below 0 it counts as 0
    c : narrowness, 0 to 1e4, in 1/radian, one number or (...,)
    Returns (...,) in 1/sr; the integral of D cos is 1. Raises SettingsError for another c.
    Source: K. E. Torrance, E. M. Sparrow, JOSA 57(9), 1967, with c in 1/degree; D2 of Blinn 1977.
    """
    cosine = _cosine(cos_alpha)
    return gaussian_angles_of_slope(_tan2(cosine), FACET_C.checked(c, cosine.shape))


def gaussian_angles_of_slope(tan2: Floats, c: NDArray[np.float64]) -> Floats:
    """`gaussian_angles` for tan^2 of the angle and a checked c."""
    turned = c.astype(tan2.dtype) * np.arctan(np.sqrt(tan2))
    return np.exp(-turned * turned) * (1.0 / _gaussian_mass(c)).astype(tan2.dtype)


def _gaussian_mass(c: NDArray[np.float64]) -> NDArray[np.float64]:
    """The integral of exp(-(c a)^2) cos a over the hemisphere: pi times that of exp(-(c a)^2) sin 2a."""
    nodes, weights = _rule()
    end = np.minimum(np.pi / 2, 7.0 / np.maximum(c, 1.0))[..., None]  # exp(-49) is nothing
    angle = end * nodes
    integrand = np.exp(-np.square(c[..., None] * angle)) * np.sin(2.0 * angle)
    return np.asarray(np.pi * (end * weights * integrand).sum(axis=-1))


@functools.cache
def _rule() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def _cosine(value: ArrayLike) -> Floats:
    (cosine,) = as_floats("a cosine", value)
    return np.minimum(cosine, 1.0)


def _sin2(cosine: Floats) -> Floats:
    """1 - cos^2 with all its digits: 1 - cos is exact near 1."""
    positive = np.maximum(cosine, 0.0)
    return (1.0 - positive) * (1.0 + positive)


def _tan2(cosine: Floats) -> Floats:
    least = float(np.finfo(cosine.dtype).eps)
    return _sin2(cosine) / np.square(np.maximum(cosine, least))

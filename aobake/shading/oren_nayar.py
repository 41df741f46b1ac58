"""Oren and Nayar 1994: rough diffuse surfaces, which stay bright towards the light."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.shading.directions import Directions, directions, where_seen
from aobake.shading.parameters import ALBEDO, SIGMA
from aobake.shading.vectors import Floats, cross, dot

__all__ = ["oren_nayar", "oren_nayar_full"]


@dataclass(frozen=True)
class Around:
    """The larger angle a and the smaller one b of light and view to the normal, and between their azimuths.

    up_a, up_b : 1 - 2/pi times the angle, 1 along the normal and 0 at the horizon
    """

    cos_dphi: Floats
    sin_a: Floats
    sin_b: Floats
    up_a: Floats
    up_b: Floats


def oren_nayar(normal: ArrayLike, light: ArrayLike, view: ArrayLike, sigma: ArrayLike) -> Floats:
    """f = 1/pi [A + B max(0, cos dphi) sin a tan b], the qualitative model, for an albedo of 1.

    A = 1 - 0.5 s2/(s2 + 0.33), B = 0.45 s2/(s2 + 0.09), s2 = sigma^2; a is the larger, b the smaller angle of
    light and view to the normal. cos dphi sin a tan b = (l.v - (n.l)(n.v))/max(n.l, n.v) needs no angle.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    sigma : standard deviation of the facets' slope angle, 0 to pi/2, one number or (...,)
    Returns (...,) in 1/sr, float32 for float32 arrays, else float64; 0 below the horizon.
    Raises InputError for other shapes, SettingsError for another sigma.
    Reciprocal; gives back up to 1.005 times the light, and more near grazing, as the paper's fit does.
    Source: M. Oren, S. K. Nayar, Generalization of Lambert's reflectance model, SIGGRAPH 1994, equation 30.
    """
    at = directions(normal, light, view)
    s2 = np.square(SIGMA.checked(sigma, at.seen.shape))
    a = at.cast((1.0 - 0.5 * s2 / (s2 + 0.33)) / np.pi)
    b = at.cast(0.45 * s2 / (s2 + 0.09) / np.pi)
    toward = np.maximum(dot(at.light, at.view) - at.nl * at.nv, 0.0)
    return where_seen(at.seen, a + b * (toward / at.high))


def oren_nayar_full(
    normal: ArrayLike, light: ArrayLike, view: ArrayLike, sigma: ArrayLike, albedo: ArrayLike
) -> Floats:
    """f = L1 + L2 of the paper: one reflection with all three of its terms, and one between facets.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    sigma : standard deviation of the facets' slope angle, 0 to pi/2
    albedo : of the facets, 0 to 1; each of the two is one number or (...,)
    Returns (...,) in 1/sr, float32 for float32 arrays, else float64; 0 below the horizon, and where the
    paper's fit is negative (down to -0.084 at sigma = pi/2).
    Raises InputError for other shapes, SettingsError for a parameter out of range. Reciprocal.
    Source: M. Oren, S. K. Nayar, SIGGRAPH 1994, the fit L1 + L2 that equation 30 is the short form of.
    """
    at = directions(normal, light, view)
    s2 = np.square(SIGMA.checked(sigma, at.seen.shape))
    rho = ALBEDO.checked(albedo, at.seen.shape)
    around = _around(at)
    once = at.cast(rho / np.pi) * _one_reflection(at, around, s2)
    twice = at.cast(0.17 * rho * rho / np.pi * s2 / (s2 + 0.13)) * _two_reflections(around)
    return where_seen(at.seen, np.maximum(once + twice, 0.0))


def _one_reflection(at: Directions, around: Around, s2: NDArray[np.float64]) -> Floats:
    """C1 + cos dphi C2 tan b + (1 - |cos dphi|) C3 tan((a + b)/2)."""
    low, high = at.low, at.high
    cos_dphi, sin_a, sin_b, up_b = around.cos_dphi, around.sin_a, around.sin_b, around.up_b
    # sin a - (2b/pi)^3 = (1 - (2b/pi)^3) - (1 - sin a), each without a difference of almost equals
    behind = up_b * (3.0 - up_b * (3.0 - up_b)) - low * low / (1.0 + sin_a)
    c1 = at.cast(1.0 - 0.5 * s2 / (s2 + 0.33))
    c2 = at.cast(0.45 * s2 / (s2 + 0.09)) * np.where(cos_dphi >= 0.0, sin_a, behind)
    both = (1.0 - around.up_a) * (1.0 - up_b)  # 4 a b / pi^2
    c3 = at.cast(0.125 * s2 / (s2 + 0.09)) * both * both
    aside = (1.0 - np.abs(cos_dphi)) * ((sin_a + sin_b) / (low + high))  # tan((a + b)/2)
    return c1 + cos_dphi * (c2 * sin_b / high) + c3 * aside


def _two_reflections(around: Around) -> Floats:
    """1 - cos dphi (2b/pi)^2."""
    b = 1.0 - around.up_b
    return 1.0 - around.cos_dphi * (b * b)


def _around(at: Directions) -> Around:
    """The angles. Where sin b = 0 there is no dphi, and its cosine is multiplied by 0."""
    across_l, across_v = cross(at.normal, at.light), cross(at.normal, at.view)
    sin_l, sin_v = np.sqrt(dot(across_l, across_l)), np.sqrt(dot(across_v, across_v))
    both = np.maximum(sin_l * sin_v, np.finfo(sin_l.dtype).tiny)
    cos_dphi = np.clip(dot(across_l, across_v) / both, -1.0, 1.0)
    sin_a = np.minimum(np.maximum(sin_l, sin_v), 1.0)
    sin_b = np.minimum(np.minimum(sin_l, sin_v), 1.0)
    return Around(cos_dphi, sin_a, sin_b, _up(at.low, sin_a), _up(at.high, sin_b))


def _up(cosine: Floats, sine: Floats) -> Floats:
    return (2.0 / math.pi) * np.arctan2(cosine, sine)

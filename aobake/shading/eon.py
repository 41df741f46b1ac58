"""Portsmouth, Kutz and Hill 2025: rough diffuse surfaces that neither lose nor add light."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.shading.directions import Directions, directions, where_seen
from aobake.shading.oren_nayar_fujii import toward_light
from aobake.shading.parameters import ALBEDO, UNIT_ROUGHNESS
from aobake.shading.vectors import Floats, Vector, cross, dot

__all__ = ["eon", "fon"]

LOSS_GRAZING = 0.5 - 2.0 / (3.0 * math.pi)  # the paper's constant1_FON
LOSS_MEAN = 2.0 / 3.0 - 28.0 / (15.0 * math.pi)  # the paper's constant2_FON


def fon(
    normal: ArrayLike, light: ArrayLike, view: ArrayLike, roughness: ArrayLike, albedo: ArrayLike
) -> Floats:
    """f = albedo/pi A (1 + roughness t), A = 1/(1 + (1/2 - 2/(3 pi)) roughness): one reflection, scaled to give <= 1.

    t = s/max(n.l, n.v) for s = l.v - (n.l)(n.v) above 0, else s.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    roughness : 0 (Lambert) to 1
    albedo : of the facets, 0 to 1; each of the two is one number or (...,)
    Returns (...,) in 1/sr, float32 for float32 arrays, else float64; 0 below the horizon.
    Raises InputError for other shapes, SettingsError for a parameter out of range. Reciprocal.
    Source: J. Portsmouth, P. Kutz, S. Hill, EON: a practical energy-preserving rough diffuse BRDF,
    JCGT 14(1), 2025 (arXiv:2410.18026).
    """
    at = directions(normal, light, view)
    r = UNIT_ROUGHNESS.checked(roughness, at.seen.shape)
    rho = ALBEDO.checked(albedo, at.seen.shape)
    return where_seen(at.seen, _once(at, r, rho))


def eon(
    normal: ArrayLike, light: ArrayLike, view: ArrayLike, roughness: ArrayLike, albedo: ArrayLike
) -> Floats:
    """f of `fon`, and the light that it loses between facets given back: an albedo of 1 stays 1.

    Arguments, result and errors are those of `fon`. Reciprocal.
    Source: J. Portsmouth, P. Kutz, S. Hill, JCGT 14(1), 2025, with the exact albedo of FON.

    The lost shares 1 - E are written as A roughness (1/2 - 2/(3 pi) - G/pi), so that roughness = 0 is no
    special case.
    """
    at = directions(normal, light, view)
    r = UNIT_ROUGHNESS.checked(roughness, at.seen.shape)
    rho = ALBEDO.checked(albedo, at.seen.shape)
    scale = 1.0 / (1.0 + LOSS_GRAZING * r)
    mean = scale * (1.0 + LOSS_MEAN * r)
    again = rho * rho * mean / (1.0 - rho * (1.0 - mean))
    constant = again / np.pi * scale * r / (LOSS_GRAZING - LOSS_MEAN)
    lost = _lost(at.nl, _sine(at, at.light)) * _lost(at.nv, _sine(at, at.view))
    return where_seen(at.seen, _once(at, r, rho) + at.cast(constant) * lost)


def _once(at: Directions, r: NDArray[np.float64], rho: NDArray[np.float64]) -> Floats:
    scale = rho / np.pi / (1.0 + LOSS_GRAZING * r)
    return at.cast(scale) * np.maximum(1.0 + at.cast(r) * toward_light(at), 0.0)


def _lost(mu: Floats, sine: Floats) -> Floats:
    """1/2 - 2/(3 pi) - G/pi for the cosine mu, with (1 - sin^3)/mu written without a difference."""
    opened = mu * (1.0 + sine + sine * sine) / (1.0 + sine)
    g = sine * (np.arctan2(sine, mu) - sine * mu) + (2.0 / 3.0) * sine * (opened - 1.0)
    return np.maximum(LOSS_GRAZING - g / math.pi, 0.0)


def _sine(at: Directions, direction: Vector) -> Floats:
    across = cross(at.normal, direction)
    return np.minimum(np.sqrt(dot(across, across)), 1.0)

"""Fujii 2013: Oren and Nayar's model with one term, which also darkens away from the light."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from aobake.shading.directions import Directions, directions, where_seen
from aobake.shading.parameters import ALBEDO, SIGMA
from aobake.shading.vectors import Floats, dot

__all__ = ["oren_nayar_fujii", "toward_light"]


def oren_nayar_fujii(
    normal: ArrayLike, light: ArrayLike, view: ArrayLike, sigma: ArrayLike, albedo: ArrayLike
) -> Floats:
    """f = albedo (A + B t), t = s/max(n.l, n.v) for s = l.v - (n.l)(n.v) above 0, else s.

    A = (1 - 0.5 s2/(s2 + 0.33) + 0.17 albedo s2/(s2 + 0.13))/pi, B = 0.45 s2/(s2 + 0.09)/pi, s2 = sigma^2.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    sigma : standard deviation of the facets' slope angle, 0 to pi/2
    albedo : of the facets, 0 to 1; each of the two is one number or (...,)
    Returns (...,) in 1/sr, float32 for float32 arrays, else float64; 0 below the horizon.
    Raises InputError for other shapes, SettingsError for a parameter out of range.
    Reciprocal; gives back up to 1.027 times the light.
    Source: Y. Fujii, A tiny improvement of Oren-Nayar reflectance model, 2013.
    """
    at = directions(normal, light, view)
    s2 = np.square(SIGMA.checked(sigma, at.seen.shape))
    rho = ALBEDO.checked(albedo, at.seen.shape)
    a = rho * (1.0 - 0.5 * s2 / (s2 + 0.33) + 0.17 * rho * s2 / (s2 + 0.13)) / np.pi
    b = rho * 0.45 * s2 / (s2 + 0.09) / np.pi
    return where_seen(at.seen, np.maximum(at.cast(a) + at.cast(b) * toward_light(at), 0.0))


def toward_light(at: Directions) -> Floats:
    """t = s/max(n.l, n.v) for s = l.v - (n.l)(n.v) above 0, else s: positive towards the light."""
    s = dot(at.light, at.view) - at.nl * at.nv
    return np.where(s > 0.0, s / at.high, s)

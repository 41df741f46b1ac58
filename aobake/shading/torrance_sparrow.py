"""Torrance and Sparrow 1967: mirror-like facets whose angles are spread like a Gaussian."""

from __future__ import annotations

from numpy.typing import ArrayLike

from aobake.shading.directions import directions, halfway, where_seen
from aobake.shading.facets import gaussian_angles_of_slope
from aobake.shading.fresnel import fresnel
from aobake.shading.masking import grooves_over_cosines
from aobake.shading.parameters import FACET_C
from aobake.shading.vectors import Floats

__all__ = ["torrance_sparrow"]


def torrance_sparrow(
    normal: ArrayLike,
    light: ArrayLike,
    view: ArrayLike,
    c: ArrayLike,
    ior: ArrayLike,
    *,
    extinction: ArrayLike = 0.0,
) -> Floats:
    """f = F D G / (4 (n.l)(n.v)) with D = b exp(-(c alpha)^2), G of v-shaped grooves and the exact F of v.h.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    c : narrowness of the facets' angles, 0 to 1e4, in 1/radian; b makes D a density
    ior, extinction : index of refraction, 0.001 to 100, and its imaginary part, 0 to 100
    Each of these is one number or (...,).
    Returns (...,) in 1/sr, float32 for float32 arrays, else float64; 0 below the horizon and for v = -l.
    Raises InputError for other shapes, SettingsError for a parameter out of range. Reciprocal.
    Source: K. E. Torrance, E. M. Sparrow, Theory for off-specular reflection from roughened surfaces,
    JOSA 57(9), 1967; the factor 1/4 and the constant as in B. Walter et al., EGSR 2007, equation 20.
    """
    at = directions(normal, light, view)
    half = halfway(at)
    density = gaussian_angles_of_slope(half.tan2, FACET_C.checked(c, at.seen.shape))
    lobe = density * grooves_over_cosines(at, half) * fresnel(half.vh, ior, extinction)
    return where_seen(half.seen, lobe)

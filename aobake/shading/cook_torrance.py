"""Cook and Torrance 1982: mirror-like facets with Gaussian slopes, of glass, plastic or metal."""

from __future__ import annotations

from typing import Literal, get_args

from numpy.typing import ArrayLike

from aobake.errors import SettingsError, nearest
from aobake.shading.directions import directions, halfway, where_seen
from aobake.shading.facets import beckmann_of_slope
from aobake.shading.fresnel import fresnel, fresnel_schlick, normal_reflectance
from aobake.shading.masking import grooves_over_cosines
from aobake.shading.parameters import ROUGHNESS
from aobake.shading.vectors import Floats

__all__ = ["FresnelForm", "cook_torrance"]

FresnelForm = Literal["exact", "schlick"]


def cook_torrance(
    normal: ArrayLike,
    light: ArrayLike,
    view: ArrayLike,
    roughness: ArrayLike,
    ior: ArrayLike,
    *,
    extinction: ArrayLike = 0.0,
    fresnel_form: FresnelForm = "exact",
) -> Floats:
    """f = F D G / (4 (n.l)(n.v)) with Beckmann's D, G of v-shaped grooves and F of v.h.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    roughness : root mean square slope m, 0 to 10; below 1e-4 it counts as 1e-4
    ior, extinction : index of refraction, 0.001 to 100, and its imaginary part, 0 to 100
    Each of these is one number or (...,).
    fresnel_form : Fresnel's equations, or Schlick's approximation of them
    Returns (...,) in 1/sr, float32 for float32 arrays, else float64; 0 below the horizon and for v = -l.
    Raises InputError for other shapes, SettingsError for a parameter out of range.
    Reciprocal; with F = 1 the albedo is 1 at most.
    Source: R. L. Cook, K. E. Torrance, A reflectance model for computer graphics, ACM TOG 1(1), 1982,
    with the constant of B. Walter et al., EGSR 2007, equation 20: the paper's is 4 times as large.
    """
    if fresnel_form not in get_args(FresnelForm):
        hint = nearest(fresnel_form, get_args(FresnelForm))
        raise SettingsError(f"fresnel_form is {fresnel_form!r}.{hint}")
    at = directions(normal, light, view)
    half = halfway(at)
    lobe = beckmann_of_slope(half.tan2, ROUGHNESS.checked(roughness, at.seen.shape))
    lobe = lobe * grooves_over_cosines(at, half)
    if fresnel_form == "exact":
        lobe = lobe * fresnel(half.vh, ior, extinction)
    else:
        lobe = lobe * fresnel_schlick(half.vh, normal_reflectance(ior, extinction))
    return where_seen(half.seen, lobe)

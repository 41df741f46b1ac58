"""Blinn 1977: a highlight about the normal, seen from half-way between light and view."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from aobake.shading.directions import directions, halfway, where_seen
from aobake.shading.parameters import EXPONENT
from aobake.shading.vectors import Floats

__all__ = ["blinn_phong", "blinn_phong_normalised"]


def blinn_phong(
    normal: ArrayLike, light: ArrayLike, view: ArrayLike, exponent: ArrayLike
) -> Floats:
    """f = (n.h)^exponent, h = (l + v)/|l + v|: the lobe of the paper, 1 at its peak whatever the exponent.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    exponent : 0 to 1e6, one number or (...,)
    Returns (...,), float32 for float32 arrays, else float64; 0 below the horizon and for v = -l.
    Raises InputError for other shapes, SettingsError for another exponent.
    Source: J. F. Blinn, Models of light reflection for computer synthesized pictures, SIGGRAPH 1977, D1.
    """
    at = directions(normal, light, view)
    power = EXPONENT.checked(exponent, at.seen.shape)
    half = halfway(at)
    # cos = (1 + tan^2)^(-1/2) keeps the digits of small angles, which large powers ask for
    return where_seen(half.seen, np.exp(at.cast(-0.5 * power) * np.log1p(half.tan2)))


def blinn_phong_normalised(
    normal: ArrayLike, light: ArrayLike, view: ArrayLike, exponent: ArrayLike
) -> Floats:
    """f = (e + 2)(e + 4)/(8 pi (2^(-e/2) + e)) (n.h)^e: gives back all light that falls in at a right angle.

    Arguments, result and errors are those of `blinn_phong`, the value in 1/sr; the albedo is 1 at most.
    Source: F. Giesen, Derivation of Phong and Blinn-Phong BRDF normalization factors, 2009.
    """
    e = EXPONENT.checked(exponent)
    peak = (e + 2.0) * (e + 4.0) / (8.0 * np.pi * (np.exp2(-0.5 * e) + e))
    lobe = blinn_phong(normal, light, view, exponent)
    return lobe * peak.astype(lobe.dtype)

"""Phong 1975: a highlight about the mirrored light."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from aobake.shading.directions import directions, where_seen
from aobake.shading.parameters import EXPONENT
from aobake.shading.vectors import Floats, dot

__all__ = ["phong", "phong_normalised"]


def phong(normal: ArrayLike, light: ArrayLike, view: ArrayLike, exponent: ArrayLike) -> Floats:
    """f = (r.v)^exponent, r = 2 (n.l) n - l: the lobe of the paper, 1 at its peak whatever the exponent.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    exponent : 0 to 1e6, one number or (...,); 0 gives 1 everywhere
    Returns (...,), float32 for float32 arrays, else float64; 0 below the horizon.
    Raises InputError for other shapes, SettingsError for another exponent.
    Source: B. T. Phong, Illumination for computer generated pictures, CACM 18(6), 1975.
    """
    at = directions(normal, light, view)
    power = at.cast(EXPONENT.checked(exponent, at.seen.shape))
    rv = np.clip(2.0 * (at.nl * at.nv) - dot(at.light, at.view), 0.0, 1.0)
    return where_seen(at.seen, np.power(rv, power))


def phong_normalised(
    normal: ArrayLike, light: ArrayLike, view: ArrayLike, exponent: ArrayLike
) -> Floats:
    """f = (exponent + 2)/(2 pi) (r.v)^exponent: gives back all light that falls in at a right angle.

    Arguments, result and errors are those of `phong`, the value in 1/sr; the albedo is 1 at most.
    Source: E. Lafortune, Y. Willems, Using the modified Phong reflectance model for physically based
    rendering, 1994.
    """
    peak = (EXPONENT.checked(exponent) + 2.0) / (2.0 * np.pi)
    lobe = phong(normal, light, view, exponent)
    return lobe * peak.astype(lobe.dtype)

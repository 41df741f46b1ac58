"""Minnaert 1941: the moon, whose limb is as bright as its centre."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from aobake.shading.directions import directions, where_seen
from aobake.shading.parameters import MINNAERT_K
from aobake.shading.vectors import Floats

__all__ = ["minnaert"]


def minnaert(normal: ArrayLike, light: ArrayLike, view: ArrayLike, k: ArrayLike) -> Floats:
    """f = 1/pi ((n.l)(n.v))^(k - 1), for a coefficient of 1; radiance has one more n.l, that of irradiance.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    k : 0 to 10, one number or (...,); 1 is Lambert, below 1 the limb is brighter and light is added
    Returns (...,) in 1/sr, float32 for float32 arrays, else float64; 0 below the horizon.
    Raises InputError for other shapes, SettingsError for another k. Reciprocal.
    Source: M. Minnaert, The reciprocity principle in lunar photometry, ApJ 93, 1941.
    """
    at = directions(normal, light, view)
    power = at.cast(MINNAERT_K.checked(k, at.seen.shape) - 1.0)
    # cosines far below what rounding can tell from 0 would overflow for k = 0
    product = np.maximum(at.nl * at.nv, np.finfo(at.nl.dtype).tiny)
    return where_seen(at.seen, np.power(product, power) * (1.0 / np.pi))

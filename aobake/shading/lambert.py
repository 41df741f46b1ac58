"""Lambert 1760: as bright from everywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from aobake.shading.directions import directions, where_seen
from aobake.shading.vectors import Floats

__all__ = ["lambert"]


def lambert(normal: ArrayLike, light: ArrayLike, view: ArrayLike) -> Floats:
    """f = 1/pi, for an albedo of 1.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    Returns (...,) in 1/sr, float32 for float32 arrays, else float64; 0 below the horizon.
    Raises InputError for other shapes. Reciprocal; gives back all light.
    Source: J. H. Lambert, Photometria, 1760.
    """
    at = directions(normal, light, view)
    return where_seen(at.seen, np.full(at.seen.shape, 1.0 / np.pi, at.nl.dtype))

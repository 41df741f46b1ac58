"""What facets hide of each other: the v-shaped grooves of Torrance and Sparrow."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from aobake.shading.directions import Directions, Halfway, directions, halfway, where_seen
from aobake.shading.vectors import Floats

__all__ = ["grooves_over_cosines", "v_cavity_masking"]


def v_cavity_masking(normal: ArrayLike, light: ArrayLike, view: ArrayLike) -> Floats:
    """G = min(1, 2 (n.h)(n.v)/(v.h), 2 (n.h)(n.l)/(v.h)): the share of a facet that is lit and seen.

    normal, light, view : (..., 3) unit vectors away from the surface, which broadcast
    Returns (...,) in [0, 1], float32 for float32 arrays, else float64; 0 below the horizon and for v = -l.
    Raises InputError for other shapes.
    Source: K. E. Torrance, E. M. Sparrow, JOSA 57(9), 1967; as minimum: Blinn 1977.
    """
    at = directions(normal, light, view)
    half = halfway(at)
    open_ = 4.0 * (at.nl + at.nv) * at.low / half.length2  # n.h / v.h = 2 (n.l + n.v) / |l + v|^2
    return where_seen(half.seen, np.minimum(open_, 1.0))


def grooves_over_cosines(at: Directions, half: Halfway) -> Floats:
    """G / (4 (n.l)(n.v)), which stays finite where G and a cosine vanish together."""
    low, high = at.low, at.high
    shadowed = half.length2 * (high / (low + high))
    return 1.0 / np.maximum(4.0 * low * high, shadowed)

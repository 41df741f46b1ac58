"""The order in which points are traced: neighbours in space one after the other.

Rays of neighbours meet the same nodes of the tree, which are then in the processor's caches. Most files list
their vertices along the surface, and are traced as they stand; those that do not are traced along a Morton curve
(G. Morton, A computer oriented geodetic data base, IBM, 1966). What comes out is the same: directions hang on a
point's number, not on its turn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.rows import bounds

__all__ = ["along", "path"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Steps between successive points that count as short, in the mean: in units of the distance that points
# have from each other when they are spread over a square as wide as they reach. Processor time of 70,000
# triangles at 64 rays as they stood / along the curve, by how many vertices in a row kept the order of a scan:
# 1 (113 units): 1.30, 8 (15): 1.04 to 1.12, 32 (5): 1.03, 128 (2.4) and all (1.5): 1, within the noise.
SHORT = 8.0
SAMPLED = 1 << 14  # steps that are measured
LEVELS = 16  # bits of each coordinate
# Where the bits of a coordinate go: they are pushed apart by halves.
APART = (
    (16, 0x0000FF0000FF),
    (8, 0x00F00F00F00F),
    (4, 0x0C30C30C30C3),
    (2, 0x249249249249),
)


def path(points: FloatArray) -> IntArray | None:
    """(P,) the order to trace (P, 3) finite points in; None where they can be traced as they stand."""
    if len(points) < 2:
        return None
    low, high = bounds(points)
    with np.errstate(over="ignore"):  # of points that lie farther apart than float64 reaches
        reach = float((high - low).max())
    if not 0.0 < reach < np.inf or _mean_step(points, reach) <= SHORT / len(points) ** 0.5:
        return None
    return np.argsort(_morton((points - low) / reach), kind="stable")


def along(order: IntArray | None, chosen: IntArray) -> IntArray:
    """The chosen points, rising numbers, in the order of a path over all of them; None: as they stand."""
    if order is None:
        return chosen
    wanted = np.zeros(len(order), bool)
    wanted[chosen] = True
    return order[wanted[order]]


def _mean_step(points: FloatArray, reach: float) -> float:
    """How far it is from a point to the next one, as a share of the reach, in the mean of some of them."""
    starts = np.arange(0, len(points) - 1, -(-len(points) // SAMPLED))
    steps = (points[starts + 1] - points[starts]) / reach
    return float(np.sqrt(np.einsum("ij,ij->i", steps, steps)).mean())


def _morton(places: FloatArray) -> NDArray[np.uint64]:
    """(P,) the bits of places (P, 3) in [0, 1], the coordinates' by turns."""
    cells = (places * ((1 << LEVELS) - 1)).astype(np.uint64)
    code = np.zeros(len(places), np.uint64)
    for axis in range(3):
        bits = cells[:, axis].copy()
        for shift, mask in APART:
            bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
        code |= bits << np.uint64(axis)
    return code

"""Direction sets: cosine-distributed, evenly spread, ordered so that neighbours travel together.

Each set is a Vogel spiral on the unit disc, lifted onto the hemisphere. Sixteen sets with shifted radii
are made once per ray count; a point picks one of them and turns it about its normal, both by a hash of
(seed, point index), with another seed for every further set of a point. So neighbouring points are uncorrelated,
and a point's directions do not depend on threads, blocks or other points.

Tried, RMSE of a scan's vertices at 256 rays: independent random 0.0165, R2 0.0063, Owen-scrambled
Sobol' 0.0054, Hammersley 0.0046 to 0.0057, Fibonacci lattice 0.0044, this 0.0044. Scrambling Sobol'
points by a hash inside the kernel halved the rate and was no more accurate.

Sources: H. Vogel, A better way to construct the sunflower head, Mathematical Biosciences 44, 1979.
Malley's method (lifting the disc): Pharr, Jakob, Humphreys, Physically Based Rendering, 13.6.3.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["LANES", "SETS", "SIZES", "direction_sets", "packets_of", "vogel_disc"]

LANES = 8  # rays of a packet
SETS = 16
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
LARGE = 1 << 18  # directions in all sets of a size together, from which on there are fewer sets
CURVE_BITS = 10  # 1024 x 1024 cells order even a million directions well


def vogel_disc(count: int, shift: float) -> NDArray[np.float64]:
    """(count, 2) points spread evenly over the unit disc: r = sqrt((k + shift) / count), golden angle.

    shift : where in its ring each point lies, in (0, 1)
    """
    k = np.arange(count)
    radius = np.sqrt((k + shift) / count)
    angle = k * GOLDEN_ANGLE
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _sizes() -> tuple[int, ...]:
    sizes, step = [LANES], LANES
    while len(sizes) < 64:
        step *= 2 if sizes[-1] == 8 * step else 1
        sizes.append(sizes[-1] + step)
    return tuple(sizes)


# Numbers of rays that sets have towards a tolerance: whole packets, from 64 on four to an octave, up to 2^20.
SIZES = _sizes()


@functools.lru_cache(maxsize=64)
def direction_sets(count: int) -> NDArray[np.float32]:
    """The sets of `count` directions, ready for packets.

    Returns (sets, ceil(count / 8), 3, 8) float32, read-only: x, y and z of eight neighbouring unit
    vectors about +z, with pdf z / pi per steradian. Lanes behind the last direction repeat it. There are
    SETS of them, above 2^14 directions fewer: all SIZES together take 140 MiB.
    """
    sets = max(1, min(SETS, 1 << (LARGE // count).bit_length() >> 1))
    return packets_of([vogel_disc(count, (number + 0.5) / sets) for number in range(sets)])


def packets_of(discs: list[NDArray[np.float64]]) -> NDArray[np.float32]:
    """Sets of points on the disc, (N, 2) each, as directions about +z in the form of direction_sets."""
    disc = np.stack(discs)
    sets, count, _ = disc.shape
    packets = -(-count // LANES)
    order = np.argsort(_hilbert_index(disc), axis=1, kind="stable")
    along = np.take_along_axis(disc, order[:, :, None], axis=1)
    height = np.sqrt(np.maximum(0.0, 1.0 - np.square(along).sum(axis=2, keepdims=True)))
    directions = np.concatenate([along, height], axis=2).astype(np.float32)
    filled = directions[:, np.minimum(np.arange(packets * LANES), count - 1)]
    found = np.ascontiguousarray(filled.reshape(sets, packets, LANES, 3).transpose(0, 1, 3, 2))
    found.flags.writeable = False
    return found


def _hilbert_index(disc: NDArray[np.float64]) -> NDArray[np.int64]:
    """(...) the position of points of the disc, (..., 2), along a Hilbert curve over its bounding square.

    Source: J. Skilling, Programming the Hilbert curve, AIP Conference Proceedings 707, 2004, in 2D.
    """
    cells = 1 << CURVE_BITS
    cell = np.clip((disc + 1.0) * (cells / 2), 0, cells - 1).astype(np.int64)
    x, y = cell[..., 0], cell[..., 1]
    index = np.zeros(x.shape, np.int64)
    side = cells >> 1
    while side:
        right, upper = (x & side) > 0, (y & side) > 0
        index += side * side * ((3 * right) ^ upper)
        turned = ~upper
        mirrored = turned & right
        x, y = np.where(mirrored, cells - 1 - x, x), np.where(mirrored, cells - 1 - y, y)
        x, y = np.where(turned, y, x), np.where(turned, x, y)
        side >>= 1
    return index

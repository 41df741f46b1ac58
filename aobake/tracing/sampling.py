"""Direction sets: cosine-distributed, evenly spread, ordered so that neighbours travel together.

Each set is a Vogel spiral on the unit disc, lifted onto the hemisphere. Sixteen sets with shifted radii
are made once per ray count; a point picks one of them and turns it about its normal, both by a hash of
(seed, point index). So neighbouring points are uncorrelated, and a point's directions do not depend on
threads, blocks or other points.

Tried, RMSE of a scan's vertices at 256 rays: independent random 0.0165, R2 0.0063, Owen-scrambled
Sobol' 0.0054, Hammersley 0.0046 to 0.0057, Fibonacci lattice 0.0044, this 0.0044. Scrambling Sobol'
points by a hash inside the kernel halved the rate and was no more accurate.

A set that has to grow is a rank-1 lattice on (radius squared, angle): a spiral as well, but one whose first
n directions, for every power of two, are a lattice themselves, so that doubling it wastes no ray. Its error
is 0 to 9 % above Vogel's. Tried: independent sets in rounds (19 % more rays); lattices with the concentric
map (up to twice the error); generators chosen for their shortest vector in the square (up to four times),
since straight edges run along their rows.

Sources: H. Vogel, A better way to construct the sunflower head, Mathematical Biosciences 44, 1979.
Malley's method (lifting the disc): Pharr, Jakob, Humphreys, Physically Based Rendering, 13.6.3.
Lattices that grow: R. Cools, F. Kuo, D. Nuyens, Constructing embedded lattice rules for multivariate
integration, SIAM Journal on Scientific Computing 28, 2006.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "LANES",
    "SETS",
    "added_directions",
    "direction_sets",
    "packets_of",
    "spiral_lattice",
    "vogel_disc",
]

LANES = 8  # rays of a packet
SETS = 16
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
# Of the multipliers that keep, for 32 to 2^20 points, the largest least distance on all rings of the disc.
MULTIPLIER = 444_633
GOLDEN_SHIFT = 0.5 * (math.sqrt(5.0) - 1.0)  # spreads the sets over every ring width alike
CURVE_BITS = 10  # 1024 x 1024 cells order even a million directions well


def vogel_disc(count: int, shift: float) -> NDArray[np.float64]:
    """(count, 2) points spread evenly over the unit disc: r = sqrt((k + shift) / count), golden angle.

    shift : where in its ring each point lies, in (0, 1)
    """
    k = np.arange(count)
    radius = np.sqrt((k + shift) / count)
    angle = k * GOLDEN_ANGLE
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def spiral_lattice(numbers: NDArray[np.int64], count: int, shift: float) -> NDArray[np.float64]:
    """(len(numbers), 2) points of the lattice of `count` points on the unit disc, by their number in it.

    count : a power of two; the even numbers of `count` points are the lattice of half as many
    shift : turns the lattice over in the squared radius, in [0, 1)
    """
    radius = np.sqrt((numbers / count + shift) % 1.0)
    angle = (2.0 * math.pi / count) * ((numbers * MULTIPLIER) % count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


@functools.lru_cache(maxsize=16)
def direction_sets(count: int) -> NDArray[np.float32]:
    """The sets of `count` directions, ready for packets.

    Returns (SETS, ceil(count / 8), 3, 8) float32, read-only: x, y and z of eight neighbouring unit
    vectors about +z, with pdf z / pi per steradian. Lanes behind the last direction repeat it.
    """
    return packets_of([vogel_disc(count, (number + 0.5) / SETS) for number in range(SETS)])


@functools.lru_cache(maxsize=32)
def added_directions(before: int, after: int) -> NDArray[np.float32]:
    """The directions that let sets of `before` directions grow to `after`, in the form of direction_sets.

    before : a power of two, or 0 for the first ones; after : a larger power of two, up to 2^20
    """
    numbers = np.arange(after)
    if before:
        numbers = numbers[numbers % (after // before) > 0]
    shifts = [(number * GOLDEN_SHIFT) % 1.0 for number in range(SETS)]
    return packets_of([spiral_lattice(numbers, after, shift) for shift in shifts])


def packets_of(discs: list[NDArray[np.float64]]) -> NDArray[np.float32]:
    """Sets of points on the disc, (N, 2) each, as directions about +z in the form of direction_sets."""
    count = len(discs[0])
    packets = -(-count // LANES)
    sets = np.empty((len(discs), packets, 3, LANES), np.float32)
    for number, disc in enumerate(discs):
        along = disc[np.argsort(_hilbert_index(disc), kind="stable")]
        height = np.sqrt(np.maximum(0.0, 1.0 - np.einsum("ij,ij->i", along, along)))
        directions = np.column_stack([along, height])
        filled = directions[np.minimum(np.arange(packets * LANES), count - 1)]
        sets[number] = filled.reshape(packets, LANES, 3).transpose(0, 2, 1)
    sets.flags.writeable = False
    return sets


def _hilbert_index(disc: NDArray[np.float64]) -> NDArray[np.int64]:
    """Position of each point of the disc along a Hilbert curve over its bounding square.

    Source: J. Skilling, Programming the Hilbert curve, AIP Conference Proceedings 707, 2004, in 2D.
    """
    cells = 1 << CURVE_BITS
    x, y = np.clip((disc + 1.0) * (cells / 2), 0, cells - 1).astype(np.int64).T
    index = np.zeros(len(disc), np.int64)
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

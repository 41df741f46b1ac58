"""Who gets how many rays when a tolerance is to be met.

A few points, every STRIDE-th of a row, go first: PILOT rays tell about how many they need, and they get them. By
that the others' needs are known, so that most of them get one set, of the size that it takes, and are done. Whoever
is not gets another set, of what is missing then, until nobody needs one. All sets are Vogel spirals of their own
(sampling.py); how they are put together: tally.py.

That the size of a set does not hang on what its own rays meet keeps errors honest: who looks at an error often, and
stops when it is small, stops where it is too small by chance.

With a tolerance for all points together, rays go where they take away most: each point should have the variance at
which one more second takes away as much everywhere (J. Neyman, JRSS 97, 1934). Points that are near it are left alone.

Tried: docs/accuracy.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aobake.settings import TraceSettings
from aobake.tracing.neighbours import Neighbours
from aobake.tracing.planning_kernels import common_worth, set_sizes
from aobake.tracing.sampling import LANES, SIZES
from aobake.tracing.tally import FEW, SPREAD, UNSEEN, Tally

__all__ = ["PILOT", "STRIDE", "equal_fixed_rays", "missing"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

PILOT, STRIDE = 16, 4
AIM = 0.95  # of the error asked for: a second set for who falls short costs more than a few rays at once
# Of the rays there are: fewer are not worth a round; twice as many after each further one.
LEAST = 0.25
NEAR = 1.5  # times the variance that it should have, a point is left alone if all together have to be good enough
PARTS = 1.1  # times as much variance, on average, as one set of as many rays would have
BISECTIONS = 64  # of 64 octaves: exactly
# Where points see four times as much line, their rays take 4^DEAR times as long. Scan, town, terrain 0.3, hall 0.1,
# leaves 0. With 0 a bake of the scan to rms:0.01 took 1.04 times the processor time.
DEAR = 0.25
# If all together have to be good enough, what one has too much another has too little: then half as many sizes do.
COARSE = SIZES[1::2]


def missing(tally: Tally, near: Neighbours, settings: TraceSettings, further: int = 0) -> IntArray:
    """(P,) how many rays the next set of each point should have; 0 for those that are done, or may have no more.

    tally : of the neighbours' points; further : rounds beyond the usual number
    """
    nothing = np.zeros(len(tally.rays), np.int64)
    if settings.tolerance is None or len(nothing) == 0:
        return nothing
    if not tally.rays.any():
        return nothing + PILOT
    behind = near.behind(tally)
    variance = tally.variance(behind)
    scaled = tally.scaled_variance(behind)
    goal = np.full(len(nothing), settings.tolerance**2)
    enough, sizes = goal, SIZES
    if settings.tolerance_of == "rms":
        goal = _shared(variance, scaled, settings.tolerance**2)
        enough, sizes = NEAR * goal, COARSE
    room = settings.max_rays - tally.rays
    going = np.flatnonzero((variance > enough) & (room >= LANES))
    least = LEAST * 2.0**further
    wanted = _sizes(tally.only(going), scaled[going], AIM**2 * goal[going], sizes, least)
    most = np.array(SIZES)[np.searchsorted(SIZES, room[going], "right") - 1]
    nothing[going] = np.minimum(wanted, most)
    return nothing


def _sizes(
    tally: Tally, scaled: FloatArray, goal: FloatArray, sizes: Sequence[int], least: float
) -> IntArray:
    """(P,) how large the next sets have to be with which points will have about a variance.

    scaled : (P,) n^1.5 times the variance, by what is known; goal : (P,) the variance
    sizes : that there are, 2^k of them; least : of the rays there are
    What more rays will do is expected as if all edges were lines.
    """
    # Where no ray counts, nothing is known yet: as many again.
    fewest = tally.rays * np.where(tally.counted > 0, least, 1.0)
    known, place = np.array(sizes), np.empty(len(goal), np.int64)
    sums = tally.scaled, tally.counted, tally.rays
    between = np.sqrt(known[1:].astype(float) * known[:-1])
    smallest = np.minimum(np.searchsorted(known, fewest), len(known) - 1)
    set_sizes(scaled, goal, sums, between, smallest, UNSEEN, place)
    return known[place]


def _shared(variance: FloatArray, scaled: FloatArray, mean: float) -> FloatArray:
    """(P,) the variances that points should have for theirs to be so large in the mean; infinite if they are.

    scaled : (P,) n^1.5 times the variance, by what is known
    """
    if float(variance.sum()) <= len(variance) * mean:
        return np.full(len(variance), np.inf)
    lines = np.maximum(scaled, 0.0)
    shape = (1.5 * lines ** (1.0 - DEAR) * lines.mean() ** DEAR) ** 0.4
    worth = 2.0 ** common_worth(variance, scaled, shape, mean, (UNSEEN, NEAR, AIM**2), -60.0, 0.0)
    rays = np.maximum(shape * worth**-0.4, (2.0 * UNSEEN**2 / worth) ** (1.0 / 3.0))
    return np.asarray(scaled / (rays * np.sqrt(rays)) + np.square(UNSEEN / rays))


def equal_fixed_rays(standard_error: NDArray[np.float32], rays: NDArray[np.int32]) -> float | None:
    """Rays at each point that would give the same root mean square error, were they the same at all points.

    standard_error, rays : (P,), of estimates towards a tolerance; points with an error of 0 do not count
    Returns None where nothing was estimated. By the law of the standard error, as if all edges were lines.
    """
    traced = standard_error > 0.0
    if not traced.any():
        return None
    error, n = standard_error[traced].astype(np.float64), rays[traced].astype(np.float64)
    goal = float(np.mean(np.square(error)))
    line = float(np.mean(_line(error, n)))
    low, high = 0.0, 64.0  # as powers of two
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        size = 2.0**middle
        variance = ((SPREAD + FEW / size) * line * math.sqrt(size) + UNSEEN**2) / size**2
        low, high = (middle, high) if variance > goal else (low, middle)
    return float(2.0**high)


def _line(error: FloatArray, rays: FloatArray) -> FloatArray:
    """(P,) the line that is behind the standard errors of points with several sets."""
    rough = (np.square(error * rays) - UNSEEN**2) / (PARTS * (SPREAD + FEW / rays))
    return np.asarray(np.maximum(rough, 0.0) / np.sqrt(rays))

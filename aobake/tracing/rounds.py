"""The error of an estimate, and who gets more rays when a tolerance is to be met.

The error of a well-spread direction set comes from the rays next to the boundary of the visible region;
the others hit or miss whichever way the set is turned. Along a Hilbert curve over the hemisphere the
squared differences D of successive values count those boundary rays, so

    standard error = sqrt(SPREAD D + UNSEEN^2) / n

D grows as the square root of n, since the boundary is a line: the parts of a set that grew each tell its
length, and D of the whole set follows from their sum. For independent samples SPREAD would be 1/2 (J. von
Neumann et al., The mean square successive difference, Annals of Mathematical Statistics 12, 1941; its
use for systematic samples: K. Wolter, JASA 79, 1984). UNSEEN stands for what is too small to be met by
any ray: a point where all rays agree is not exact. The binomial formula sqrt(A (1 - A) / n) would be
four times too wide at 256 rays.

Measured (benchmarks/honesty.py): see docs/accuracy.md.

Tried, and left: adding an independent set in each round (19 % more rays for the same error than a set that
grows); tracing new rays only between older ones that disagree (a third of the rays at a tolerance of
0.002, but thin things along the horizon are missed systematically: a mean of 0.013 too open on a scan).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.settings import TraceSettings

__all__ = ["Tally", "equal_fixed_rays", "grown"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SPREAD = 0.1  # of the Vogel spiral
GROWN_SPREAD = 0.12  # of sets that grow, which are spread a little less evenly
UNSEEN = 0.55
BISECTIONS = 60
BINS_PER_OCTAVE = 64
BINS = 80 * BINS_PER_OCTAVE  # down to a variance of 2^-60 with a million rays
SURELY = 1.3  # times the tolerance: what few rays expect is off by an eighth, mostly


@dataclass(frozen=True, eq=False, kw_only=True)
class Tally:
    """What the rays of each point have met.

    total : (P,) float64, the sum of their openness; rough : (P,) float64, the sum of D over the parts of
        the set, and reach : (P,) float64 of the square roots of their sizes
    counted : (P,) int64 rays that count (all but those below the surface), of `rays` (P,) int64
    spread : SPREAD or GROWN_SPREAD, by the kind of set
    """

    total: FloatArray
    rough: FloatArray
    reach: FloatArray
    counted: IntArray
    rays: IntArray
    spread: float

    @classmethod
    def blank(cls, count: int, *, grows: bool) -> Tally:
        """For `count` points without a ray, whose sets grow or not."""
        total, rough, reach = np.zeros((3, count))
        counted, rays = np.zeros((2, count), np.int64)
        spread = GROWN_SPREAD if grows else SPREAD
        return cls(total=total, rough=rough, reach=reach, counted=counted, rays=rays, spread=spread)

    def add(self, chosen: IntArray, sums: FloatArray, rays: int) -> None:
        """Add the sums of one part of a set, of kernels.trace, to those of the chosen points."""
        self.total[chosen] += sums[:, 0]
        self.rough[chosen] += sums[:, 1]
        self.reach[chosen] += np.sqrt(sums[:, 2])
        self.counted[chosen] += sums[:, 2].astype(np.int64)
        self.rays[chosen] += rays

    def mean(self) -> FloatArray:
        """(P,) how open each point is; 1 where no ray counts."""
        return np.where(self.counted > 0, self.total / np.maximum(self.counted, 1), 1.0)

    def boundary(self) -> FloatArray:
        """(P,) how long the boundary of the visible region is: D over the square root of the rays."""
        return self.rough / np.maximum(self.reach, 1.0)

    def standard_error(self) -> FloatArray:
        """(P,) of the mean; 0 where nothing was traced."""
        counted = np.maximum(self.counted, 1)
        error = np.sqrt(_variance(self.spread, self.boundary(), counted))
        return np.where(self.rays > 0, error, 0.0)


def _variance(spread: float, boundary: FloatArray, rays: IntArray | FloatArray) -> FloatArray:
    """The squared standard error of `rays` rays."""
    return np.asarray((spread * boundary * np.sqrt(rays) + UNSEEN**2) / np.square(rays))


def grown(tally: Tally, seen: IntArray, settings: TraceSettings) -> IntArray:
    """(len(seen),) how many rays each of the points that are seen should have after the next round.

    As many as it has for those that are done. The others go at once to what they will surely need, by
    what is known of them so far, and from there by one doubling: rays that go out together lie closer to
    each other, which Embree likes, and an error that is looked at less often stops fewer points too early.
    """
    tolerance, rays = settings.tolerance, tally.rays[seen]
    if tolerance is None or len(seen) == 0:
        return rays
    room = np.log2(settings.max_rays / rays).astype(np.int64)
    outlook = _Outlook(tally.spread, tally.boundary()[seen], np.maximum(tally.counted[seen], 1))
    together = settings.tolerance_of == "rms"
    price = _price(outlook, room, tolerance) if together else tolerance**2
    sure = np.zeros(len(seen), np.int64)
    for k in range(int(room.max())):
        excess = (outlook.worth(k) if together else outlook.variance(k)) / price
        sure += (k < room) & (excess > (1.0 if k == 0 else SURELY**2))
    return rays << sure


@dataclass(frozen=True, eq=False)
class _Outlook:
    """What is expected of points: boundary (P,), and rays (P,) that count so far."""

    spread: float
    boundary: FloatArray
    rays: IntArray

    def variance(self, doublings: int) -> FloatArray:
        """(P,) the squared standard error after so many doublings."""
        return _variance(self.spread, self.boundary, self.rays << doublings)

    def worth(self, doublings: int) -> FloatArray:
        """(P,) about what one more doubling takes away from that, for each of its rays."""
        return np.asarray(self.variance(doublings) / (self.rays << doublings))


def _price(outlook: _Outlook, room: IntArray, tolerance: float) -> float:
    """The worth above which doublings are needed, for the root mean square of all errors to be the tolerance.

    room : (P,) how often each point may be doubled
    Those of most worth go first, so that in the end one more ray would take away as much everywhere (J.
    Neyman, JRSS 97, 1934). They are not sorted, but counted on a logarithmic scale.
    """
    before = outlook.variance(0)
    excess = float(before.sum()) - len(before) * tolerance**2
    if excess <= 0.0:
        return np.inf
    gains = np.zeros(BINS)
    for k in range(int(room.max())):
        after = outlook.variance(k + 1)
        place = np.clip(-BINS_PER_OCTAVE * np.log2(outlook.worth(k)), 0.0, BINS - 1.0)
        gains += np.bincount(place.astype(np.int64), np.where(k < room, before - after, 0.0), BINS)
        before = after
    last = int(np.searchsorted(np.cumsum(gains), excess))
    return float(2.0 ** (-(last + 1) / BINS_PER_OCTAVE))


def equal_fixed_rays(standard_error: NDArray[np.float32], rays: NDArray[np.int32]) -> float | None:
    """Rays at each point that would give the same root mean square error, were they the same at all points.

    standard_error, rays : (P,), of estimates towards a tolerance; points with an error of 0 do not count
    Returns None where nothing was estimated. By the law of the standard error above.
    """
    traced = standard_error > 0.0
    if not traced.any():
        return None
    error, n = standard_error[traced].astype(np.float64), rays[traced].astype(np.float64)
    boundary = np.maximum(np.square(error * n) - UNSEEN**2, 0.0) / (GROWN_SPREAD * np.sqrt(n))
    mean, goal = np.full(1, boundary.mean()), float(np.mean(np.square(error)))
    low, high = 0.0, 64.0  # as powers of two
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        above = float(_variance(SPREAD, mean, np.full(1, 2.0**middle))[0]) > goal
        low, high = (middle, high) if above else (low, middle)
    return float(2.0**high)

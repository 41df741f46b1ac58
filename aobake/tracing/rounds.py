"""The error of an estimate, and who gets more rays when a tolerance is to be met.

Along a Hilbert curve over the hemisphere the squared differences D of n successive values count the rays
next to an edge of what is visible. Where that edge is a line that the rays resolve, only they carry an error,
the others hit or miss whichever way the set is turned, and D grows as the square root of n. Where it is finer
than that, among leaves, rays err independently of each other, and D grows as n. Which of the two it is, rays
farther apart tell: those in one packet of eight differ APART times as often as successive ones along a line,
and just as often in noise. So the part of D that is no line can be told. Half of it is E, the variance of a sum of
rays that err independently, and

    standard error = sqrt((SPREAD + FEW / n) D + NOISE (1 - A^4) E + UNSEEN^2) / n

at a point of openness A. The constants are fitted to the errors of 16 to 4,096 rays on seven scenes of lines and five
of foliage (measured again by benchmarks/honesty.py; docs/accuracy.md):

- SPREAD: for independent rays it would be 1/2; a well-spread set has a tenth of that left, one that grows more.
- FEW: a dozen rays are spread less well than a thousand.
- NOISE: less than 1, since E is known from few differences only: now and then a line looks like noise.
- 1 - A^4: a small thing before the sky looks like noise to few rays as well, but mostly stands alone.
- UNSEEN: what is too small to be met by any ray. A point where all rays agree is not exact.

The sums of the parts of a set that grew give the line and the noise of the whole. What more rays will do is expected as
if all were lines: that noise goes on is too weak a guess to spend rays on (128 to 1,024 rays for points of one sky,
instead of 256 to 512).

Sources: J. von Neumann et al., The mean square successive difference, Annals of Mathematical Statistics 12,
1941; its use for systematic samples: K. Wolter, JASA 79, 1984; the part that does not fall with the distance:
the nugget effect, G. Matheron, Principles of geostatistics, Economic Geology 58, 1963. The binomial formula
sqrt(A (1 - A) / n) would be four times too wide at 256 rays.

Tried, and left: SPREAD D alone (leaves: bars of 0.7 of the error, 81 % within two); NOISE E without the openness
(leaves as good, but scans 1.65 times too wide); with 1 - A (twigs before the sky: 77 % within two); rays four
apart instead of all pairs of a packet (the same, less steady); a variogram that levels off (better on sums over many
points, worse at one point). Adding an independent set in each round (19 % more rays for the same error than a
set that grows); tracing new rays only between older ones that disagree (a third of the rays at a tolerance of
0.002, but thin things along the horizon are missed systematically: a mean of 0.013 too open on a scan).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.settings import TraceSettings
from aobake.tracing.sampling import LANES

__all__ = ["Tally", "equal_fixed_rays", "grown"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SPREAD = 0.05  # of the Vogel spiral
GROWN_SPREAD = 0.065  # of sets that grow, which are spread a little less evenly
FEW = 1.0
NOISE = 0.55
UNSEEN = 0.5
PAIRS = LANES * (LANES - 1) // 2  # of a packet
# The mean of the square roots of their distances along the curve, which are distances on the disc.
APART = sum((LANES - k) * math.sqrt(k) for k in range(1, LANES)) / PAIRS
BISECTIONS = 60
BINS_PER_OCTAVE = 64
BINS = 80 * BINS_PER_OCTAVE  # down to a variance of 2^-60 with a million rays
SURELY = 1.1  # times the tolerance: more at once costs rays on lines, less at once rounds


@dataclass(frozen=True, eq=False, kw_only=True)
class Tally:
    """What the rays of each point have met.

    total : (P,) float64, the sum of their openness; rough, noise : (P,) float64, the sums of D and E over the
        parts of the set, and reach : (P,) float64 of the square roots of their sizes
    counted : (P,) int64 rays that count (all but those below the surface), of `rays` (P,) int64
    spread : SPREAD or GROWN_SPREAD, by the kind of set
    """

    total: FloatArray
    rough: FloatArray
    noise: FloatArray
    reach: FloatArray
    counted: IntArray
    rays: IntArray
    spread: float

    @classmethod
    def blank(cls, count: int, *, grows: bool) -> Tally:
        """For `count` points without a ray, whose sets grow or not."""
        total, rough, noise, reach = np.zeros((4, count))
        counted, rays = np.zeros((2, count), np.int64)
        return cls(
            total=total,
            rough=rough,
            noise=noise,
            reach=reach,
            counted=counted,
            rays=rays,
            spread=GROWN_SPREAD if grows else SPREAD,
        )

    def add(self, chosen: IntArray, sums: FloatArray, rays: int) -> None:
        """Add the sums of one part of a set, of kernels.trace, to those of the chosen points."""
        total, rough, counted, apart, packets = sums.T
        self.total[chosen] += total
        self.rough[chosen] += rough
        self.noise[chosen] += _noise(rough, counted, apart, packets)
        self.reach[chosen] += np.sqrt(counted)
        self.counted[chosen] += counted.astype(np.int64)
        self.rays[chosen] += rays

    def mean(self) -> FloatArray:
        """(P,) how open each point is; 1 where no ray counts."""
        return np.where(self.counted > 0, self.total / np.maximum(self.counted, 1), 1.0)

    def standard_error(self) -> FloatArray:
        """(P,) of the mean; 0 where nothing was traced."""
        error = np.sqrt(_Outlook.of(self, slice(None)).variance(0))
        return np.where(self.rays > 0, error, 0.0)


def _noise(
    rough: FloatArray, counted: FloatArray, apart: FloatArray, packets: FloatArray
) -> FloatArray:
    """(P,) E of one part of a set, from its sums; by chance it may be less than nothing.

    With a line l and noise e a pair of successive rays gives l + 2 e / n, one in a packet APART l + 2 e / n.
    """
    across = counted * apart / (PAIRS * np.maximum(packets, 1.0))
    return np.where(packets > 0, (APART * rough - across) / (2.0 * (APART - 1.0)), 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Outlook:
    """What is expected of points: rough, noise (P,), D and E of all their rays so far.

    openness : (P,) their means; rays : (P,) that count so far; spread : of the set
    """

    spread: float
    rough: FloatArray
    noise: FloatArray
    openness: FloatArray
    rays: IntArray

    @classmethod
    def of(cls, tally: Tally, seen: IntArray | slice) -> _Outlook:
        """Of some of the points of a tally."""
        rays, rough = np.maximum(tally.counted[seen], 1), tally.rough[seen]
        noise = np.clip(tally.noise[seen], 0.0, 0.5 * rough)
        line = (rough - 2.0 * noise) * np.sqrt(rays) / np.maximum(tally.reach[seen], 1.0)
        return cls(
            spread=tally.spread,
            rough=line + 2.0 * noise,
            noise=noise,
            openness=tally.mean()[seen],
            rays=rays,
        )

    def variance(self, doublings: int) -> FloatArray:
        """(P,) the squared standard error after so many doublings, if all edges are lines then."""
        rays, longer = self.rays << doublings, math.sqrt(2.0**doublings)
        edges = (self.spread + FEW / rays) * self.rough
        scattered = NOISE * (1.0 - self.openness**4) * self.noise
        return np.asarray(((edges + scattered) * longer + UNSEEN**2) / np.square(rays))

    def worth(self, doublings: int) -> FloatArray:
        """(P,) about what one more doubling takes away from that, for each of its rays."""
        return np.asarray(self.variance(doublings) / (self.rays << doublings))


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
    outlook = _Outlook.of(tally, seen)
    together = settings.tolerance_of == "rms"
    price = _price(outlook, room, tolerance) if together else tolerance**2
    sure = np.zeros(len(seen), np.int64)
    for k in range(int(room.max())):
        excess = (outlook.worth(k) if together else outlook.variance(k)) / price
        sure += (k < room) & (excess > (1.0 if k == 0 else SURELY**2))
    return rays << sure


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
    Returns None where nothing was estimated. By the law of the standard error above, as if all edges were lines.
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
    """(P,) the line that is behind the standard error of sets that grew."""
    rough = (np.square(error * rays) - UNSEEN**2) / (GROWN_SPREAD + FEW / rays)
    return np.asarray(np.maximum(rough, 0.0) / np.sqrt(rays))

"""What the rays of points have met, and the standard error of the mean.

Along a Hilbert curve over the hemisphere the squared differences D of n successive values count the rays
next to an edge of what is visible. Where that edge is a line that the rays resolve, only they carry an error,
the others hit or miss whichever way the set is turned, and D grows as the square root of n. Where it is finer
than that, among leaves, rays err independently of each other, and D grows as n. Which of the two it is, rays
farther apart tell: those in one packet of eight differ APART times as often as successive ones along a line,
and just as often in noise. So the part of D that is no line can be told. Half of it is E, the variance of a sum of
rays that err independently, and

    standard error = sqrt((SPREAD + FEW / n) D + NOISE (1 - A^4) E + UNSEEN^2) / n

at a point of openness A. How long its line is and how much noise there is, its neighbours can tell as well
(neighbours.py). The constants are fitted to the errors of 16 to 4,096 rays on six scenes of lines and two of
foliage (measured again by benchmarks/honesty.py; docs/accuracy.md):

- SPREAD: for independent rays it would be 1/2; a well-spread set has a tenth of that left.
- FEW: a dozen rays are spread less well than a thousand.
- NOISE: less than 1, since E is known from few differences only: now and then a line looks like noise.
- 1 - A^4: a small thing before the sky looks like noise to few rays as well, but mostly stands alone.
- UNSEEN: what is too small to be met by any ray. A point where all rays agree is not exact.
- ALONE: a line that is known less well, from a point's own rays, is taken for a little longer.

A point may have several sets. Each counts by n^1.5, as its error falls: by what it is, never by what it met, which
would favour sets that happen to agree. Their errors are independent of each other, the line and the noise behind
them are the same.

Sources: J. von Neumann et al., The mean square successive difference, Annals of Mathematical Statistics 12,
1941; its use for systematic samples: K. Wolter, JASA 79, 1984; the part that does not fall with the distance:
the nugget effect, G. Matheron, Principles of geostatistics, Economic Geology 58, 1963. The binomial formula
sqrt(A (1 - A) / n) would be four times too wide at 256 rays.

Tried, and left: SPREAD D alone (leaves: bars of 0.7 of the error, 81 % within two); NOISE E without the openness
(leaves as good, but scans 1.65 times too wide); with 1 - A (twigs before the sky: 77 % within two); rays four
apart instead of all pairs of a packet (the same, less steady); a variogram that levels off (better on sums over many
points, worse at one point).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.sampling import LANES

__all__ = ["FEW", "SPREAD", "UNSEEN", "Behind", "Tally"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SPREAD = 0.047
FEW = 0.7
NOISE = 0.55
UNSEEN = 0.5
ALONE = 1.06
PAIRS = LANES * (LANES - 1) // 2  # of a packet
# The mean of the square roots of their distances along the curve, which are distances on the disc.
APART = sum((LANES - k) * math.sqrt(k) for k in range(1, LANES)) / PAIRS


@dataclass(frozen=True, eq=False, kw_only=True)
class Behind:
    """What is behind errors at P points: line (P,), of D for a square root of rays; noise (P,), of E for a ray.

    openness : (P,)
    """

    line: FloatArray
    noise: FloatArray
    openness: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Tally:
    """Sums over the sets of P points, of n rays each that count (all but those below the surface).

    open : (P,) float64, of n^0.5 times the openness of their rays
    rough, noise : (P,) float64, of D and E
    roots, counted, scaled, squares : (P,) float64, of n^0.5, n, n^1.5 and n^2
    rays : (P,) int64, of all rays that were sent
    """

    open: FloatArray
    rough: FloatArray
    noise: FloatArray
    roots: FloatArray
    counted: FloatArray
    scaled: FloatArray
    squares: FloatArray
    rays: IntArray

    @classmethod
    def blank(cls, count: int) -> Tally:
        """For `count` points without a ray."""
        sums = np.zeros((7, count))
        return cls(
            open=sums[0],
            rough=sums[1],
            noise=sums[2],
            roots=sums[3],
            counted=sums[4],
            scaled=sums[5],
            squares=sums[6],
            rays=np.zeros(count, np.int64),
        )

    def add(self, chosen: IntArray, sums: FloatArray, rays: IntArray | int) -> None:
        """Add the sums of one set of each of the chosen points, of kernels.trace, and how many rays it has."""
        total, rough, counted, apart, packets = sums.T
        root = np.sqrt(counted)
        self.open[chosen] += root * total
        self.rough[chosen] += rough
        self.noise[chosen] += _noise(rough, counted, apart, packets)
        self.roots[chosen] += root
        self.counted[chosen] += counted
        self.scaled[chosen] += root * counted
        self.squares[chosen] += counted * counted
        self.rays[chosen] += rays

    def only(self, chosen: IntArray) -> Tally:
        """Of some of the points."""
        return Tally(**{name: values[chosen] for name, values in vars(self).items()})

    def mean(self) -> FloatArray:
        """(P,) how open each point is; 1 where no ray counts."""
        return np.where(self.counted > 0, self.open / np.maximum(self.scaled, 1.0), 1.0)

    def edges(self) -> tuple[FloatArray, FloatArray]:
        """(P,) the parts of D that are lines, and E, as far as there can be."""
        noise = np.clip(self.noise, 0.0, 0.5 * self.rough)
        return self.rough - 2.0 * noise, noise

    def behind(self) -> Behind:
        """What is behind the errors of the points, by the rays of each alone."""
        line, noise = self.edges()
        return Behind(
            line=ALONE * line / np.maximum(self.roots, 1.0),
            noise=noise / np.maximum(self.counted, 1.0),
            openness=self.mean(),
        )

    def variance(self, behind: Behind) -> FloatArray:
        """(P,) the squared standard error of the mean; infinite where there is no ray."""
        met = _met(behind, self.roots, self.counted, self.scaled, self.squares)
        found = met / np.square(np.maximum(self.scaled, 1.0))
        found += np.square(UNSEEN / np.maximum(self.counted, 1.0))
        return np.where(self.rays > 0, found, np.inf)

    def scaled_variance(self, behind: Behind) -> FloatArray:
        """(P,) the same without what no ray has met, times n^1.5 of the rays there are.

        Where there is none that of one set, of as many rays as other points have in the mean.
        """
        own = _met(behind, self.roots, self.counted, self.scaled, self.squares)
        n = max(float(self.counted.sum()) / max(int(np.count_nonzero(self.rays)), 1), 1.0)
        one = _met(behind, n**0.5, n, n**1.5, n**2) / n**1.5
        return np.where(self.rays > 0, own / np.maximum(self.scaled, 1.0), one)


def _met(
    behind: Behind,
    roots: FloatArray | float,
    counted: FloatArray | float,
    scaled: FloatArray | float,
    squares: FloatArray | float,
) -> FloatArray:
    """(P,) the variance by what rays have met, times the square of the sum of n^1.5 over sets of n rays.

    roots, counted, scaled, squares : sums over the sets of n^0.5, n, n^1.5 and n^2
    """
    noise = 2.0 * (SPREAD * squares + FEW * counted)
    noise = noise + NOISE * (1.0 - behind.openness**4) * squares
    return np.asarray((SPREAD * scaled + FEW * roots) * behind.line + noise * behind.noise)


def _noise(
    rough: FloatArray, counted: FloatArray, apart: FloatArray, packets: FloatArray
) -> FloatArray:
    """(P,) E of one set, from its sums; by chance it may be less than nothing.

    With a line l and noise e a pair of successive rays gives l + 2 e / n, one in a packet APART l + 2 e / n.
    """
    across = counted * apart / (PAIRS * np.maximum(packets, 1.0))
    return np.where(packets > 0, (APART * rough - across) / (2.0 * (APART - 1.0)), 0.0)

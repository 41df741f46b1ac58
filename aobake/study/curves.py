"""What a study measures: levels of accuracy along curves, and what can be read off them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["Curve", "Level", "Run", "Study", "What", "level_of", "needed", "pareto"]

FloatArray = NDArray[np.float64]
Run = tuple[FloatArray, FloatArray, float, float]  # values, standard errors, rays a point, seconds
What = Literal["vertices", "texels"]

STEADY = (16.0, 1024.0)  # rays between which a slope is fitted


@dataclass(frozen=True, kw_only=True)
class Level:
    """One point of a curve.

    setting : what was asked for: a number of rays, or a tolerance
    rays : a point, in the mean
    seconds : for the whole asset in this way, the median of repeats; least and most of them
    rmse, p99, max : of the true error, over all points and seeds
    rmse_least, rmse_most : of single seeds
    reported : root mean square of the standard errors that were reported
    within_2, within_4 : share of points whose true error is at most so many of their standard errors
    """

    setting: str
    rays: float
    seconds: float
    seconds_least: float
    seconds_most: float
    rmse: float
    rmse_least: float
    rmse_most: float
    p99: float
    max: float
    reported: float
    within_2: float
    within_4: float

    @property
    def asked(self) -> float:
        """The rays a point that were asked for, of which points under an open sky take none; else those spent."""
        return float(self.setting) if self.setting.isdigit() else self.rays


@dataclass(frozen=True, kw_only=True)
class Curve:
    """One way to spend rays, at several levels.

    kind : "budget", "tolerance", "directions" or "method"; denoised : whether a denoiser smoothed what came
    """

    name: str
    kind: str
    levels: tuple[Level, ...]
    denoised: bool = False

    @property
    def slope(self) -> float | None:
        """d log rmse / d log rays from 16 to 1,024 rays; None for fewer than two levels there."""
        used = [
            level
            for level in self.levels
            if STEADY[0] <= level.asked <= STEADY[1] and level.rmse > 0.0
        ]
        if len(used) < 2:
            return None
        x, y = np.log([v.rays for v in used]), np.log([v.rmse for v in used])
        return float(np.polyfit(x, y, 1)[0])


@dataclass(frozen=True, eq=False, kw_only=True)
class Study:
    """All that was measured on one asset.

    what : what its points are; points : how many of them were looked at; whole : how many it has
    reference_rays : a point, of what errors are measured against
    curves : fixed budgets, tolerances, and at vertices sets of directions; all errors at the points
    surface : point sampling and least squares; errors of what vertices interpolate to over the surface
    facts : settings, versions, the machine and its load
    """

    asset: str
    what: What
    points: int
    whole: int
    reference_rays: int
    curves: tuple[Curve, ...]
    surface: tuple[Curve, ...]
    facts: Mapping[str, object]

    @property
    def fixed(self) -> Curve:
        """The curve of fixed budgets, as they were traced."""
        return self.curves[0]

    @property
    def denoised(self) -> Curve | None:
        """The curve of fixed budgets that were denoised; None where none were."""
        return next((c for c in self.curves if c.kind == "budget" and c.denoised), None)

    @property
    def ways(self) -> tuple[Curve, ...]:
        """All curves but those that compare sets of directions, which no bake offers."""
        return tuple(curve for curve in self.curves if curve.kind != "directions")


def level_of(setting: str, truth: FloatArray, runs: Sequence[Run]) -> Level:
    """A level from runs with different seeds."""
    errors = np.stack([values - truth for values, _, _, _ in runs])
    reported = np.stack([error for _, error, _, _ in runs])
    each = np.sqrt(np.mean(np.square(errors), axis=1))
    seconds = [seconds for _, _, _, seconds in runs]
    size = np.abs(errors)
    return Level(
        setting=setting,
        rays=float(np.mean([rays for _, _, rays, _ in runs])),
        seconds=float(np.median(seconds)),
        seconds_least=min(seconds),
        seconds_most=max(seconds),
        rmse=float(np.sqrt(np.mean(np.square(errors)))),
        rmse_least=float(each.min()),
        rmse_most=float(each.max()),
        p99=float(np.percentile(size, 99)),
        max=float(size.max()),
        reported=float(np.sqrt(np.mean(np.square(reported)))),
        within_2=float(np.mean(size <= 2.0 * reported + 1e-7)),
        within_4=float(np.mean(size <= 4.0 * reported + 1e-7)),
    )


def needed(curve: Curve, rmse: float) -> tuple[float, float] | None:
    """(rays a point, seconds) that a curve needs for an error, between its levels; None outside of them."""
    levels = sorted(curve.levels, key=lambda level: -level.rmse)
    for worse, better in pairwise(levels):
        if worse.rmse >= rmse >= better.rmse > 0.0:
            span = math.log(worse.rmse / better.rmse)
            t = math.log(worse.rmse / rmse) / span if span > 0.0 else 0.0
            rays = worse.rays * (better.rays / worse.rays) ** t
            return rays, worse.seconds * (better.seconds / worse.seconds) ** t
    return None


def pareto(curves: Sequence[Curve]) -> tuple[tuple[str, Level], ...]:
    """(curve, level) of those that no other level beats in both rays and error, by rays.

    By rays and not by seconds, which go along with them and are never the same twice.
    """
    everything = [(curve.name, level) for curve in curves for level in curve.levels]
    front: list[tuple[str, Level]] = []
    for name, level in sorted(everything, key=lambda item: (item[1].rays, item[1].rmse)):
        if not front or level.rmse < front[-1][1].rmse:
            front.append((name, level))
    return tuple(front)

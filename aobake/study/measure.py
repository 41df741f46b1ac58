"""A study: one asset, measured with every budget, every tolerance, every set of directions, and both methods."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aobake import environment
from aobake.errors import InputError, SettingsError
from aobake.meshes.scene import Scene
from aobake.settings import QUALITIES, BakeSettings, ToleranceOf
from aobake.study.bench import Bench, bench_of, surface_of_bench
from aobake.study.curves import Curve, Level, Study, level_of
from aobake.study.directions import KINDS, compared_sets

__all__ = ["FULL", "QUICK", "Extent", "measure", "study_extent"]

FloatArray = NDArray[np.float64]
Progress = Callable[[str, int, int], None]
Kept = Callable[[Callable[[], FloatArray]], FloatArray]

WARMING_RAYS, WARMING_POINTS = 256, 64


@dataclass(frozen=True, kw_only=True)
class Extent:
    """How much is measured.

    points : of the asset's vertices; reference : rays of each for the true value
    budgets : fixed numbers of rays; sets : those for each set of directions
    tolerances : in each form; seeds : repeats of everything, for bands and for the times
    surface : points all over the surface, against which methods are compared; methods : their budgets
    """

    points: int
    reference: int
    budgets: tuple[int, ...]
    sets: tuple[int, ...]
    tolerances: tuple[float, ...]
    seeds: int
    surface: int
    surface_reference: int
    methods: tuple[int, ...]

    def rays(self, whole: int) -> float:
        """About how many rays all of it takes, for an asset with so many vertices."""
        points = min(self.points, whole)
        curves = sum(self.budgets) + len(KINDS) * sum(self.sets)
        curves += sum(2.0 * 0.4 * t ** (-4.0 / 3.0) for t in self.tolerances)
        methods = whole * 7.0 * sum(self.methods) if self.methods else 0.0
        at_points = points * (self.reference + self.seeds * curves)
        return float(at_points + self.surface * self.surface_reference + methods)


TOLERANCES = (0.05, 0.02, 0.01, 0.005, 0.002)
FULL = Extent(
    points=4096,
    reference=65_536,
    budgets=tuple(2**k for k in range(2, 13)),
    sets=(16, 64, 256, 1024),
    tolerances=(*TOLERANCES, 0.001),
    seeds=5,
    surface=20_000,
    surface_reference=1024,
    methods=(16, 64, 256, 1024),
)
QUICK = Extent(
    points=1024,
    reference=16_384,
    budgets=tuple(2**k for k in range(2, 13)),
    sets=(16, 64, 256),
    tolerances=TOLERANCES,
    seeds=2,
    surface=4000,
    surface_reference=512,
    methods=(16, 64),
)


def study_extent(*, quick: bool) -> Extent:
    """How much is measured: all, or what is done within half a minute for an asset of 20,000 faces."""
    return QUICK if quick else FULL


def measure(
    scene: Scene,
    settings: BakeSettings,
    extent: Extent,
    *,
    time_limit: float | None = None,
    kept: Kept | None = None,
    progress: Progress | None = None,
) -> Study:
    """Measure what accuracy costs on this asset.

    settings : of the bake; its rays, tolerance and method are what is varied
    time_limit : seconds that it may take, by an estimate before it starts; None: any
    kept : gives the reference, from where it was kept or by calling the function that it is given
    progress : called with (stage, done, total); whatever it raises stops the study
    Values and errors are the same on every run; seconds are not.
    Raises InputError for an asset without points to bake, SettingsError where the estimate is over the limit.
    """
    bench = bench_of(scene, settings, extent.points)
    if len(bench.points) == 0:
        who = f"{scene.source.path}: " if scene.source else ""
        raise InputError(f"{who}there is no triangle to bake, so there is nothing to study.")
    _refuse_if_long(bench, extent, time_limit)
    steps = _Steps(progress, 3 + len(KINDS) + 2 * len(extent.methods))
    steps.next("reference")
    truth = (kept or _made)(partial(bench.reference, extent.reference))
    seeds = range(1, extent.seeds + 1)
    steps.next("budgets")
    fixed = Curve(
        name="fixed rays",
        kind="budget",
        levels=tuple(
            level_of(str(rays), truth, [bench.run(bench.fixed(rays, seed)) for seed in seeds])
            for rays in extent.budgets
        ),
    )
    steps.next("tolerances")
    tolerances = _tolerance_curves(bench, extent, truth)
    sets = tuple(_set_curve(bench, extent, truth, kind, steps) for kind in KINDS)
    return Study(
        asset=scene.source.path.name if scene.source else "scene",
        points=len(bench.points),
        vertices=bench.whole,
        reference_rays=extent.reference,
        curves=(fixed, *tolerances, *sets),
        surface=_methods(bench, extent, steps),
        facts=_facts(scene, extent),
    )


def _made(find: Callable[[], FloatArray]) -> FloatArray:
    return find()


class _Steps:
    """Counts steps for a progress bar."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._done, self._total = progress, 0, total

    def next(self, stage: str) -> None:
        """A step begins."""
        if self._progress is not None:
            self._progress(stage, self._done, self._total)
        self._done += 1


def _refuse_if_long(bench: Bench, extent: Extent, time_limit: float | None) -> None:
    """Compile, look how fast rays are here, and raise SettingsError where the study would take too long."""
    some = replace(
        bench, points=bench.points.only(np.arange(min(WARMING_POINTS, len(bench.points))))
    )
    settings = bench.fixed(WARMING_RAYS, 0)
    some.run(settings)
    start = time.perf_counter()
    some.run(settings)
    rate = len(some.points) * WARMING_RAYS / max(time.perf_counter() - start, 1e-6)
    expected = extent.rays(bench.whole) / rate
    if time_limit is not None and expected > time_limit:
        cure = ", or make a quick study" if extent.reference > QUICK.reference else ""
        raise SettingsError(
            f"the study would take about {expected:.0f} s on this machine, and the time limit is "
            f"{time_limit:g} s. Raise the time limit{cure}."
        )


def _tolerance_curves(bench: Bench, extent: Extent, truth: FloatArray) -> tuple[Curve, ...]:
    """Each point to a tolerance, and all of them together."""

    def level(tolerance: float, form: ToleranceOf) -> Level:
        runs = [
            bench.run(
                replace(
                    bench.settings,
                    tolerance=tolerance,
                    tolerance_of=form,
                    quality=None,
                    max_rays=max(extent.budgets) * 4,
                    seed=seed,
                )
            )
            for seed in range(1, extent.seeds + 1)
        ]
        names = {value: f" ({name})" for name, value in QUALITIES.items()}
        said = (
            f"{tolerance:g}{names.get(tolerance, '')}" if form == "each" else f"rms:{tolerance:g}"
        )
        return level_of(said, truth, runs)

    forms: tuple[tuple[str, ToleranceOf], ...] = (("tolerance", "each"), ("tolerance rms", "rms"))
    return tuple(
        Curve(name=name, kind="tolerance", levels=tuple(level(t, form) for t in extent.tolerances))
        for name, form in forms
    )


def _set_curve(bench: Bench, extent: Extent, truth: FloatArray, kind: str, steps: _Steps) -> Curve:
    """One set of directions at several sizes."""
    steps.next(f"{kind} directions")
    levels = []
    for rays in extent.sets:
        sets = compared_sets(kind, rays)
        runs = [bench.run_sets(sets, rays, seed) for seed in range(1, extent.seeds + 1)]
        levels.append(level_of(str(rays), truth, runs))
    return Curve(name=kind, kind="directions", levels=tuple(levels))


def _methods(bench: Bench, extent: Extent, steps: _Steps) -> tuple[Curve, ...]:
    """Point sampling and least squares, against a dense bake of the surface between the vertices."""
    surface = surface_of_bench(bench, extent.surface, extent.surface_reference)
    if surface is None:
        return ()
    curves = []
    for name, fitted in (("point", False), ("lsq", True)):
        levels = []
        for rays in extent.methods:
            steps.next(f"method {name}")
            run = surface.run(bench.fixed(rays, 1), fitted=fitted)
            levels.append(level_of(str(rays), surface.truth, [run]))
        curves.append(Curve(name=name, kind="method", levels=tuple(levels)))
    return tuple(curves)


def _facts(scene: Scene, extent: Extent) -> dict[str, object]:
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {
        "triangles": scene.triangles,
        "instances": len(scene.instances),
        "seeds": extent.seeds,
        "versions": environment.versions(),
        "machine": environment.machine(),
        "processors": environment.processors(),
        "load": load,
    }

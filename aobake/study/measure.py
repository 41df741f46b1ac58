"""A study of vertices: one asset with every budget, every tolerance, every set of directions, and both methods."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.scene import Scene
from aobake.settings import BakeSettings, ToleranceOf
from aobake.study.bench import Bench, bench_of, surface_of_bench
from aobake.study.curves import Curve, Level, Study, level_of
from aobake.study.directions import KINDS, compared_sets
from aobake.study.facts import facts_of, name_of_asset
from aobake.study.reference import Kept, digest, made_anew
from aobake.study.steps import Progress, Steps
from aobake.study.ways import FORMS, rays_towards, refuse_longer, said, towards

__all__ = ["FULL", "QUICK", "Extent", "measure", "study_extent"]

FloatArray = NDArray[np.float64]

WARMING_RAYS, WARMING_POINTS = 256, 64


@dataclass(frozen=True, kw_only=True)
class Extent:
    """How much is measured.

    points : of the asset's vertices; reference : rays of each for the true value
    budgets : fixed numbers of rays; sets : those for each set of directions
    tolerances : in each form; seeds : repeats of everything, for bands and for the times
    surface : points all over the surface, against which methods are compared; methods : their budgets
    shown : budgets that pictures of the whole asset are made of, picture_size each; their errors are against
        shown_reference rays
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
    shown: tuple[int, ...] = ()
    shown_reference: int = 0
    picture_size: str = "320x240"

    def rays(self, whole: int) -> float:
        """About how many rays all of it takes, for an asset with so many vertices."""
        points = min(self.points, whole)
        towards_them = sum(len(FORMS) * rays_towards(t) for t in self.tolerances)
        curves = sum(self.budgets) + len(KINDS) * sum(self.sets) + towards_them
        methods = whole * 7.0 * sum(self.methods) if self.methods else 0.0
        at_points = points * (self.reference + self.seeds * curves)
        pictures = whole * (self.shown_reference + sum(self.shown))
        return float(at_points + self.surface * self.surface_reference + methods + pictures)


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
    shown=(4, 16, 64, 256, 1024),
    shown_reference=8192,
    picture_size="480x360",
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
    shown=(16, 64, 256),
    shown_reference=1024,
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
    kept : where the reference is kept; None: it is made anew
    progress : called with (stage, done, total); whatever it raises stops the study
    Values and errors are the same on every run; seconds are not.
    Raises InputError for an asset without points to bake, SettingsError where the estimate is over the limit.
    """
    bench = bench_of(scene, settings, extent.points)
    if len(bench.points) == 0:
        who = f"{scene.source.path}: " if scene.source else ""
        raise InputError(f"{who}there is no triangle to bake, so there is nothing to study.")
    _refuse_if_long(bench, extent, time_limit)
    steps = Steps(progress, 3 + len(KINDS) + 2 * len(extent.methods))
    steps.next("reference")
    known = digest(scene, settings, (extent.points, extent.reference))
    truth = (kept or made_anew)(known, partial(bench.reference, extent.reference))
    seeds = range(1, extent.seeds + 1)
    steps.next("budgets")
    budgets = Curve(
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
        asset=name_of_asset(scene),
        what="vertices",
        points=len(bench.points),
        whole=bench.whole,
        reference_rays=extent.reference,
        curves=(budgets, *tolerances, *sets),
        surface=_methods(bench, extent, steps),
        facts=facts_of(scene, extent.seeds),
    )


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
    refuse_longer(expected, time_limit, quicker=extent.reference > QUICK.reference)


def _tolerance_curves(bench: Bench, extent: Extent, truth: FloatArray) -> tuple[Curve, ...]:
    """Each point to a tolerance, and all of them together."""
    most = 4 * max(extent.budgets)

    def level(tolerance: float, form: ToleranceOf) -> Level:
        runs = [
            bench.run(towards(bench.settings, tolerance, form, most, seed))
            for seed in range(1, extent.seeds + 1)
        ]
        return level_of(said(tolerance, form), truth, runs)

    return tuple(
        Curve(name=name, kind="tolerance", levels=tuple(level(t, form) for t in extent.tolerances))
        for name, form in FORMS
    )


def _set_curve(bench: Bench, extent: Extent, truth: FloatArray, kind: str, steps: Steps) -> Curve:
    """One set of directions at several sizes."""
    steps.next(f"{kind} directions")
    levels = []
    for rays in extent.sets:
        sets = compared_sets(kind, rays)
        runs = [bench.run_sets(sets, rays, seed) for seed in range(1, extent.seeds + 1)]
        levels.append(level_of(str(rays), truth, runs))
    return Curve(name=kind, kind="directions", levels=tuple(levels))


def _methods(bench: Bench, extent: Extent, steps: Steps) -> tuple[Curve, ...]:
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

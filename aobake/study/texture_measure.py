"""A study of a texture: one asset laid out once, and baked with every budget and every tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.scene import Scene
from aobake.settings import BakeSettings
from aobake.study.curves import Curve, Level, Run, Study, level_of
from aobake.study.facts import facts_of, name_of_asset
from aobake.study.pictures import Picture, heat
from aobake.study.reference import Kept, digest, made_anew
from aobake.study.steps import Progress, Steps
from aobake.study.texture_bench import TextureBench, expected_seconds, texture_bench
from aobake.study.ways import FORMS, fixed, rays_towards, refuse_longer, said, towards

__all__ = ["TextureExtent", "measure_texture", "texture_extent"]

FloatArray = NDArray[np.float64]

DENOISED = ", denoised"
OUTSIDE = np.array([0.90, 0.92, 0.95], np.float32)  # of the charts


@dataclass(frozen=True, kw_only=True)
class TextureExtent:
    """How much is measured.

    reference : rays of each texel for the true value
    budgets : fixed numbers of rays; tolerances : in each form; seeds : repeats of everything
    shown : the budgets that pictures are made of
    """

    reference: int
    budgets: tuple[int, ...]
    tolerances: tuple[float, ...]
    seeds: int
    shown: tuple[int, ...]

    @property
    def rays(self) -> float:
        """About how many rays all of it takes at each texel."""
        towards_them = sum(len(FORMS) * rays_towards(t) for t in self.tolerances)
        return self.reference + self.seeds * (sum(self.budgets) + towards_them)

    @property
    def bakes(self) -> int:
        """How many bakes all of it takes."""
        return 1 + self.seeds * (len(self.budgets) + len(FORMS) * len(self.tolerances))


FULL = TextureExtent(
    reference=4096,
    budgets=tuple(2**k for k in range(2, 11)),
    tolerances=(0.05, 0.02, 0.01, 0.005, 0.002),
    seeds=2,
    shown=(4, 16, 64, 256, 1024),
)
QUICK = TextureExtent(
    reference=1024,
    budgets=tuple(2**k for k in range(2, 9)),
    tolerances=(0.02, 0.01),
    seeds=2,
    shown=(4, 16, 64, 256),
)


def texture_extent(*, quick: bool) -> TextureExtent:
    """How much is measured: all, or what is done within half a minute for an asset of 20,000 faces."""
    return QUICK if quick else FULL


def measure_texture(
    scene: Scene,
    settings: BakeSettings,
    extent: TextureExtent,
    *,
    time_limit: float | None = None,
    kept: Kept | None = None,
    progress: Progress | None = None,
) -> tuple[Study, tuple[tuple[Picture, ...], ...]]:
    """Measure what accuracy costs in a texture of this asset, with and without denoising.

    settings : of the bake; its rays and tolerance are what is varied. Without denoise, or where that is auto and
        the denoiser is not installed, there are no curves with it
    time_limit, kept, progress : as for measure
    Returns the study, and a row of pictures for each budget that is shown: the first page beside its error.
    Values and errors are the same on every run; seconds are not.
    Raises InputError for an asset without points to bake, SettingsError where the estimate is over the limit,
    and what bake_texture raises.
    """
    if scene.triangles == 0:
        who = f"{scene.source.path}: " if scene.source else ""
        raise InputError(f"{who}there is no triangle to bake, so there is nothing to study.")
    if time_limit is not None:
        expected = expected_seconds(scene, settings, extent.rays, extent.bakes)
        refuse_longer(expected, time_limit, quicker=extent.reference > QUICK.reference)
    steps = Steps(progress, 1 + len(extent.budgets) + len(FORMS) * len(extent.tolerances))
    bench = texture_bench(scene, settings, progress)
    steps.next("reference")
    known = digest(scene, bench.bake.settings, (extent.reference,), layout=bench.layout())
    truth = (kept or made_anew)(known, partial(bench.reference, extent.reference))
    budgets, pictures = _budgets(bench, extent, truth, steps)
    study = Study(
        asset=name_of_asset(scene),
        what="texels",
        points=bench.texels,
        whole=bench.texels,
        reference_rays=extent.reference,
        curves=(*budgets, *_tolerances(bench, extent, truth, steps)),
        surface=(),
        facts={**_told(bench), **facts_of(scene, extent.seeds)},
    )
    return study, pictures


def _budgets(
    bench: TextureBench, extent: TextureExtent, truth: FloatArray, steps: Steps
) -> tuple[tuple[Curve, ...], tuple[tuple[Picture, ...], ...]]:
    """The curves of fixed numbers of rays, and pictures of some."""
    levels, pictures = [], []
    for rays in extent.budgets:
        steps.next("budgets")
        runs = [
            bench.runs(fixed(bench.bake.settings, rays, seed))
            for seed in range(1, extent.seeds + 1)
        ]
        levels.append(_levels(str(rays), truth, runs))
        if rays in extent.shown:
            pictures.append(_pictures(bench, rays, runs[0], truth))
    return _curves("fixed rays", "budget", levels), tuple(pictures)


def _tolerances(
    bench: TextureBench, extent: TextureExtent, truth: FloatArray, steps: Steps
) -> tuple[Curve, ...]:
    """The curves of tolerances, in each form."""
    most = 4 * max(extent.budgets)
    curves: list[Curve] = []
    for name, form in FORMS:
        levels = []
        for tolerance in extent.tolerances:
            steps.next("tolerances")
            runs = [
                bench.runs(towards(bench.bake.settings, tolerance, form, most, seed))
                for seed in range(1, extent.seeds + 1)
            ]
            levels.append(_levels(said(tolerance, form), truth, runs))
        curves += _curves(name, "tolerance", levels)
    return tuple(curves)


def _levels(setting: str, truth: FloatArray, runs: Sequence[tuple[Run, ...]]) -> tuple[Level, ...]:
    """The level as it was traced, and denoised, from runs with different seeds."""
    ways = zip(*runs, strict=True)
    return tuple(level_of(setting, truth, way) for way in ways)


def _curves(name: str, kind: str, levels: Sequence[tuple[Level, ...]]) -> tuple[Curve, ...]:
    """The curve as it was traced, and denoised."""
    names = (name, name + DENOISED)
    return tuple(
        Curve(name=names[way], kind=kind, levels=found, denoised=bool(way))
        for way, found in enumerate(zip(*levels, strict=True))
    )


def _pictures(
    bench: TextureBench, rays: int, runs: Sequence[Run], truth: FloatArray
) -> tuple[Picture, ...]:
    """The first page as it was traced and its error, and the same denoised."""
    covered, row = bench.covered[0], []
    for (values, _, _, _), words in zip(runs, ("", DENOISED), strict=False):
        here = slice(0, int(covered.sum()))
        for shown, caption in (
            (values[here, None], f"{rays:,} rays{words}"),
            (heat(np.abs(values - truth)[here].astype(np.float32)), "its error"),
        ):
            pixels = np.broadcast_to(OUTSIDE, (*covered.shape, 3)).copy()
            pixels[covered] = shown
            row.append(Picture(caption=caption, pixels=pixels))
    return tuple(row)


def _told(bench: TextureBench) -> dict[str, object]:
    """What a texture has besides what every study tells."""
    pages, size = bench.bake.layout.pages, bench.bake.settings.size
    return {
        "texture": f"{size} x {size}" + (f", {len(pages)} images" if len(pages) > 1 else ""),
        "layout": "; ".join(dict.fromkeys(page.origin for page in pages)),
        "seconds of unwrapping": bench.bake.seconds["unwrap"],
        "denoiser": bench.why_not or "Open Image Denoise",
    }

"""The asset laid out on a texture: its true texels, and a bake of it in each way, with and without the denoiser."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.denoise import available, denoised
from aobake.atlas.post import TracedPage
from aobake.errors import InputError
from aobake.lightmaps import (
    TextureBake,
    TracedBand,
    bands_of,
    prepare_texture,
    put_together,
    trace_bands,
)
from aobake.meshes.scene import Scene
from aobake.plan import texture_plan
from aobake.planning.cost import estimated
from aobake.settings import BakeSettings
from aobake.study.bench import REFERENCE_SEED
from aobake.study.curves import Run
from aobake.study.steps import Progress
from aobake.study.ways import fixed

__all__ = ["TextureBench", "expected_seconds", "studied", "texture_bench"]

FloatArray = NDArray[np.float64]

WARMING_RAYS = 64
TURNS = 3  # of which the median tells what normals take
ONCE = ("prepare", "build", "unwrap")


@dataclass(frozen=True, eq=False, kw_only=True)
class TextureBench:
    """An asset with its place on a texture, ready to be baked over and over.

    bake : everything but how many rays; why_not : why no denoiser is compared, else empty
    covered : of each page, (H, W) bool; guiding : seconds of what only a denoised bake has to know
    """

    bake: TextureBake
    why_not: str
    covered: tuple[NDArray[np.bool_], ...]
    guiding: float

    @property
    def texels(self) -> int:
        """Those that surfaces lie on, on all pages."""
        return sum(int(page.sum()) for page in self.covered)

    def layout(self) -> Iterator[NDArray[np.generic]]:
        """Where the surfaces lie, as arrays."""
        for page in self.bake.layout.pages:
            yield from page.corners
            yield from page.charts

    def reference(self, rays: int) -> FloatArray:
        """(T,) the true values of the covered texels, as nearly as so many rays tell."""
        return self._values([page.values for page in self._pages(self._parts(rays))])

    def _parts(self, rays: int) -> list[TracedBand]:
        bake = replace(self.bake, settings=fixed(self.bake.settings, rays, REFERENCE_SEED))
        return list(trace_bands(bake, bands_of(bake)))

    def runs(self, settings: BakeSettings) -> tuple[Run, ...]:
        """What the rays that settings ask for come to: as they were traced, and denoised where that is compared.

        Values are those before rims are lit and seams joined, which move texels at the borders of charts whatever
        the rays. Seconds are those of everything that a bake repeats for other rays.
        """
        start = time.perf_counter()
        bake = replace(self.bake, settings=settings)
        parts = list(trace_bands(bake, bands_of(bake)))
        image = put_together(_denoising(bake, on=False), parts)
        spent = max(time.perf_counter() - start - self.guiding, 0.0)
        pages = self._pages(parts)
        errors = self._values(image.standard_errors)
        rays = image.rays / self.texels
        traced = self._values([page.values for page in pages]), errors, rays, spent
        if self.why_not:
            return (traced,)
        start = time.perf_counter()
        smooth = [
            denoised(page.values, page.error, page.chart, page.normal, threads=settings.threads)
            for page in pages
        ]
        spent += time.perf_counter() - start + self.guiding
        return traced, (self._values(smooth), errors, rays, spent)

    def _pages(self, parts: Sequence[TracedBand]) -> list[TracedPage]:
        """Pages as they were traced."""
        size = self.bake.settings.size
        pages = [parts[0].texels.blank_like((size, size)) for _ in self.bake.layout.pages]
        for part in parts:
            pages[part.band.page].put(part.band.rows, part.texels)
        return pages

    def _values(self, pages: Sequence[NDArray[np.float32]]) -> FloatArray:
        """(T,) those of the covered texels of pages."""
        parts = [page[covered] for page, covered in zip(pages, self.covered, strict=True)]
        return np.concatenate(parts).astype(np.float64)

    def moved_later(self, rays: int) -> FloatArray:
        """(T,) by how much lit rims and joined seams move each covered texel of a bake that is not denoised."""
        parts = self._parts(rays)
        image = put_together(_denoising(self.bake, on=False), parts)
        return self._values(image.images) - self._values([p.values for p in self._pages(parts)])


def studied(settings: BakeSettings) -> tuple[BakeSettings, str]:
    """The settings with a denoiser that is on or off, and why it is off.

    What is in an old texture, and bent normals, are no matter of accuracy: neither is taken in.
    """
    settings = replace(settings, strict=False, blend="replace", bent_normals=False)
    if settings.denoise == "off":
        return settings, "denoise is off"
    if settings.denoise == "auto" and not available():
        return replace(settings, denoise="off"), "pyoidn is not installed (aobake[denoise])"
    return replace(settings, denoise="on"), ""


def texture_bench(
    scene: Scene, settings: BakeSettings, progress: Progress | None = None
) -> TextureBench:
    """Lay an asset out, once for all bakes.

    Raises what bake_texture raises, and InputError for an asset without a triangle that has an area.
    """
    settings, why_not = studied(settings)
    bake = prepare_texture(scene, fixed(settings, settings.rays, 0), progress=progress)
    if not bake.layout.pages:
        who = f"{scene.source.path}: " if scene.source else ""
        raise InputError(f"{who}there is no triangle to bake, so there is nothing to study.")
    few = replace(bake, settings=fixed(bake.settings, 1, 0))
    covered = put_together(_denoising(few, on=False), trace_bands(few, bands_of(few))).coverages
    return TextureBench(
        bake=bake,
        why_not=why_not,
        covered=covered,
        guiding=0.0 if why_not else _guiding(few),
    )


def _denoising(bake: TextureBake, *, on: bool) -> TextureBake:
    """The bake with its denoiser switched."""
    effects = dict(bake.plan.effects)
    effects["denoise"] = replace(effects["denoise"], on=on)
    return replace(bake, plan=replace(bake.plan, effects=effects), seconds={})


def _guiding(bake: TextureBake) -> float:
    """Seconds that the normals take which guide a denoiser: texels are found with them and without, in turn."""
    extra = []
    for _ in range(TURNS):
        seconds = []
        for on in (True, False):
            parts = trace_bands(_denoising(bake, on=on), bands_of(bake))
            seconds.append(sum(part.seconds.get("texels", 0.0) for part in parts))
        extra.append(seconds[0] - seconds[1])
    return max(0.0, float(np.median(extra)))


def expected_seconds(scene: Scene, settings: BakeSettings, rays: float, bakes: int) -> float:
    """About how long it takes to lay an asset out and to bake it so often, all bakes having `rays` a texel.

    Measured on some of its points; takes about a second. Raises what planning.cost.estimated raises.
    """
    settings = fixed(studied(settings)[0], WARMING_RAYS, 0)
    cost = estimated(texture_plan(scene, settings), scene, settings, texture=True)
    once = sum(cost.stages.get(stage, 0.0) for stage in ONCE)
    traced = cost.stages["trace"] * rays / WARMING_RAYS
    return once + traced + bakes * (cost.seconds - once - cost.stages["trace"])

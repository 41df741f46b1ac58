"""Pages of a texture bake, put together from bands that were traced here or elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.layout import Page
from aobake.atlas.post import TracedPage, finished, finished_bent
from aobake.atlas.seams import Seams, find_seams, joined_seams
from aobake.errors import InputError
from aobake.findings import Finding, FindingKind
from aobake.lightmaps.bands import Band, Marked, Tally, TextureBake, TracedBand, bands_of
from aobake.meshes.lightmap import BentPages, Lightmap
from aobake.meshes.scene import Scene
from aobake.occlusion import STATES
from aobake.prepare import name_of, placed_nowhere, refuse
from aobake.results import BakedTexture
from aobake.stages import timed

__all__ = ["put_together"]


def put_together(bake: TextureBake, traced: Iterable[TracedBand]) -> BakedTexture:
    """The result of a bake, from all of its bands.

    traced : each of bands_of(bake) once, in any order. A page is finished as soon as it is whole, so memory
        stays low where the bands of a page come in one run
    The seconds of a stage are added up over all processes that had a part in it.
    Raises InputError where a band is missing, comes twice or is none of this bake, and where settings.strict
    is on and anything was found at texels; EngineError where the denoiser fails.
    """
    assembly = _Assembly(bake)
    for part in traced:
        assembly.take(part)
    return assembly.result()


@dataclass(frozen=True, eq=False)
class _Finished:
    """An image, where surfaces lie on it, and its error as it was traced; all (H, W).

    bent : (H, W, 3) its bent normals, or None
    """

    image: NDArray[np.float32]
    covered: NDArray[np.bool_]
    error: NDArray[np.float32]
    bent: NDArray[np.float32] | None


class _Assembly:
    """Pages while their bands come in, and what is added up over all bands."""

    def __init__(self, bake: TextureBake) -> None:
        self.bake = bake
        self.missing: dict[int, set[Band]] = {}
        for band in bands_of(bake):
            self.missing.setdefault(band.page, set()).add(band)
        self.begun: dict[int, TracedPage] = {}
        self.finished: dict[int, _Finished] = {}
        self.rays = self.samples = self.under_open_sky = 0
        self.tally: dict[tuple[int, FindingKind], Marked] = {}
        self.warnings: set[str] = set()
        self.seconds = dict(bake.seconds)

    def take(self, part: TracedBand) -> None:
        """Take in a band, and finish its page where nothing else is missing."""
        missing = self.missing.get(part.band.page, set())
        if part.band not in missing:
            raise InputError(
                f"{_named(part.band)} came twice or is none of this bake. "
                "Give each of bands_of(bake) once."
            )
        missing.remove(part.band)
        self._put(part)
        self._add_up(part)
        if not missing:
            self._finish(part.band.page)

    def _put(self, part: TracedBand) -> None:
        number, size = part.band.page, self.bake.settings.size
        if number not in self.begun:
            self.begun[number] = part.texels.blank_like((size, size))
        self.begun[number].put(part.band.rows, part.texels)

    def _add_up(self, part: TracedBand) -> None:
        self.rays += part.rays
        self.samples += part.samples
        self.under_open_sky += part.under_open_sky
        for key, marked in part.tally.items():
            self.tally[key] = self.tally.get(key, Marked()).with_more(marked)
        self.warnings.update(part.warnings)
        for stage, spent in part.seconds.items():
            self.seconds[stage] = self.seconds.get(stage, 0.0) + spent

    def _finish(self, number: int) -> None:
        page, traced = self.bake.layout.pages[number], self.begun.pop(number)
        with timed(self.seconds, "finish"):
            seams = _seams(self.bake, page)
        image = finished(
            traced,
            seams,
            denoise=self.bake.denoises,
            threads=self.bake.settings.threads,
            seconds=self.seconds,
        )
        with timed(self.seconds, "finish"):
            bent = None if traced.bent is None else finished_bent(traced)
        self.finished[number] = _Finished(image, traced.chart >= 0, traced.error, bent)

    def result(self) -> BakedTexture:
        """All pages in order, and what was found."""
        bake = self.bake
        for band in bands_of(bake):
            if band in self.missing[band.page]:
                raise InputError(f"{_named(band)} is missing. Give each of bands_of(bake) once.")
        found = (*bake.findings, *_findings(bake.scene, self.tally))
        if bake.settings.strict:
            refuse(bake.scene, found)
        pages = [self.finished[number] for number in range(len(bake.layout.pages))]
        images = tuple(page.image for page in pages)
        bent = tuple(page.bent for page in pages if page.bent is not None)
        return BakedTexture(
            scene=bake.scene,
            settings=bake.settings,
            plan=bake.plan.with_open_sky(self.under_open_sky, self.samples),
            lightmap=Lightmap(
                pages=images,
                placings=bake.layout.placings,
                bent=BentPages(pages=bent, space=bake.settings.bent_space)
                if bake.settings.bent_normals
                else None,
            ),
            coverages=tuple(page.covered for page in pages),
            standard_errors=tuple(page.error for page in pages),
            layout=tuple(page.origin for page in bake.layout.pages),
            rays=self.rays,
            seconds=self.seconds,
            findings=found,
            warnings=(
                *bake.scene.warnings,
                *placed_nowhere(bake.scene),
                *bake.prepared.warnings,
                *map(str, found),
                *sorted(self.warnings),
            ),
        )


def _named(band: Band) -> str:
    return f"page {band.page}, rows {band.rows.start} to {band.rows.stop - 1}"


def _findings(scene: Scene, tally: Tally) -> tuple[Finding, ...]:
    """What was found about texels, in the order of the instances; those of one name are told together."""
    order = {kind: rank for rank, kind in enumerate(STATES)}
    told: dict[tuple[str, FindingKind], Marked] = {}
    for number, kind in sorted(tally, key=lambda key: (key[0], order[key[1]])):
        key = name_of(scene, number), kind
        told[key] = told.get(key, Marked()).with_more(tally[number, kind])
    return tuple(
        Finding(
            kind=kind, where=f"{name}, texels on faces", count=marked.count, examples=marked.faces
        )
        for (name, kind), marked in told.items()
    )


def _seams(bake: TextureBake, page: Page) -> Seams:
    """The seams of all instances on a page; those between instances are none."""
    several = []
    for number, corners, charts in zip(page.instances, page.corners, page.charts, strict=True):
        stands = bake.prepared.placed[number]
        if stands is not None:
            mesh, chosen = bake.scene.meshes[stands[0].mesh], charts >= 0
            faces = mesh.faces[chosen]
            several.append(
                find_seams(mesh.vertices, faces, corners[chosen], stands[1].normals[faces])
            )
    return joined_seams(several)

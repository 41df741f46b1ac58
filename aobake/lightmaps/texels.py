"""Bands of texels, traced: so memory does not grow with the rays or the samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.layout import Page
from aobake.atlas.post import TracedPage
from aobake.atlas.rasterize import Texels, placed_faces, texels
from aobake.lightmaps.bands import Band, TextureBake, TracedBand
from aobake.lightmaps.bent import PageFrames
from aobake.lightmaps.samples import Counts, OpenPage, Samples, sampled, shading_points
from aobake.meshes.normals import unit_rows
from aobake.meshes.scene import Scene
from aobake.stages import timed

__all__ = ["trace_bands"]

Progress = Callable[[str, int, int], None]
Report = Callable[[float], None]

PARTS = 1000  # of a band, for the progress


def trace_bands(
    bake: TextureBake, bands: Sequence[Band], progress: Progress | None = None
) -> Iterator[TracedBand]:
    """Trace bands of a bake, one after another, as they are asked for.

    bands : some of bands_of(bake); those of a page best in one run
    progress : called in the calling thread with ("trace", done, total); whatever it raises stops the work,
        as does a KeyboardInterrupt
    """
    done = 0
    for number, several in groupby(bands, lambda band: band.page):
        page = _opened(bake, number)
        for band in several:
            yield _traced(page, band, _share(progress, done, len(bands)))
            done += 1


def _share(progress: Progress | None, done: int, bands: int) -> Report:
    """What one band reports its share to."""
    if progress is None:
        return lambda _: None
    return lambda share: progress("trace", int((done + share) * PARTS), bands * PARTS)


def _opened(bake: TextureBake, number: int) -> OpenPage:
    page, size, finer = bake.layout.pages[number], bake.settings.size, bake.settings.supersample
    return OpenPage(
        bake=bake,
        page=page,
        placed=placed_faces(page.corners, page.charts, size, size),
        frames=PageFrames(bake, page) if bake.settings.bent_normals else None,
        members=_members(bake.scene, page),
        first=number * (size * finer) ** 2,
    )


def _members(scene: Scene, page: Page) -> list[list[int]]:
    """For each instance on the page, itself and those that share its place in the file."""
    others: dict[int, list[int]] = {}
    for number, instance in enumerate(scene.instances):
        if instance.stored_with not in {None, number}:
            others.setdefault(int(instance.stored_with or 0), []).append(number)
    return [[number, *others.get(number, ())] for number in page.instances]


def _traced(page: OpenPage, band: Band, report: Report) -> TracedBand:
    """Trace a band. report : called with the share that is done."""
    bake, counts = page.bake, Counts()
    traced = _blank(page, band)
    with timed(counts.seconds, "texels"):
        found = texels(page.placed, band.rows, bake.settings.supersample)
    if len(found.pixel):
        samples = sampled(page, found, counts, report)
        with timed(counts.seconds, "texels"):
            at = found.pixel - band.rows.start * bake.settings.size
            _put(at, samples, traced)
            _put_guides(page, found, at, traced)
    report(1.0)
    return TracedBand(
        band=band,
        texels=traced,
        rays=counts.rays,
        samples=counts.samples,
        under_open_sky=counts.under_open_sky,
        tally=counts.tally,
        warnings=tuple(bake.materials.warnings),
        seconds=counts.seconds,
    )


def _blank(page: OpenPage, band: Band) -> TracedPage:
    """The rows of a band before anything lies on them."""
    bake = page.bake
    return TracedPage.blank(
        (len(band.rows), bake.settings.size),
        normal=bake.denoises,
        before=bake.settings.blend == "multiply" and _has_occlusion(bake.scene, page.page),
        bent=page.frames is not None,
    )


def _has_occlusion(scene: Scene, page: Page) -> bool:
    """Whether a material on the page has an occlusion texture."""
    meshes = [scene.meshes[scene.instances[number].mesh] for number in page.instances]
    return any(
        mesh.material is not None and scene.materials[mesh.material].occlusion_texture is not None
        for mesh in meshes
    )


def _put(pixel: NDArray[np.int64], samples: Samples, traced: TracedPage) -> None:
    """The mean over the samples of each texel, and its error."""
    start = int(pixel[0])
    counts = np.bincount(pixel - start)
    covered = np.flatnonzero(counts)
    counted = counts[covered]
    sums = np.bincount(pixel - start, samples.mean)[covered]
    spread = np.bincount(pixel - start, samples.variance)[covered]
    traced.values.reshape(-1)[start + covered] = sums / counted
    traced.error.reshape(-1)[start + covered] = np.sqrt(spread) / counted
    if traced.bent is not None and samples.bent is not None:
        parts = [np.bincount(pixel - start, part)[covered] for part in samples.bent.T]
        traced.bent.reshape(-1, 3)[start + covered] = unit_rows(np.stack(parts, axis=1))


def _put_guides(page: OpenPage, found: Texels, at: NDArray[np.int64], traced: TracedPage) -> None:
    """What else is known at the texels: the chart, and what a denoiser and an old texture say."""
    traced.chart.reshape(-1)[at] = found.chart
    if traced.normal is not None:
        traced.normal.reshape(-1, 3)[at] = shading_points(page, found).normals
    if traced.before is not None:
        for owner in np.unique(found.owner).tolist():
            mine = np.flatnonzero(found.owner == owner)
            mesh = page.bake.scene.meshes[
                page.bake.scene.instances[page.page.instances[owner]].mesh
            ]
            held = page.bake.materials.occlusion(mesh, found.face[mine], found.weights[mine])
            if held is not None:
                traced.before.reshape(-1)[at[mine]] = held

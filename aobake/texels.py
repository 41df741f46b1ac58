"""A page of texels, traced in bands of rows, so that memory does not grow with the rays or the samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.layout import Page
from aobake.atlas.material_texels import MaterialTexels
from aobake.atlas.post import TracedPage
from aobake.atlas.rasterize import Texels, placed_faces, texels
from aobake.findings import EXAMPLES, Finding, FindingKind
from aobake.meshes.scene import FloatArray, Scene
from aobake.occlusion import STATES, occlusion_at
from aobake.open_sky import OpenSky
from aobake.points import SurfacePoints, points_on_faces
from aobake.prepare import Prepared, name_of
from aobake.settings import BakeSettings
from aobake.stages import timed
from aobake.tracing.estimate import Estimates
from aobake.tracing.origins import OPEN

__all__ = ["TexelJob", "trace_page"]

Float32Array = NDArray[np.float32]
Report = Callable[[float], None]

MOST_TURNS = 64  # instances that are stored together, of which one texel takes its mean
LEAST_RAYS = 4  # for each of them
BAND_SAMPLES = 1 << 20  # of a band of rows; each takes about 200 bytes


@dataclass(frozen=True)
class Marked:
    """count : samples; faces : on which the first few of them lie."""

    count: int = 0
    faces: tuple[int, ...] = ()

    def with_more(self, other: Marked) -> Marked:
        faces = tuple(dict.fromkeys((*self.faces, *other.faces)))
        return Marked(self.count + other.count, faces[:EXAMPLES])


@dataclass(frozen=True, eq=False, kw_only=True)
class TexelJob:
    """What all pages of a bake have in common.

    ground : the height of the ground along its axis, or None
    sky : what is known of points that everything lies below
    guides : whether a denoiser will want to know normals
    seconds : stage -> seconds, added to
    rays : spent by each band, added to
    samples, under_open_sky : in each band, and how many of them everything lies below, added to
    tally : (instance, name of a state) -> the samples in this state, added to
    """

    scene: Scene
    prepared: Prepared
    settings: BakeSettings
    materials: MaterialTexels
    ground: float | None
    sky: OpenSky
    guides: bool
    seconds: dict[str, float]
    rays: list[int] = field(default_factory=list)
    samples: list[int] = field(default_factory=list)
    under_open_sky: list[int] = field(default_factory=list)
    tally: dict[tuple[int, FindingKind], Marked] = field(default_factory=dict)

    def findings(self) -> tuple[Finding, ...]:
        """What was found about texels, in the order of the instances; those of one name are told together."""
        order = {kind: rank for rank, kind in enumerate(STATES)}
        told: dict[tuple[str, FindingKind], Marked] = {}
        for number, kind in sorted(self.tally, key=lambda key: (key[0], order[key[1]])):
            key = name_of(self.scene, number), kind
            told[key] = told.get(key, Marked()).with_more(self.tally[number, kind])
        return tuple(
            Finding(
                kind=kind,
                where=f"{name}, texels on faces",
                count=marked.count,
                examples=marked.faces,
            )
            for (name, kind), marked in told.items()
        )


def trace_page(job: TexelJob, page: Page, number: int, report: Report | None = None) -> TracedPage:
    """Trace the texels of a page.

    number : of the page, which makes its random directions its own
    report : called with the share that is done, in the calling thread
    """
    size, finer = job.settings.size, job.settings.supersample
    placed = placed_faces(page.corners, page.charts, size, size)
    traced = _blank(job, page, size)
    members = _members(job.scene, page)
    first = number * (size * finer) ** 2
    for rows in _bands(size, finer):
        with timed(job.seconds, "texels"):
            found = texels(placed, rows, finer)
        if len(found.pixel):
            numbers = _numbers(found.pixel, first, finer)
            advance = _part_of(report, rows.start / size, len(rows) / size)
            _trace_band(job, page, members, found, numbers, traced, advance)
    return traced


def _part_of(report: Report | None, begin: float, length: float) -> Report:
    """What a part of the work reports its share to; all of it is 1 long."""
    if report is None:
        return lambda _: None
    return lambda share: report(begin + length * share)


def _in_counts(report: Report) -> Callable[[int, int], None]:
    return lambda done, of: report(done / max(of, 1))


def _bands(size: int, finer: int) -> Iterator[range]:
    height = max(1, BAND_SAMPLES // (size * finer * finer))
    for start in range(0, size, height):
        yield range(start, min(start + height, size))


def _blank(job: TexelJob, page: Page, size: int) -> TracedPage:
    scene = job.scene
    meshes = [scene.meshes[scene.instances[number].mesh] for number in page.instances]
    taken = job.settings.blend == "multiply" and any(
        mesh.material is not None and scene.materials[mesh.material].occlusion_texture is not None
        for mesh in meshes
    )
    return TracedPage(
        values=np.ones((size, size), np.float32),
        error=np.zeros((size, size), np.float32),
        chart=np.full((size, size), -1, np.int32),
        normal=np.zeros((size, size, 3), np.float32) if job.guides else None,
        before=np.ones((size, size), np.float32) if taken else None,
    )


def _trace_band(
    job: TexelJob,
    page: Page,
    members: Sequence[Sequence[int]],
    found: Texels,
    numbers: NDArray[np.int64],
    traced: TracedPage,
    advance: Report,
) -> None:
    """Trace the samples of a band of rows into the page.

    members : for each instance on the page, itself and those that share its place in the file
    numbers : (T,) int64, what makes the directions of each sample its own
    advance : called with the share of the band that is done
    """
    means, variances = np.empty(len(found.pixel)), np.empty(len(found.pixel))
    turns = np.array([min(len(several), MOST_TURNS) for several in members], np.int64)[found.owner]
    for count in np.unique(turns).tolist():
        chosen = np.flatnonzero(turns == count)
        part = _part_of(advance, float(np.mean(turns < count)), len(chosen) / len(turns))
        several = [mine if min(len(mine), MOST_TURNS) == count else () for mine in members]
        means[chosen], variances[chosen] = _mean_over(
            job, several, found, chosen, numbers, count, part
        )
    with timed(job.seconds, "texels"):
        _put(found.pixel, means, variances, traced)
        _put_guides(job, page, found, traced)


def _mean_over(
    job: TexelJob,
    members: Sequence[Sequence[int]],
    found: Texels,
    chosen: NDArray[np.int64],
    numbers: NDArray[np.int64],
    turns: int,
    advance: Report,
) -> tuple[FloatArray, FloatArray]:
    """Mean and variance at the chosen samples, each over `turns` of the instances that are stored together.

    They share the rays of one. Where there are more instances than turns, each sample takes some that are
    evenly spread, and others than its neighbours; how much these differ is in the variance.
    """
    settings = job.settings
    if turns > 1:
        settings = replace(settings, rays=max(LEAST_RAYS, -(-settings.rays // turns)))
    total, squares, variance = (np.zeros(len(chosen)) for _ in range(3))
    sizes = np.array([max(len(several), 1) for several in members], np.int64)[found.owner[chosen]]
    begins = np.cumsum([0, *(len(several) for several in members)])[found.owner[chosen]]
    flat = np.array([number for several in members for number in several], np.int32)
    for turn in range(turns):
        part = _part_of(advance, turn / turns, 1.0 / turns)
        which = flat[begins + (numbers[chosen] + turn * sizes // turns) % sizes]
        with timed(job.seconds, "texels"):
            points = _points(job, found, chosen, which, numbers[chosen] * turns + turn)
        with timed(job.seconds, "trace"):
            estimates = occlusion_at(
                job.prepared, points, job.ground, settings, _in_counts(part), job.sky
            )
        _count(job, which, found.face[chosen], estimates)
        total += estimates.mean
        squares += estimates.mean.astype(np.float64) ** 2
        variance += estimates.standard_error.astype(np.float64) ** 2
        job.rays.append(int(estimates.rays.sum(dtype=np.int64)))
        job.samples.append(len(estimates.states))
        job.under_open_sky.append(int((estimates.states == OPEN).sum()))
    mean = total / turns
    between = np.maximum(squares / turns - mean**2, 0.0) * (sizes > turns) / max(turns - 1, 1)
    return mean, variance / turns**2 + between


def _members(scene: Scene, page: Page) -> list[list[int]]:
    """For each instance on the page, itself and those that share its place in the file."""
    others: dict[int, list[int]] = {}
    for number, instance in enumerate(scene.instances):
        if instance.stored_with not in {None, number}:
            others.setdefault(int(instance.stored_with or 0), []).append(number)
    return [[number, *others.get(number, ())] for number in page.instances]


def _numbers(pixel: NDArray[np.int64], first: int, finer: int) -> NDArray[np.int64]:
    """(T,) numbers that belong to samples whatever bands a page is cut into: of the texel, and within it."""
    rank = np.arange(len(pixel)) - np.searchsorted(pixel, pixel)
    return first + pixel * (finer * finer) + rank


def _put(
    pixel: NDArray[np.int64], means: FloatArray, variances: FloatArray, traced: TracedPage
) -> None:
    """The mean over the samples of each texel, and its error."""
    start = int(pixel[0])
    counts = np.bincount(pixel - start)
    covered = np.flatnonzero(counts)
    counted = counts[covered]
    sums = np.bincount(pixel - start, means)[covered]
    spread = np.bincount(pixel - start, variances)[covered]
    traced.values.reshape(-1)[start + covered] = sums / counted
    traced.error.reshape(-1)[start + covered] = np.sqrt(spread) / counted


def _put_guides(job: TexelJob, page: Page, found: Texels, traced: TracedPage) -> None:
    """What else is known at the texels: the chart, and what a denoiser and an old texture say."""
    traced.chart.reshape(-1)[found.pixel] = found.chart
    if traced.normal is not None:
        whose = np.array(page.instances, np.int32)[found.owner]
        everything = np.arange(len(found.pixel))
        points = _points(job, found, everything, whose, everything)
        traced.normal.reshape(-1, 3)[found.pixel] = points.normals
    if traced.before is not None:
        for owner in np.unique(found.owner).tolist():
            mine = np.flatnonzero(found.owner == owner)
            mesh = job.scene.meshes[job.scene.instances[page.instances[owner]].mesh]
            held = job.materials.occlusion(mesh, found.face[mine], found.weights[mine])
            if held is not None:
                traced.before.reshape(-1)[found.pixel[mine]] = held


def _points(
    job: TexelJob,
    found: Texels,
    chosen: NDArray[np.int64],
    instances: NDArray[np.int32],
    numbers: NDArray[np.int64],
) -> SurfacePoints:
    """The chosen samples as points to trace from, turned by normal maps where they are asked for."""
    points = points_on_faces(
        job.scene,
        job.prepared,
        instances,
        found.face[chosen],
        found.weights[chosen],
        numbers=numbers,
    )
    if job.settings.normal_map:
        for number in np.unique(instances).tolist():
            mine = np.flatnonzero(instances == number)
            job.materials.turn(
                points,
                mine,
                job.prepared,
                number,
                found.face[chosen[mine]],
                found.weights[chosen[mine]],
            )
    return points


def _count(
    job: TexelJob, instances: NDArray[np.int32], faces: NDArray[np.int32], estimates: Estimates
) -> None:
    """Add the states of texels to the tally."""
    for kind, state in STATES.items():
        marked = np.flatnonzero(estimates.states == state)
        for number in np.unique(instances[marked]).tolist():
            mine = faces[marked[instances[marked] == number]]
            more = Marked(len(mine), tuple(np.unique(mine)[:EXAMPLES].tolist()))
            job.tally[number, kind] = job.tally.get((number, kind), Marked()).with_more(more)

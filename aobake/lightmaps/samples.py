"""Samples of texels: where they lie on the instances of a page, and what is traced there.

One sample a texel is the better use of rays, even where the mean over a texel is asked for: each sample has directions
of its own, which do not complete those of the others. Root mean square errors on a page of 384, a scan of 70,000
triangles, to middles / means of texels, which differ by 0.0041:

    rays of a texel     64               128              256
    one sample          0.0134, 0.0139   0.0081, 0.0088   0.0049, 0.0060
    2 x 2 samples       0.0221, 0.0220   0.0133, 0.0132   0.0082, 0.0080
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.layout import Page
from aobake.atlas.rasterize import PlacedFaces, Texels
from aobake.findings import EXAMPLES, FindingKind
from aobake.lightmaps.bands import Marked, TextureBake
from aobake.lightmaps.bent import PageFrames
from aobake.meshes.scene import FloatArray
from aobake.occlusion import STATES, occlusion_at
from aobake.points import SurfacePoints, points_on_faces
from aobake.stages import timed
from aobake.tracing.estimate import Estimates
from aobake.tracing.origins import OPEN

__all__ = ["Counts", "OpenPage", "Samples", "sampled", "shading_points"]

Report = Callable[[float], None]

MOST_TURNS = 64  # instances that are stored together, of which one texel takes its mean
LEAST_RAYS = 4  # for each of them
# Processor time of tracing texels tile by tile / row by row, a scan of 70,000 triangles on a page of 1024, 16 rays:
# 8 texels wide 0.925, 16 0.926, 32 0.917, 64 0.928; along a Morton curve of the page 0.927, in space 0.922. Of the
# whole bake 0.95 at 64 rays, 0.92 at a tolerance of rms:0.01 on a page of 512; of the demo hall, 512, 32 rays, 0.97.
TILE_PX = 32
SLIGHTLY = 1e-6  # what the direction of a sample counts that nothing is open at: if no other does


@dataclass(frozen=True, eq=False)
class OpenPage:
    """A page that bands are traced of.

    placed : its triangles
    frames : the spaces of its bent normals; None where there are none
    members : for each instance on the page, itself and those that share its place in the file
    first : the number of its first sample, which makes the random directions of a page its own
    """

    bake: TextureBake
    page: Page
    placed: PlacedFaces
    frames: PageFrames | None
    members: Sequence[Sequence[int]]
    first: int


@dataclass(frozen=True, eq=False)
class Samples:
    """mean, variance : (T,) float64; bent : (T, 3) float64, open directions, longer where more is open; or None."""

    mean: FloatArray
    variance: FloatArray
    bent: FloatArray | None

    @classmethod
    def blank(cls, count: int, *, bent: bool) -> Samples:
        """For `count` samples of which nothing is known yet. bent : whether directions are kept."""
        return cls(np.zeros(count), np.zeros(count), np.zeros((count, 3)) if bent else None)

    def put(self, chosen: NDArray[np.int64], part: Samples) -> None:
        """Take in some of them, by their place in these arrays."""
        self.mean[chosen], self.variance[chosen] = part.mean, part.variance
        if self.bent is not None and part.bent is not None:
            self.bent[chosen] = part.bent


@dataclass
class Counts:
    """What is counted while a band is traced. The fields are those of TracedBand."""

    rays: int = 0
    samples: int = 0
    under_open_sky: int = 0
    tally: dict[tuple[int, FindingKind], Marked] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)


def sampled(page: OpenPage, found: Texels, counts: Counts, report: Report) -> Samples:
    """The samples of a band, each instance that is stored in its place taking its turn."""
    samples = Samples.blank(len(found.pixel), bent=page.frames is not None)
    numbers = _numbers(found.pixel, page.first, page.bake.settings.supersample)
    turns = [min(len(several), MOST_TURNS) for several in page.members]
    turn = np.array(turns, np.int64)[found.owner]
    order = _tile_by_tile(found.pixel, page.bake.settings.size)
    for count in np.unique(turn).tolist():
        chosen = order[turn[order] == count]
        part = _part_of(report, float(np.mean(turn < count)), len(chosen) / len(turn))
        samples.put(chosen, _mean_over(page, found, chosen, numbers[chosen], count, counts, part))
    return samples


def _tile_by_tile(pixel: NDArray[np.int64], width: int) -> NDArray[np.int64]:
    """(T,) the order to trace samples of a band in, one tile after another, row by row within each."""
    row, column = np.divmod(pixel, width)
    tile = (row - row[0]) // TILE_PX * -(-width // TILE_PX) + column // TILE_PX
    return np.argsort(tile.astype(np.uint16), kind="stable")  # numpy sorts short numbers by radix


def _mean_over(
    page: OpenPage,
    found: Texels,
    chosen: NDArray[np.int64],
    numbers: NDArray[np.int64],
    turns: int,
    counts: Counts,
    report: Report,
) -> Samples:
    """The chosen samples, each the mean over `turns` of the instances that are stored together.

    numbers : (len(chosen),) int64, what makes the directions of each sample its own
    They share the rays of one. Where there are more instances than turns, how much these differ is in the
    variance.
    """
    bake, sums = page.bake, Samples.blank(len(chosen), bent=page.frames is not None)
    settings, squares = bake.settings, np.zeros(len(chosen))
    if turns > 1:
        settings = replace(settings, rays=max(LEAST_RAYS, -(-settings.rays // turns)))
    for turn, which in enumerate(_in_turn(page, found.owner[chosen], numbers, turns)):
        part = _part_of(report, turn / turns, 1.0 / turns)
        with timed(counts.seconds, "texels"):
            points = _points(bake, found, chosen, which, numbers * turns + turn)
            turned = _turned(bake, points, found, chosen)
        with timed(counts.seconds, "trace"):
            estimates = occlusion_at(
                bake.prepared, turned, bake.ground, settings, _in_counts(part), bake.sky
            )
        _count(counts, which, found.face[chosen], estimates)
        sums.mean[:] += estimates.mean
        squares += estimates.mean.astype(np.float64) ** 2
        sums.variance[:] += estimates.standard_error.astype(np.float64) ** 2
        with timed(counts.seconds, "texels"):
            _add_bent(page, estimates, points, found, chosen, sums)
    mean, some = sums.mean / turns, np.array([len(several) > turns for several in page.members])
    between = np.maximum(squares / turns - mean**2, 0.0) / max(turns - 1, 1)
    between *= some[found.owner[chosen]]
    return Samples(mean, sums.variance / turns**2 + between, sums.bent)


def _in_turn(
    page: OpenPage, owners: NDArray[np.int32], numbers: NDArray[np.int64], turns: int
) -> Iterator[NDArray[np.int32]]:
    """(T,) the instances that samples on the page's layouts are traced on, once for each turn.

    Where there are more than turns, each sample takes some that are evenly spread, and others than its
    neighbours.
    """
    lengths = np.array([len(several) for several in page.members], np.int64)
    sizes, begins = lengths[owners], (np.cumsum(lengths) - lengths)[owners]
    flat = np.array([number for several in page.members for number in several], np.int32)
    for turn in range(turns):
        yield flat[begins + (numbers + turn * sizes // turns) % sizes]


def _add_bent(
    page: OpenPage,
    estimates: Estimates,
    points: SurfacePoints,
    found: Texels,
    chosen: NDArray[np.int64],
    sums: Samples,
) -> None:
    """Add open directions to the sums, each as much as there is open, where they were asked for."""
    if sums.bent is not None and page.frames is not None and estimates.bent is not None:
        turned = page.frames.turned_in(
            estimates.bent, points, found.owner[chosen], found.face[chosen], found.weights[chosen]
        )
        sums.bent[:] += np.maximum(estimates.mean, SLIGHTLY)[:, np.newaxis] * turned


def _part_of(report: Report, begin: float, length: float) -> Report:
    """What a part of the work reports its share to; all of it is 1 long."""
    return lambda share: report(begin + length * share)


def _in_counts(report: Report) -> Callable[[int, int], None]:
    return lambda done, of: report(done / max(of, 1))


def _numbers(pixel: NDArray[np.int64], first: int, finer: int) -> NDArray[np.int64]:
    """(T,) numbers that belong to samples whatever bands a page is cut into: of the texel, and within it."""
    rank = np.arange(len(pixel)) - np.searchsorted(pixel, pixel)
    return first + pixel * (finer * finer) + rank


def _points(
    bake: TextureBake,
    found: Texels,
    chosen: NDArray[np.int64],
    instances: NDArray[np.int32],
    numbers: NDArray[np.int64],
) -> SurfacePoints:
    """The chosen samples as points on instances."""
    return points_on_faces(
        bake.scene,
        bake.prepared,
        instances,
        found.face[chosen],
        found.weights[chosen],
        numbers=numbers,
    )


def _turned(
    bake: TextureBake, points: SurfacePoints, found: Texels, chosen: NDArray[np.int64]
) -> SurfacePoints:
    """The points of the chosen samples, turned by normal maps where they are asked for."""
    if not bake.settings.normal_map:
        return points
    turned = replace(points, normals=points.normals.copy())
    for number in np.unique(points.owners).tolist():
        mine = np.flatnonzero(points.owners == number)
        faces, weights = found.face[chosen[mine]], found.weights[chosen[mine]]
        bake.materials.turn(turned, mine, bake.prepared, number, faces, weights)
    return turned


def shading_points(page: OpenPage, found: Texels) -> SurfacePoints:
    """All samples as points on the first of the instances that share their place, with the normals traced about."""
    everything = np.arange(len(found.pixel))
    instances = np.array(page.page.instances, np.int32)[found.owner]
    points = _points(page.bake, found, everything, instances, everything)
    return _turned(page.bake, points, found, everything)


def _count(
    counts: Counts,
    instances: NDArray[np.int32],
    faces: NDArray[np.int32],
    estimates: Estimates,
) -> None:
    """Add what came of some samples to the counts."""
    counts.rays += int(estimates.rays.sum(dtype=np.int64))
    counts.samples += len(estimates.states)
    counts.under_open_sky += int((estimates.states == OPEN).sum())
    for kind, state in STATES.items():
        marked = np.flatnonzero(estimates.states == state)
        for number in np.unique(instances[marked]).tolist():
            mine = faces[marked[instances[marked] == number]]
            more = Marked(len(mine), tuple(np.unique(mine)[:EXAMPLES].tolist()))
            counts.tally[number, kind] = counts.tally.get((number, kind), Marked()).with_more(more)

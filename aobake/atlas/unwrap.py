"""Unwrapping: meshes are cut into charts and laid into the plane.

Large meshes are cut into parts of like size first. A part that can be laid flat as a whole, nearly without
stretch, is a chart; one that cannot is halved, and a small one is left to xatlas, which follows creases.
Scans of 70,000 to 100,000 faces take seconds so, where xatlas alone takes minutes, and have shorter seams.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.charts import mended, projected
from aobake.atlas.dual import Dual, Groups, connected_groups, dual_of
from aobake.atlas.flatten_kernels import arena_for, flatten_pieces
from aobake.atlas.partition import parts_of
from aobake.meshes.coincident import first_equal_row
from aobake.meshes.scene import FloatArray, IntArray, Mesh
from aobake.meshes.surface import faces_without_area
from aobake.settings import AtlasSettings
from aobake.tracing.estimate import processors

__all__ = ["Charts", "unwrap"]

Progress = Callable[[int, int], None]

SMALL = 1000  # faces of a piece that is not halved when it cannot be laid flat, but left to xatlas
PARTS = (
    8 * 2000**-0.5
)  # times the root of the number of faces: 14 parts of 6,000 faces, 47 of 70,000
MOST_STRETCH = 1.05  # L2, of a chart (P. Sander et al., Texture mapping progressive meshes, 2001)
KEPT_S = 0.5  # after its last use
BATCH = 2000  # faces laid flat by a thread, or given to xatlas, before anything else is attended to
POLL_SECONDS = 0.1

_kept: deque[tuple[float, object]] = deque()


@dataclass(frozen=True, eq=False, kw_only=True)
class Charts:
    """A mesh cut into charts.

    source : (V',) int32, the vertex of the mesh that each new vertex is a copy of
    faces : (F, 3) int32 corners among the new vertices, in the order of the mesh's faces
    uv : (V', 2) float64 in the mesh's own units, each chart around its own origin, as large as its
        surface; triangles turn left in (u, v). Zeros for vertices of faces that have no place
    chart : (F,) int32, numbers from 0; -1: a face that has no area or no finite corners, and no place
    hurried : whether time ran out, so that faces were only seen along an axis, with more charts and stretch
    """

    source: IntArray
    faces: IntArray
    uv: FloatArray
    chart: IntArray
    hurried: bool


@dataclass
class _Work:
    """How far the work has come, and when it has to hurry."""

    deadline: float
    threads: int
    total: int
    progress: Progress | None
    done: int = 0

    def late(self) -> bool:
        return time.monotonic() > self.deadline

    def add(self, faces: int) -> None:
        self.done += faces
        if self.progress is not None:
            self.progress(self.done, self.total)


def unwrap(
    meshes: Sequence[Mesh],
    settings: AtlasSettings,
    threads: int | None = None,
    progress: Progress | None = None,
) -> list[Charts]:
    """Cut each mesh into charts that neither lie over themselves nor have a triangle flipped.

    threads : to lay pieces flat with; None: one per processor. The result does not depend on it
    progress : called in the calling thread with faces done, and all there are; whatever it raises stops
        the work within about a second, as does a KeyboardInterrupt
    After settings.unwrap_timeout seconds, what is left is cut into faces that look the same way.
    Vertices at one place count as one, whatever their normals. A mesh without usable faces has no chart.
    """
    work = _Work(
        deadline=time.monotonic() + settings.unwrap_timeout,
        threads=threads or processors(),
        total=sum(len(mesh.faces) for mesh in meshes),
        progress=progress,
    )
    return [_unwrapped(mesh, work) for mesh in meshes]


def _unwrapped(mesh: Mesh, work: _Work) -> Charts:
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(mesh.vertices).all(axis=1))
    clean = np.where(finite[:, None], mesh.vertices, 0.0)
    flat = faces_without_area(clean, mesh.faces.view(np.uint32))
    usable = np.flatnonzero(finite[mesh.faces].all(axis=1) & ~flat)
    chart: IntArray = np.full(len(mesh.faces), -1, np.int32)
    uv = np.zeros((len(mesh.faces), 3, 2))
    work.add(len(mesh.faces) - len(usable))
    hurried = False
    if len(usable):
        faces = first_equal_row(clean)[mesh.faces[usable]]
        middle, size = _unit_scale(clean[faces.reshape(-1)])
        dual = dual_of((clean - middle) / size, faces)
        uv[usable], chart[usable], hurried = _cut(dual, work)
        uv *= size
    source, corners, at = _new_vertices(mesh.faces, uv, chart)
    return Charts(source=source, faces=corners, uv=at, chart=chart, hurried=hurried)


def _unit_scale(points: FloatArray) -> tuple[FloatArray, float]:
    """The middle and the size of a box: what xatlas makes of a mesh depends on its size."""
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * low + 0.5 * high, float((high - low).max())


def _new_vertices(
    faces: IntArray, uv: FloatArray, chart: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """(source, faces, uv): corners with the same vertex, chart and uv are one new vertex."""
    corner = faces.reshape(-1)
    at = uv.reshape(-1, 2)
    key = np.stack([corner, np.repeat(chart, 3)], axis=1).astype(np.float64)
    first = first_equal_row(at, key)
    kept = np.flatnonzero(first == np.arange(len(first)))
    number = np.zeros(len(first), np.int32)
    number[kept] = np.arange(len(kept))
    return corner[kept], number[first].reshape(-1, 3), at[kept]


def _cut(dual: Dual, work: _Work) -> tuple[FloatArray, IntArray, bool]:
    """uv (F, 3, 2) and chart (F,) of all faces, and whether there was too little time."""
    uv = np.zeros((len(dual.faces), 3, 2))
    chart: IntArray = np.full(len(dual.faces), -1, np.int32)
    count, small = 0, list[IntArray]()
    pieces = _first_pieces(dual)
    while len(pieces) and not work.late():
        stretch = _lay_flat(dual, pieces, uv, work)
        good = stretch <= MOST_STRETCH
        number = np.where(good, count + np.cumsum(good) - 1, -1)
        chart[pieces.order] = np.repeat(number, pieces.sizes())
        count += int(good.sum())
        bad = [pieces.faces(int(piece)) for piece in np.flatnonzero(~good)]
        small += [faces for faces in bad if len(faces) <= SMALL]
        pieces = _halves(dual, [faces for faces in bad if len(faces) > SMALL])
    hurried = len(pieces) > 0
    if hurried:
        count = _project(dual, pieces.order, uv, chart, count)
        work.add(len(pieces.order))
    for batch in _batches(small):
        if work.late():
            hurried = True
            count = _project(dual, np.concatenate(batch), uv, chart, count)
        else:
            count = _by_xatlas(dual, batch, uv, chart, count)
        work.add(sum(map(len, batch)))
    if small:
        _improve(dual, np.concatenate(small), uv, chart, work)
    return uv, mended(dual, uv, chart).of, hurried


def _first_pieces(dual: Dual) -> Groups:
    """Connected components, the large ones in parts."""
    whole = connected_groups(dual, np.zeros(len(dual.faces), np.int32))
    of, count = whole.of.copy(), len(whole)
    for component in np.flatnonzero(whole.sizes() > SMALL):
        faces = whole.faces(int(component))
        parts = round(PARTS * len(faces) ** 0.5)
        of[faces] = count + parts_of(dual, faces, parts)
        count += parts
    return connected_groups(dual, of)


def _halves(dual: Dual, pieces: Sequence[IntArray]) -> Groups:
    of: IntArray = np.full(len(dual.faces), -1, np.int32)
    for number, faces in enumerate(pieces):
        of[faces] = 2 * number + parts_of(dual, faces, 2)
    return connected_groups(dual, of)


def _lay_flat(dual: Dual, pieces: Groups, uv: FloatArray, work: _Work) -> FloatArray:
    """Fill uv where a piece can be laid flat; (pieces,) its L2 stretch, infinite where it cannot."""
    stretch = np.full(len(pieces), np.inf)
    ends = np.unique(np.searchsorted(pieces.starts, np.arange(BATCH, len(pieces.order), BATCH)))
    bounds = np.unique(np.concatenate([[0], ends, [len(pieces)]]))

    def lay(first: int, last: int) -> int:
        sizes = pieces.sizes()[first:last]
        if not work.late():
            flatten_pieces(
                arena_for(int(sizes.max())), dual.vertices, dual.faces, dual.opposite, pieces.order, pieces.starts,
                pieces.slot, pieces.of, first, last, uv, stretch,
            )  # fmt: skip
        return int(sizes[stretch[first:last] <= MOST_STRETCH].sum())

    pool = ThreadPoolExecutor(work.threads)
    try:
        waiting = {pool.submit(lay, int(a), int(b)) for a, b in pairwise(bounds)}
        _watch(waiting, work)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return stretch


def _improve(dual: Dual, faces: IntArray, uv: FloatArray, chart: IntArray, work: _Work) -> None:
    """Lay the charts of xatlas flat once more: it rounds their width and height to its texels."""
    of: IntArray = np.full(len(dual.faces), -1, np.int32)
    of[faces] = chart[faces]
    _lay_flat(dual, connected_groups(dual, of), uv, replace(work, progress=None))


def _watch(waiting: set[Future[int]], work: _Work) -> None:
    """Wait for all, waking up often enough to notice an interrupt."""
    while waiting:
        finished, waiting = wait(waiting, POLL_SECONDS, FIRST_COMPLETED)
        work.add(sum(future.result() for future in finished))


def _batches(pieces: Sequence[IntArray]) -> list[list[IntArray]]:
    """Pieces in lists of not much more than BATCH faces."""
    batches, room = list[list[IntArray]](), 0
    for faces in pieces:
        if room <= 0:
            batches.append([])
            room = BATCH
        batches[-1].append(faces)
        room -= len(faces)
    return batches


def _project(dual: Dual, faces: IntArray, uv: FloatArray, chart: IntArray, count: int) -> int:
    """Fill uv and chart of some faces from `count` on, as seen along axes; the new count."""
    uv[faces], own = projected(dual, faces)
    chart[faces] = count + own
    return count + int(own.max(initial=-1)) + 1


def _by_xatlas(
    dual: Dual, pieces: Sequence[IntArray], uv: FloatArray, chart: IntArray, count: int
) -> int:
    """Fill uv and chart of some pieces from `count` on; the new count. Needles, which it drops, are projected."""
    import xatlas

    atlas = xatlas.Atlas()
    _keep_for_a_while(atlas)
    for faces in pieces:
        used, local = np.unique(dual.faces[faces], return_inverse=True)
        points = dual.vertices[used]
        middle, size = _unit_scale(points)
        atlas.add_mesh(
            ((points - middle) / size).astype(np.float32),
            local.reshape(-1, 3).astype(np.uint32),
        )
    packing = xatlas.PackOptions()  # of no use here: the quickest
    packing.resolution, packing.rotate_charts, packing.rotate_charts_to_axis = 256, False, False
    atlas.generate(xatlas.ChartOptions(), packing)
    for number, faces in enumerate(pieces):
        _, corners, at = atlas[number]
        image, own = atlas.get_mesh_vertex_assignment(number)
        uv[faces] = at[corners] * (atlas.width, atlas.height)
        placed = image[corners[:, 0]].astype(np.int32) >= 0
        numbers: NDArray[np.int64] = own[corners[:, 0]].astype(np.int64)
        chart[faces] = np.where(placed, count + numbers, -1)
        count += atlas.get_mesh_chart_count(number)
        count = _project(dual, faces[~placed], uv, chart, count)
    return count


def _keep_for_a_while(atlas: object) -> None:
    """Hold an atlas until its threads have surely gone to sleep, and let go of those that were held so.

    The end of an atlas wakes its threads without holding their lock: one that is just about to sleep misses
    that, and the process waits for it for ever (seen once on a busy machine, with xatlas 0.0.11).
    """
    now = time.monotonic()
    _kept.append((now, atlas))
    while now - _kept[0][0] > KEPT_S:
        _kept.popleft()

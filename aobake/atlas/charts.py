"""Charts: pieces of a surface in the plane, none of which lies over itself or is turned over."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.dual import Dual, Groups, connected_groups, groups_of
from aobake.atlas.overlap_kernels import arena_for, note_overlaps
from aobake.atlas.partition import parts_of
from aobake.meshes.scene import FloatArray, IntArray

__all__ = ["counted", "laid_flat", "mended", "projected"]

TOLERANCE = 1e-6  # share of a chart's size: what xatlas's float32 leaves unsure
LEAST_AREA = 1e-4  # of its own that a triangle must keep in its chart


def counted(count: int) -> str:
    """A number of charts, in words for a message."""
    return "1 chart" if count == 1 else f"{count:,} charts"


def projected(dual: Dual, chosen: IntArray) -> tuple[FloatArray, IntArray]:
    """Faces (N,) in connected groups that look along one axis, seen along it: quick, and never fails.

    Returns uv (N, 3, 2), stretched by at most sqrt(3), and chart (N,) from 0; charts may lie over themselves.
    """
    normal = dual.normal[chosen]
    axis = np.argmax(np.abs(normal), axis=1)
    ahead = np.take_along_axis(normal, axis[:, None], 1)[:, 0] > 0.0
    of = np.full(len(dual.faces), -1, np.int32)
    of[chosen] = 2 * axis + ahead
    u, v = (axis + 1) % 3, (axis + 2) % 3
    u, v = np.where(ahead, u, v), np.where(ahead, v, u)
    corners = dual.vertices[dual.faces[chosen]]
    rows, columns = np.arange(len(chosen))[:, None], np.arange(3)[None, :]
    uv = np.stack([corners[rows, columns, u[:, None]], corners[rows, columns, v[:, None]]], axis=-1)
    return uv, connected_groups(dual, of).of[chosen]


def mended(dual: Dual, uv: FloatArray, chart: IntArray) -> Groups:
    """Charts of all faces after every fault is mended; uv (F, 3, 2) is changed in place.

    chart : (F,) int32; -1: a face that nothing has laid flat yet, which becomes a chart of its own
    Charts are turned left way round and scaled to the area of their surface. A triangle that is flipped
    or crushed in its chart leaves it; a chart that lies over itself is cut until none does.
    """
    of = connected_groups(dual, chart).of.copy()
    bad = of < 0
    while True:
        uv[bad] = laid_flat(dual.vertices[dual.faces[bad]])
        of[bad] = of.max(initial=-1) + 1 + np.arange(int(bad.sum()))
        charts = connected_groups(dual, of)
        _normalise(dual, uv, charts.of)
        bad = _crushed(dual, uv, charts)
        if not bad.any():
            return _without_overlaps(dual, uv, charts)
        of = charts.of.copy()


def laid_flat(corners: FloatArray) -> FloatArray:
    """(N, 3, 2) triangles (N, 3, 3) in their own planes, turning left."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    base = np.linalg.norm(u, axis=1)
    flat = np.zeros((len(corners), 3, 2))
    flat[:, 1, 0] = base
    flat[:, 2, 0] = np.einsum("ni,ni->n", u, v) / base
    flat[:, 2, 1] = np.linalg.norm(np.cross(u, v), axis=1) / base
    return flat


def _signed(uv: FloatArray) -> FloatArray:
    """(N,) area of triangles, negative for those that turn right."""
    u, v = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return np.asarray(0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))


def _normalise(dual: Dual, uv: FloatArray, of: IntArray) -> None:
    """Mirror charts most of which turns right, and give all of them the area of their surface."""
    covered, area = np.bincount(of, _signed(uv)), np.bincount(of, dual.area)
    size = np.sqrt(area / np.where(covered != 0.0, np.abs(covered), np.inf))
    uv *= size[of, None, None]
    uv[:, :, 0] *= np.where(covered < 0.0, -1.0, 1.0)[of, None]


def _crushed(dual: Dual, uv: FloatArray, charts: Groups) -> NDArray[np.bool_]:
    """(F,) triangles that are flipped or have lost their area, but for those too thin to be seen."""
    corners = dual.vertices[dual.faces]
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(
        axis=1, initial=0.0
    )
    whole = np.sqrt(np.bincount(charts.of, dual.area))[charts.of]
    seen = 2.0 * dual.area > TOLERANCE * whole * longest
    together = charts.sizes()[charts.of] > 1
    return np.asarray(together & seen & ~(_signed(uv) > LEAST_AREA * dual.area), bool)


def _without_overlaps(dual: Dual, uv: FloatArray, charts: Groups) -> Groups:
    """Charts, cut where they lie over themselves; what is cut apart keeps its shape."""
    of, count = charts.of.copy(), len(charts)
    suspects = charts
    while len(suspects):
        over = np.zeros(len(suspects), bool)
        memory = arena_for(int(suspects.sizes().max()))
        note_overlaps(memory, uv, suspects.order, suspects.starts, TOLERANCE, over)
        halves = np.full(len(of), -1, np.int32)
        for number, group in enumerate(np.flatnonzero(over)):
            faces = suspects.faces(int(group))
            halves[faces] = 2 * number + parts_of(dual, faces, 2)
        suspects = connected_groups(dual, halves)
        of[suspects.order] = count + suspects.of[suspects.order]
        count += len(suspects)
    numbers, inverse = np.unique(of, return_inverse=True)
    return groups_of(inverse.astype(np.int32).reshape(-1), len(numbers))

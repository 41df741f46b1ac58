"""Coordinates that float32 can hold: recentred, scaled to unit size, long edges split where they must be.

All of it happens in float64, before anything is rounded. What is left of the rounding is then a few
ulps of the distance from the middle of what is looked at, whatever the scene's own units and place.

The kernels are not 1 % of any bake measured: written plainly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import kernel
from aobake.tracing.rows import bounds, largest_in_rows
from aobake.tracing.vectors import length, minus, row

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

__all__ = [
    "UnitFrame",
    "detail_at_vertices",
    "detail_beside",
    "regions",
    "split_long_edges",
    "unit_frame",
]

FloatArray = NDArray[np.float64]
FaceArray = NDArray[np.uint32]

RESOLVING_ULPS = (
    64.0  # at a tenth of it values were off by 0.3, at ten times it by 0.007 at the most
)
MOST_REGIONS = 64  # frames besides the first; each costs a tree
MOST_SAMPLED = 1 << 16  # vertices of one part that the middle is taken from
FINEST = 8192.0  # an edge may be this many times as long as the detail beside it: AO errs by 1e-4
NEAR = 8.0  # or this many times as long as its triangle is far from detail: angles err by 2e-6
LONG = 0.5  # of a triangle's longest edge: what is shorter need not be cut to make it smaller
COARSER = 8.0  # ratio between the sizes of detail that are told apart
RESOLVED = (
    2.0**-16
)  # detail finer than this share of its coordinate is lost in float32 all the same
SHORTER = 0.9  # of the length that can stay whole, so that what was cut is not cut again
NEEDLE = 0.2  # shortest against longest edge
QUARTERS = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) / 4.0  # 15 points
ROUNDS = 64  # halvings; 2^64 is more than float64 can tell apart
SPARE_FACES = 200_000  # what splitting may add to twice the faces that were there


@dataclass(frozen=True, eq=False)
class UnitFrame:
    """x -> (x - center) * scale brings a scene into [-1, 1]; scale is a power of two, so that it is exact."""

    center: FloatArray
    scale: float

    def apply(self, points: FloatArray) -> FloatArray:
        """(N, 3) float64 points in units of the frame."""
        return (points - self.center) * self.scale


def unit_frame(parts: Sequence[FloatArray], center: FloatArray | None = None) -> UnitFrame:
    """The frame of several (N, 3) clouds of finite points; the identity for none.

    The centre, where none is given, is the median of the points, not the middle of their bounding box:
    float32 is densest around it, and that is where the detail should be. A ground as wide as a city
    hardly moves it.
    """
    filled = [part for part in parts if len(part)]
    if not filled:
        return UnitFrame(np.zeros(3), 1.0)
    if center is None:
        sampled = [part[:: max(1, len(part) // MOST_SAMPLED)] for part in filled]
        center = np.median(np.concatenate(sampled), axis=0)
    reach = max(float(np.abs(corner - center).max()) for part in filled for corner in bounds(part))
    if not (reach > 0.0 and math.isfinite(reach)):
        return UnitFrame(center, 1.0)
    exponent = math.frexp(reach)[1]
    return UnitFrame(center, math.ldexp(1.0, max(-1000, min(1000, -exponent))))


def detail_at_vertices(vertices: FloatArray, faces: FaceArray) -> FloatArray:
    """(V,) float64, the size of the smallest face at each vertex: its longest edge; infinite where none is.

    Not the shortest edge: a sliver is not detail, and scans are full of slivers.
    """
    detail = np.full(len(vertices), np.inf)
    _refine(faces, _longest_edges(vertices, faces), detail)
    return detail


@kernel
def _refine(faces, longest, detail):
    """Lower detail (V,) to the size of the smallest face at each vertex."""
    for f in range(len(faces)):
        if longest[f] > 0.0:
            for k in range(3):
                detail[faces[f, k]] = min(detail[faces[f, k]], longest[f])


def detail_beside(points: FloatArray, vertices: FloatArray, detail: FloatArray) -> FloatArray:
    """(P,) the detail of the vertex that is nearest to each point; both arrays as for the others."""
    from scipy.spatial import cKDTree

    return np.asarray(detail[cKDTree(vertices).query(points)[1]])


def regions(
    points: FloatArray, detail: FloatArray, frame: UnitFrame
) -> tuple[list[tuple[FloatArray | None, NDArray[np.int64]]], NDArray[np.int64]]:
    """Which points can be asked for in the frame, and which need one around a centre of their own.

    float32 resolves detail down to RESOLVING_ULPS ulps of the distance from a frame's centre. Points
    that are too far away for their detail are gathered around the first of them, and so on: a few small
    things that stand far apart get a frame each.

    points : (P, 3) float64, in the scene's space
    detail : (P,) float64, the size of what is to be told apart at each of them
    Returns (centre, or None for the frame as it is; the numbers of its points), and the numbers of
    points that are left unresolved after MOST_REGIONS, which are in the first region.
    """
    lacking = np.flatnonzero(~_resolved(points, detail, frame.center))
    others: list[tuple[FloatArray | None, NDArray[np.int64]]] = []
    while len(lacking) and len(others) < MOST_REGIONS:
        center = points[lacking[0]]
        near = _resolved(points[lacking], detail[lacking], center)
        near[0] = True
        others.append((center, lacking[near]))
        lacking = lacking[~near]
    elsewhere = np.zeros(len(points), bool)
    for _, chosen in others:
        elsewhere[chosen] = True
    return [(None, np.flatnonzero(~elsewhere)), *others], lacking


def _resolved(points: FloatArray, detail: FloatArray, center: FloatArray) -> NDArray[np.bool_]:
    distance = largest_in_rows(points - center)
    return np.asarray(detail >= RESOLVING_ULPS * 2.0**-23 * distance, bool)


def split_long_edges(
    vertices: FloatArray,
    faces: FaceArray,
    details: Sequence[FloatArray],
    sizes: Sequence[FloatArray],
) -> tuple[FloatArray, FaceArray]:
    """Split the triangles that are too large for the detail beside them, in float64.

    The test of a ray against a triangle errs by a few ulps of the triangle's size, so a ground of
    10,000 units blurs what stands on it by a thousandth. An edge is cut while it is longer than
    FINEST times the size of the detail beside a triangle of it and NEAR times that triangle's distance
    from there. Both triangles of an edge cut it at the same point, so that no crack opens.

    vertices, faces : (V, 3) float64, (F, 3) uint32
    details, sizes : arrays (D, 3) and (D,) float64: points that will be asked for, and the size of the
        detail at each of them, infinite where there is none
    Returns the vertices with the new ones behind them, and the faces; the same arrays if nothing is
    too large. At most 2 F + SPARE_FACES faces come of it, or 66 F + 4,096 where that is less.
    """
    if len(faces) == 0 or not any(map(len, sizes)):
        return vertices, faces
    longest = _longest_edges(vertices, faces)
    finest = min(float(size.min()) for size in sizes if len(size))
    if not float(longest.max()) > FINEST * finest:
        return vertices, faces
    used = [np.isfinite(size) for size in sizes]
    point = np.concatenate([at[some] for at, some in zip(details, used, strict=True)])
    size = np.concatenate([size[some] for size, some in zip(sizes, used, strict=True)])
    size = np.maximum(size, RESOLVED * np.abs(point).max(axis=1))
    finest = float(size.min())
    large = longest > FINEST * finest
    if not large.any():
        return vertices, faces
    levels = _levels_of_detail(point, size, float(longest.max()))
    settled, active = [faces[~large]], faces[large]
    most = 2 * len(faces) + min(SPARE_FACES, 64 * len(faces) + 4096)
    for _ in range(ROUNDS):
        edges, of_face = _unique_edges(active)
        where = _cuts(vertices, active, edges, of_face, levels)
        if not where.any() or len(active) + sum(map(len, settled)) > most:
            break
        _cut_needles_evenly(vertices, edges, of_face, where)
        cut_edges = where > 0.0
        added = np.full(len(edges), -1, np.int64)
        added[cut_edges] = len(vertices) + np.arange(int(cut_edges.sum()))
        a, b, t = (
            vertices[edges[cut_edges, 0]],
            vertices[edges[cut_edges, 1]],
            where[cut_edges, None],
        )
        vertices = np.concatenate([vertices, (1.0 - t) * a + t * b])
        cut = added[of_face]
        whole = (cut < 0).all(axis=1)
        settled.append(active[whole])
        active = _divide(vertices, active[~whole], cut[~whole])
    return vertices, np.concatenate([*settled, active]).astype(np.uint32)


def _longest_edges(vertices: FloatArray, faces: FaceArray) -> FloatArray:
    """(F,) length of the longest edge of each face."""
    longest = np.zeros(len(faces))
    lengthen(vertices, faces, longest)
    return longest


@kernel
def lengthen(vertices, faces, longest):
    """Raise longest (F,) to the length of the longest edge of each face."""
    for f in range(len(faces)):
        for k in range(3):
            a, b = row(vertices, faces[f, k]), row(vertices, faces[f, (k + 1) % 3])
            longest[f] = max(longest[f], length(minus(a, b)))


def _levels_of_detail(
    details: FloatArray, sizes: FloatArray, longest: float
) -> list[tuple[float, cKDTree]]:
    """(size, the points whose detail is at most that size), from coarse to fine."""
    from scipy.spatial import cKDTree

    levels: list[tuple[float, cKDTree]] = []
    size, count = longest / FINEST, 0
    while (chosen := sizes <= size).any():
        if int(chosen.sum()) == count:  # the same points ask for more: the level above says nothing
            levels[-1] = (size, levels[-1][1])
        else:
            count = int(chosen.sum())
            levels.append((size, cKDTree(details[chosen])))
        size /= COARSER
    return levels


def _cuts(
    vertices: FloatArray,
    faces: FaceArray,
    edges: NDArray[np.int64],
    of_face: NDArray[np.int64],
    levels: list[tuple[float, cKDTree]],
) -> FloatArray:
    """(E,) where to cut the edges of some faces, as a share of their length; 0: they can stay as they are.

    An edge that is close to detail with one end loses as much there as can stay whole, so that a few
    cuts in growing steps do; any other is halved.
    """
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    size_of_edge = np.linalg.norm(b - a, axis=1)
    longest = size_of_edge[of_face].max(axis=1, initial=0.0)
    where = np.zeros(len(edges))
    for size, tree in levels:
        fine = FINEST * size
        large = np.flatnonzero(longest > fine)
        if len(large) == 0:
            continue
        distance = _distances(tree, vertices[faces[large]], longest[large], fine)
        counts = size_of_edge[of_face[large]] > LONG * longest[large, None]
        own = np.where(counts, (fine + NEAR * distance)[:, None], np.inf)
        allowed = np.full(len(edges), np.inf)
        np.minimum.at(allowed, of_face[large], own)
        long = np.flatnonzero((where == 0.0) & (size_of_edge > allowed))
        ends = np.stack([a[long], b[long]])
        kept = SHORTER * (fine + NEAR * tree.query(ends)[0]) / size_of_edge[long]
        where[long] = np.where(kept[0] < 0.5, kept[0], np.where(kept[1] < 0.5, 1.0 - kept[1], 0.5))
    return where


def _distances(tree: cKDTree, corners: FloatArray, longest: FloatArray, fine: float) -> FloatArray:
    """(N,) how far triangles (N, 3, 3) are from the nearest point of a tree, at least.

    It is never too much: 15 points of a triangle, on a grid of quarters, leave none of it farther from all
    of them than a quarter of its longest edge over sqrt(3). Triangles whose middle is far enough away
    for their size are settled by that alone.
    """
    middle = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    distance = np.maximum(tree.query(middle)[0] - reach, 0.0)
    near = np.flatnonzero(longest > fine + NEAR * distance)
    samples = np.einsum("sc,nci->nsi", QUARTERS, corners[near])
    nearest = tree.query(samples)[0].min(axis=1, initial=np.inf)
    distance[near] = np.maximum(nearest - longest[near] / (4.0 * math.sqrt(3.0)), 0.0)
    return np.asarray(distance)


def _unique_edges(faces: FaceArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The (E, 2) edges of faces, and (F, 3) which of them a face's sides 0-1, 1-2, 2-0 are."""
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).astype(np.int64).reshape(-1, 2)
    sides.sort(axis=1)
    edges, of_side = np.unique(sides, axis=0, return_inverse=True)
    return edges, of_side.reshape(-1, 3)


def _cut_needles_evenly(
    vertices: FloatArray, edges: NDArray[np.int64], of_face: NDArray[np.int64], where: FloatArray
) -> None:
    """Cut the second long edge of each needle that has one cut, as near to their common corner.

    A needle with one long edge cut falls into a needle and a sliver with an angle near 180 degrees,
    whose plane float32 cannot tell.
    """
    sides = np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1)[of_face]
    longest = sides.max(axis=1)
    long = sides > 0.5 * longest[:, None]
    needles = np.flatnonzero((sides.min(axis=1) < NEEDLE * longest) & (long.sum(axis=1) == 2))
    pairs = of_face[needles][long[needles]].reshape(-1, 2)
    # Both edges of a pair start or end at the same corner, but may be stored from it or towards it.
    same_way = (edges[pairs[:, 0], 0] == edges[pairs[:, 1], 0]) | (
        edges[pairs[:, 0], 1] == edges[pairs[:, 1], 1]
    )
    while True:
        one, other = where[pairs[:, 0]], where[pairs[:, 1]]
        lacking = np.flatnonzero((one > 0.0) != (other > 0.0))
        if len(lacking) == 0:
            return
        share = np.maximum(one, other)[lacking]
        share = np.where(same_way[lacking], share, 1.0 - share)
        where[np.where(one > 0.0, pairs[:, 1], pairs[:, 0])[lacking]] = share


def _divide(vertices: FloatArray, faces: FaceArray, cut: NDArray[np.int64]) -> FaceArray:
    """Faces with their sides cut at the given vertices (-1: not cut) as two, three or four smaller ones."""
    parts = []
    count = (cut >= 0).sum(axis=1)
    for k in range(3):
        turned = np.roll(np.arange(3), -k)
        a, b, c = faces[:, turned].T
        ab, bc, ca = cut[:, turned].T
        one = (count == 1) & (ab >= 0)
        parts += [_stack(one, ab, b, c), _stack(one, a, ab, c)]
        two = (count == 2) & (ca < 0)
        across = np.linalg.norm(vertices[a] - vertices[bc], axis=1)
        back = np.linalg.norm(vertices[c] - vertices[ab], axis=1)
        first, second = two & (across <= back), two & (across > back)
        parts += [_stack(two, ab, b, bc)]
        parts += [_stack(first, a, ab, bc), _stack(first, a, bc, c)]
        parts += [_stack(second, a, ab, c), _stack(second, ab, bc, c)]
    a, b, c = faces.T
    ab, bc, ca = cut.T
    all_ = count == 3
    parts += [_stack(all_, a, ab, ca), _stack(all_, ab, b, bc)]
    parts += [_stack(all_, ca, bc, c), _stack(all_, ab, bc, ca)]
    return np.concatenate(parts).astype(np.uint32)


def _stack(rows: NDArray[np.bool_], *corners: NDArray[np.integer]) -> NDArray[np.int64]:
    """(N, 3) faces from three columns, at the rows that are chosen."""
    return np.stack([column[rows].astype(np.int64) for column in corners], axis=1)

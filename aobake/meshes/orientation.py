"""Faces wound the same way round, so that a surface has one front.

Winding is honoured where it is consistent: a closed mesh whose faces all look inward is a room. Where
neighbours disagree, it says nothing, and each connected part is wound as most of its area is; a closed
part is wound outward.

The kernels are not 1 % of any bake measured: written plainly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import inlined, kernel
from aobake.tracing.vectors import cross, dot, length, minus, row

__all__ = ["consistent_winding"]

FEW = 32  # edges of a vertex that are sorted by insertion


def consistent_winding(
    vertices: NDArray[np.float64], faces: NDArray[np.uint32], place: NDArray[np.int32]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(F,) whether each face has to be turned over, so that neighbours agree; and whether it belongs to
    a closed part that faces inward all the same, because its winding is consistent.

    vertices, faces : (V, 3) float64, (F, 3) uint32
    place : (V,) int32, the first vertex at the same place: soups count as connected where they meet
    Faces are neighbours across edges that exactly two of them share; at any other edge, a fin or a
    Moebius band's seam, nothing can be agreed on and nothing is asked.
    """
    turned, inward = np.zeros(len(faces), bool), np.zeros(len(faces), bool)
    if len(faces):
        _settle(
            vertices,
            faces,
            place,
            _edges_by_place(faces, place),
            _parts(len(faces)),
            turned,
            inward,
        )
    return turned, inward


def _edges_by_place(
    faces: NDArray[np.uint32], place: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.uint32]]:
    """Edges grouped by the lower of their two places: (start (V + 1,), the higher place, which edge).

    Edges are numbered 3 face + k, and their lists are ordered by the higher place, so that equal edges
    lie side by side. Sorting all edges by one key took five times the memory, and longer.
    """
    start = np.zeros(len(place) + 2, np.int64)
    other, edge = np.empty(3 * len(faces), np.int32), np.empty(3 * len(faces), np.uint32)
    _group_edges(faces, place, start, other, edge)
    start = start[:-1]
    count = np.diff(start)
    many = count > FEW
    if many.any():
        at = np.flatnonzero(np.repeat(many, count))
        order = at[np.lexsort((other[at], np.repeat(np.flatnonzero(many), count[many])))]
        other[at], edge[at] = other[order], edge[order]
    return start, other, edge


def _parts(count: int) -> tuple[NDArray[np.generic], ...]:
    """Memory for a union-find over faces: parent, parity, torn, is_open, volume, area."""
    return (
        np.arange(count, dtype=np.int32),
        np.zeros(count, np.uint8),
        np.zeros(count, np.bool_),
        np.zeros(count, np.bool_),
        np.zeros(count),
        np.zeros(count),
    )


@kernel
def _group_edges(faces, place, start, other, edge):
    """Fill what _edges_by_place returns, and sort the lists that are not long.

    start : (V + 2,) zeros; while edges are put in, start[v + 1] is where the next one of v goes
    """
    for f in range(len(faces)):
        for k in range(3):
            start[min(place[faces[f, k]], place[faces[f, (k + 1) % 3]]) + 2] += 1
    for v in range(len(place)):
        start[v + 2] += start[v + 1]
    for f in range(len(faces)):
        for k in range(3):
            a, b = place[faces[f, k]], place[faces[f, (k + 1) % 3]]
            at = start[min(a, b) + 1]
            other[at], edge[at] = max(a, b), 3 * f + k
            start[min(a, b) + 1] += 1
    for v in range(len(place)):
        if start[v + 1] - start[v] <= FEW:
            _sort_few(other, edge, start[v], start[v + 1])


@inlined
def _sort_few(other, edge, first, last):
    """Sort a short list by insertion, which allocates nothing."""
    for i in range(first + 1, last):
        key, carried = other[i], edge[i]
        j = i - 1
        while j >= first and other[j] > key:
            other[j + 1], edge[j + 1] = other[j], edge[j]
            j -= 1
        other[j + 1], edge[j + 1] = key, carried


@inlined
def _find(parent, parity, face):
    """The root of a face's part, and whether the face runs against it; the path is shortened."""
    root, against = face, np.uint8(0)
    while parent[root] != root:
        against ^= parity[root]
        root = parent[root]
    remaining = against
    while face != root:
        above, step = parent[face], parity[face]
        parent[face], parity[face] = root, remaining
        remaining ^= step
        face = above
    return root, against


@inlined
def _join(parent, parity, torn, one, other, opposed):
    """Put two neighbours into one part; opposed: their windings disagree."""
    a, against_a = _find(parent, parity, one)
    b, against_b = _find(parent, parity, other)
    if a != b:
        low, high = min(a, b), max(a, b)
        parent[high] = low
        parity[high] = against_a ^ against_b ^ np.uint8(opposed)
        torn[low] |= torn[high]
        a = low
    torn[a] |= opposed


@inlined
def _begins_low(faces, place, edge):
    """Whether an edge runs from its lower place to its higher one."""
    f, k = edge // 3, edge % 3
    return place[faces[f, k]] < place[faces[f, (k + 1) % 3]]


@kernel
def _settle(vertices, faces, place, edges, parts, turned, inward):
    """Fill turned and inward (F,): a union-find over neighbours that keeps each face's parity.

    edges : of _edges_by_place
    parts : of _parts; torn, at roots: somewhere within, neighbours disagree
    """
    start, other, edge = edges
    parent, parity, torn, is_open, volume, area = parts
    count = len(faces)
    for v in range(len(start) - 1):
        first = start[v]
        while first < start[v + 1]:
            last = first
            while last < start[v + 1] and other[last] == other[first]:
                last += 1
            if last - first == 2:
                one, two = edge[first], edge[first + 1]
                same_way = _begins_low(faces, place, one) == _begins_low(faces, place, two)
                _join(parent, parity, torn, np.int64(one // 3), np.int64(two // 3), same_way)
            else:
                for e in range(first, last):
                    is_open[edge[e] // 3] = True
            first = last
    for f in range(count):
        root, against = _find(parent, parity, f)
        o = row(vertices, faces[root, 0])
        a, b, c = (
            minus(row(vertices, faces[f, 0]), o),
            minus(row(vertices, faces[f, 1]), o),
            minus(row(vertices, faces[f, 2]), o),
        )
        sign = -1.0 if against else 1.0
        volume[root] += sign * dot(a, cross(b, c))
        area[root] += sign * length(cross(minus(b, a), minus(c, a)))
        is_open[root] |= is_open[f]
    for f in range(count):
        root, against = _find(parent, parity, f)
        if torn[root]:
            measure = area[root] if is_open[root] else volume[root]
            turned[f] = (against == 1) != (measure < 0.0)
        else:
            inward[f] = not is_open[root] and volume[root] < 0.0

"""Faces wound the same way round, so that a surface has one front.

Winding is honoured where it is consistent: a closed mesh whose faces all look inward is a room. Where
neighbours disagree, it says nothing, and each connected part is wound as most of its area is; a closed
part is wound outward.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import inlined, kernel
from aobake.tracing.vectors import cross, dot, length, minus, row

__all__ = ["consistent_winding"]


def consistent_winding(
    vertices: NDArray[np.float64], faces: NDArray[np.uint32], place: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(F,) whether each face has to be turned over, so that neighbours agree; and whether it belongs to
    a closed part that faces inward all the same, because its winding is consistent.

    vertices, faces : (V, 3) float64, (F, 3) uint32
    place : (V,) int64, the first vertex at the same place: soups count as connected where they meet
    Faces are neighbours across edges that exactly two of them share; at any other edge, a fin or a
    Moebius band's seam, nothing can be agreed on and nothing is asked.
    """
    turned, inward = np.zeros(len(faces), bool), np.zeros(len(faces), bool)
    if len(faces):
        _settle(vertices, faces, *_neighbours(place[faces]), turned, inward)
    return turned, inward


def _neighbours(
    faces: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Pairs (N, 2) of faces that share an edge, whether they run along it the same way (and so
    disagree), and (F,) which faces have an edge that is not shared by two."""
    a = faces.reshape(-1)
    b = np.roll(faces, -1, axis=1).reshape(-1)
    key = np.minimum(a, b) << 32 | np.maximum(a, b)
    order = np.argsort(key)
    ordered = key[order]
    starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]]) if len(ordered) else order
    counts = np.diff(np.r_[starts, len(ordered)])
    two = starts[counts == 2]
    left, right = order[two], order[two + 1]
    shared = np.zeros(len(key), bool)
    shared[left] = shared[right] = True
    return (
        np.stack([left // 3, right // 3], axis=1),
        np.asarray(a[left] == a[right], bool),
        np.asarray(~shared.reshape(-1, 3).all(axis=1), bool),
    )


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


@kernel
def _settle(vertices, faces, pairs, opposed, open_faces, turned, inward):
    """Fill turned and inward (F,): a union-find over neighbours that keeps each face's parity."""
    count = len(faces)
    parent, parity = np.arange(count), np.zeros(count, np.uint8)
    torn = np.zeros(count, np.bool_)  # at roots: somewhere within, neighbours disagree
    for p in range(len(pairs)):
        a, against_a = _find(parent, parity, pairs[p, 0])
        b, against_b = _find(parent, parity, pairs[p, 1])
        if a != b:
            low, high = min(a, b), max(a, b)
            parent[high] = low
            parity[high] = against_a ^ against_b ^ np.uint8(opposed[p])
            torn[low] |= torn[high]
            a = low
        torn[a] |= opposed[p]
    volume, area = np.zeros(count), np.zeros(count)
    is_open = np.zeros(count, np.bool_)
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
        is_open[root] |= open_faces[f]
    for f in range(count):
        root, against = _find(parent, parity, f)
        if torn[root]:
            measure = area[root] if is_open[root] else volume[root]
            turned[f] = (against == 1) != (measure < 0.0)
        else:
            inward[f] = not is_open[root] and volume[root] < 0.0

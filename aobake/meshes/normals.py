"""Unit normals at vertices, in float64 from float64 positions.

Normals that a file gives are taken as they are, made unit length. Missing or unusable ones are the
angle-weighted mean of the faces around the vertex (G. Thuermer, C. Wuethrich, Computing vertex normals
from polygonal facets, Journal of Graphics Tools 3(1), 1998): positive weights, so that at a vertex of a
convex body the normal is one of a supporting plane, and independent of how flat parts are cut up.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.coincident import first_equal_row
from aobake.tracing.compiled import inlined, kernel

__all__ = ["CREASE_DEGREES", "computed_normals", "unit_rows"]

FloatArray = NDArray[np.float64]

CREASE_DEGREES = 40.0  # faces at a steeper angle do not share a normal where a format has none


def unit_rows(vectors: FloatArray) -> FloatArray:
    """(N, 3) vectors at length 1; zeros where a vector is zero or not finite."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    usable = np.isfinite(largest) & (largest > 0.0)
    scaled = vectors / np.where(usable, largest, 1.0)[:, None]  # no overflow, no underflow
    scaled[~usable] = 0.0
    length = np.sqrt(np.einsum("ij,ij->i", scaled, scaled))
    return scaled / np.where(length > 0.0, length, 1.0)[:, None]


def computed_normals(
    vertices: FloatArray,
    faces: NDArray[np.uint32],
    place: NDArray[np.int64],
    crease_degrees: float,
) -> FloatArray:
    """(V, 3) unit normals of the faces around each vertex; zeros where there is none.

    vertices, faces : (V, 3) float64, (F, 3) uint32
    place : (V,) int64, the first vertex at the same place
    crease_degrees : faces that only share the place of a vertex join in up to this angle from the
        vertex's own faces; faces that share the vertex always do. 0: only those
    Of two faces with the same corners, wound against each other, the first one counts: they are one
    wall with two sides, and their sum would be zero.
    """
    counts = _one_of_each_wall(faces)
    sums = np.zeros((len(vertices), 3))
    _add_own(vertices, faces, counts, sums)
    normals = unit_rows(sums)
    if crease_degrees > 0.0 and not np.array_equal(place, np.arange(len(place))):
        start, corners = _corners_by_place(faces, place)
        cosine = math.cos(math.radians(crease_degrees))
        _add_around(vertices, faces, counts, place, start, corners, normals, cosine, sums)
        normals = unit_rows(sums)
    return normals


def _one_of_each_wall(faces: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """(F,) False for a face that has the corners of an earlier one and is wound against it."""
    first = first_equal_row(np.sort(faces, axis=1).astype(np.float64))
    a, b, c = faces.T
    wound = (a > b) ^ (a > c) ^ (b > c)  # parity of the permutation that sorts the corners
    return np.asarray(wound == wound[first], bool)


def _corners_by_place(
    faces: NDArray[np.uint32], place: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Corners (numbered 3 face + k) grouped by place: those of p are corners[start[p]:start[p + 1]]."""
    at = place[faces.reshape(-1)]
    start = np.zeros(len(place) + 1, np.int64)
    np.cumsum(np.bincount(at, minlength=len(place)), out=start[1:])
    return start, np.argsort(at, kind="stable")


@inlined
def _front(vertices, face, out):  # type: ignore[no-untyped-def]
    """Fill out (3,) with the unit normal of a face; zeros for one without area."""
    a, b, c = vertices[face[0]], vertices[face[1]], vertices[face[2]]
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    largest = max(abs(u0), abs(u1), abs(u2), abs(v0), abs(v1), abs(v2))
    if not largest > 0.0:
        out[:] = 0.0
        return
    u0, u1, u2 = u0 / largest, u1 / largest, u2 / largest
    v0, v1, v2 = v0 / largest, v1 / largest, v2 / largest
    out[0], out[1], out[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    length = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    for i in range(3):
        out[i] = out[i] / length if length > 0.0 else 0.0


@inlined
def _angle(vertices, face, k):  # type: ignore[no-untyped-def]
    """Angle of a face at its corner k. Source: W. Kahan's stable form, 2 atan2(|u - v|, |u + v|)."""
    a, b, c = vertices[face[k]], vertices[face[(k + 1) % 3]], vertices[face[(k + 2) % 3]]
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    u, v = max(abs(u0), abs(u1), abs(u2)), max(abs(v0), abs(v1), abs(v2))
    if not (u > 0.0 and v > 0.0):
        return 0.0
    u0, u1, u2 = u0 / u, u1 / u, u2 / u
    v0, v1, v2 = v0 / v, v1 / v, v2 / v
    u = np.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
    v = np.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    d0, d1, d2 = u0 / u - v0 / v, u1 / u - v1 / v, u2 / u - v2 / v
    s0, s1, s2 = u0 / u + v0 / v, u1 / u + v1 / v, u2 / u + v2 / v
    return 2.0 * np.arctan2(
        np.sqrt(d0 * d0 + d1 * d1 + d2 * d2), np.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
    )


@kernel
def _add_own(vertices, faces, counts, sums):  # type: ignore[no-untyped-def]
    """Add to sums (V, 3) the normals of the faces of each vertex, weighted by their angle there."""
    front = np.empty(3)
    for f in range(len(faces)):
        if counts[f]:
            _front(vertices, faces[f], front)
            for k in range(3):
                weight = _angle(vertices, faces[f], k)
                for i in range(3):
                    sums[faces[f, k], i] += weight * front[i]


@kernel
def _add_around(  # type: ignore[no-untyped-def]
    vertices, faces, counts, place, start, corners, own, cosine, sums
):
    """Add to sums (V, 3) the faces that share a vertex's place only, where they bend from it mildly."""
    front = np.empty(3)
    for v in range(len(place)):
        p = place[v]
        for at in range(start[p], start[p + 1]):
            f, k = corners[at] // 3, corners[at] % 3
            if counts[f] and faces[f, k] != v:
                _front(vertices, faces[f], front)
                along = front[0] * own[v, 0] + front[1] * own[v, 1] + front[2] * own[v, 2]
                if along >= cosine:
                    weight = _angle(vertices, faces[f], k)
                    for i in range(3):
                        sums[v, i] += weight * front[i]

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
from aobake.tracing.rows import largest_in_rows
from aobake.tracing.vectors import cross, dot, largest, length, minus, row, scaled

__all__ = ["CREASE_DEGREES", "computed_normals", "unit_rows"]

FloatArray = NDArray[np.float64]

CREASE_DEGREES = 40.0  # faces at a steeper angle do not share a normal where a format has none


def unit_rows(vectors: FloatArray) -> FloatArray:
    """(N, 3) vectors at length 1; zeros where a vector is zero or not finite."""
    largest = largest_in_rows(vectors)
    usable = np.isfinite(largest) & (largest > 0.0)
    scaled = vectors / np.where(usable, largest, 1.0)[:, None]  # no overflow, no underflow
    scaled[~usable] = 0.0
    length = np.sqrt(np.einsum("ij,ij->i", scaled, scaled))
    return scaled / np.where(length > 0.0, length, 1.0)[:, None]


def computed_normals(
    vertices: FloatArray,
    faces: NDArray[np.uint32],
    place: NDArray[np.int32],
    crease_degrees: float,
) -> FloatArray:
    """(V, 3) unit normals of the faces around each vertex; zeros where there is none.

    vertices, faces : (V, 3) float64, (F, 3) uint32
    place : (V,) int32, the first vertex at the same place
    crease_degrees : faces that only share the place of a vertex join in up to this angle from the
        vertex's own faces; faces that share the vertex always do. 0: only those
    Of faces with the same corners only the first one counts: twins would weigh twice, and the two sides
    of one wall would add up to nothing.
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
    """(F,) False for a face that has the corners of an earlier one: its twin, or the back of its wall."""
    a, b, c = faces.T
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    middle = a ^ b ^ c ^ low ^ high  # what is left; sorting rows of three takes five times as long
    first = first_equal_row(np.stack([low, middle, high], axis=1))
    return np.asarray(first == np.arange(len(first)), bool)


def _corners_by_place(
    faces: NDArray[np.uint32], place: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Corners (numbered 3 face + k) grouped by place: those of p are corners[start[p]:start[p + 1]]."""
    at = place[faces.reshape(-1)]
    start = np.zeros(len(place) + 1, np.int64)
    np.cumsum(np.bincount(at, minlength=len(place)), out=start[1:])
    return start, np.argsort(at, kind="stable")


@inlined
def _sides(vertices, faces, f):
    """Sides 0-1, 0-2 and 1-2 of a face, scaled alike so that products neither over- nor underflow."""
    a, b, c = row(vertices, faces[f, 0]), row(vertices, faces[f, 1]), row(vertices, faces[f, 2])
    u, v, w = minus(b, a), minus(c, a), minus(c, b)
    size = max(largest(u), largest(v))
    size = size if size > 0.0 else 1.0
    return scaled(u, size), scaled(v, size), scaled(w, size)


@inlined
def _front_and_angles(vertices, faces, f):
    """(unit normal, angles at the corners) of a face; zeros for one without area.

    An angle is the atan2 of its sine and cosine, exact to 1e-9 for needles of 1e7. The sine times the
    sides is twice the area at every corner.
    """
    u, v, w = _sides(vertices, faces, f)
    normal = cross(u, v)
    sine = length(normal)
    angles = (
        np.arctan2(sine, dot(u, v)),
        np.arctan2(sine, -dot(u, w)),
        np.arctan2(sine, dot(v, w)),
    )
    return scaled(normal, sine if sine > 0.0 else 1.0), angles


@kernel
def _add_own(vertices, faces, counts, sums):
    """Add to sums (V, 3) the normals of the faces of each vertex, weighted by their angle there.

    Dividing it over threads with the same sums takes a second kernel, which adds up in the order of faces, and
    its compiling; of 1.3 s of a bake of 70,000 faces with 256 rays in two threads it could save 4 ms.
    """
    for f in range(len(faces)):
        if counts[f]:
            front, angles = _front_and_angles(vertices, faces, f)
            for k in range(3):
                for i in range(3):
                    sums[faces[f, k], i] += angles[k] * front[i]


@kernel
def _add_around(  # noqa: PLR0913, PLR0917 - a kernel takes its arrays one by one
    vertices, faces, counts, place, start, corners, own, cosine, sums
):
    """Add to sums (V, 3) the faces that share a vertex's place only, where they bend from it mildly."""
    for v in range(len(place)):
        p = place[v]
        for at in range(start[p], start[p + 1]):
            f, k = corners[at] // 3, corners[at] % 3
            if counts[f] and faces[f, k] != v:
                front, angles = _front_and_angles(vertices, faces, f)
                if dot(front, row(own, v)) >= cosine:
                    for i in range(3):
                        sums[v, i] += angles[k] * front[i]

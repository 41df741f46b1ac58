"""What of a mesh occludes and what of it is baked: usable faces with one front, unit normals, vertices.

Nothing of the asset itself is changed by any of this; it is how a bake looks at it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.findings import EXAMPLES, Finding, FindingKind
from aobake.meshes.coincident import first_equal_row
from aobake.meshes.normals import CREASE_DEGREES, computed_normals, unit_rows
from aobake.meshes.orientation import consistent_winding
from aobake.meshes.scene import Mesh
from aobake.tracing.compiled import kernel
from aobake.tracing.conditioning import detail_at_vertices
from aobake.tracing.rows import any_in_rows, finite_rows
from aobake.tracing.vectors import cross, dot, largest, length, minus, row, scaled

__all__ = ["Surface", "findings", "surface_of"]

FloatArray = NDArray[np.float64]
# faces with one front, unit normals, and what was done to get them
Oriented = tuple[NDArray[np.uint32], FloatArray, dict[FindingKind, NDArray[np.bool_]]]

SAME_NORMAL = 2.0**20  # normals that agree to a millionth are one: sums differ in their last bits


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh as the tracer needs it.

    faces : (F', 3) uint32, all corners finite and different, fronts consistent
    normals : (V, 3) float64, unit length; zeros where none can be told
    asked : (V,) bool, the vertices to trace from: used by a face, finite, with a normal, and the first
        of those that have the same place and the same normal
    same_as : (V,) int32, the vertex whose value each one takes
    detail : (V,) float64, the size of the smallest face at each vertex
    findings : what was passed over, mended or is in doubt
    numbers : (F',) int64, which face of the mesh each of them is; None: they are all there
    """

    faces: NDArray[np.uint32]
    normals: FloatArray
    asked: NDArray[np.bool_]
    same_as: NDArray[np.int32]
    detail: FloatArray
    findings: tuple[Finding, ...]
    numbers: NDArray[np.int64] | None = None


def surface_of(mesh: Mesh, name: str = "") -> Surface:
    """Look at a mesh; never fails, whatever is in it.

    name : what findings call it
    """
    vertices = mesh.vertices
    finite = finite_rows(vertices)
    clean = vertices if finite.all() else np.where(finite[:, None], vertices, 0.0)
    given = mesh.faces.view(np.uint32)
    flat = faces_without_area(clean, given)
    whole = np.ones(len(given), bool) if finite.all() else finite[given].all(axis=1)
    usable = whole & ~flat
    faces = given if usable.all() else given[usable]
    crease = 0.0 if mesh.flat_shaded else CREASE_DEGREES
    place = None
    if mesh.normals is not None:
        faces, normals, found = _with_given_normals(mesh.normals, clean, faces, crease)
    else:
        place = first_equal_row(clean)
        faces, normals, found = _with_computed_normals(clean, faces, place, crease)
    defined = any_in_rows(normals)
    used = np.zeros(len(vertices), bool)
    used[faces.reshape(-1)] = True
    asked = used & defined
    same_as = _first_asked(clean, normals, asked, place)
    found |= {
        "non-finite": ~finite,
        "degenerate": whole & flat,
        "no-normal": used & ~defined,
    }
    return Surface(
        faces=faces,
        normals=normals,
        asked=asked & (same_as == np.arange(len(vertices))),
        same_as=same_as,
        detail=detail_at_vertices(clean, faces),
        findings=findings(name, found),
        numbers=None if usable.all() else np.flatnonzero(usable),
    )


def findings(where: str, found: Mapping[FindingKind, NDArray[np.bool_]]) -> tuple[Finding, ...]:
    """What is marked, counted and located."""
    lines = []
    for kind, marks in found.items():
        count = int(marks.sum())
        if count:
            examples = tuple(np.flatnonzero(marks)[:EXAMPLES].tolist())
            lines.append(Finding(kind=kind, where=where, count=count, examples=examples))
    return tuple(lines)


def _with_computed_normals(
    vertices: FloatArray, faces: NDArray[np.uint32], place: NDArray[np.int32], crease: float
) -> Oriented:
    """Faces with one front, and their normals.

    place : (V,) int32, the first vertex at the same place
    """
    turned, inward = consistent_winding(vertices, faces, place)
    faces = _turned(faces, turned)
    normals = computed_normals(vertices, faces, place, crease)
    return faces, normals, {"reoriented": turned, "inward": inward}


def _with_given_normals(
    given: FloatArray, vertices: FloatArray, faces: NDArray[np.uint32], crease: float
) -> Oriented:
    """Faces with their fronts where the normals of a mesh look, and these, computed where there is none."""
    normals = unit_rows(given)
    faces = _turned(faces, _against(vertices, faces, normals))
    lacking = np.zeros(len(vertices), bool)
    lacking[faces.reshape(-1)] = True
    lacking &= ~any_in_rows(normals)
    if lacking.any():
        computed = computed_normals(vertices, faces, first_equal_row(vertices), crease)
        normals[lacking] = computed[lacking]
    return faces, normals, {"replaced-normal": lacking}


def _turned(faces: NDArray[np.uint32], over: NDArray[np.bool_]) -> NDArray[np.uint32]:
    """Faces, with those marked wound the other way round."""
    return np.where(over[:, None], faces[:, [0, 2, 1]], faces) if over.any() else faces


def _first_asked(
    vertices: FloatArray,
    normals: FloatArray,
    asked: NDArray[np.bool_],
    place: NDArray[np.int32] | None,
) -> NDArray[np.int32]:
    """(V,) the first vertex that is asked of those with the same place and normal; itself where none is.

    place : the first vertex at the same place, where that is known
    """
    rows = np.arange(len(vertices), dtype=np.int32)
    if place is not None and np.array_equal(place, rows):
        return rows
    same_as = first_equal_row(vertices, np.round(normals * SAME_NORMAL))
    best = np.full(len(rows), len(rows), np.int32)
    np.minimum.at(best, same_as[asked], rows[asked])
    best = best[same_as]
    return np.where(asked & (best < len(rows)), best, rows)


def _against(
    vertices: FloatArray, faces: NDArray[np.uint32], normals: FloatArray
) -> NDArray[np.bool_]:
    """(F,) whether a face looks against the normals at its corners: then its back is its front."""
    over = np.zeros(len(faces), bool)
    _look_against(vertices, faces, normals, over)
    return over


def faces_without_area(vertices: FloatArray, faces: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """(F,) whether the corners of a face lie on one line, or on one point."""
    flat = np.zeros(len(faces), bool)
    _find_flat(vertices, faces, flat)
    return flat


@kernel
def _find_flat(vertices, faces, flat):
    for f in range(len(faces)):
        a = row(vertices, faces[f, 0])
        u, v = minus(row(vertices, faces[f, 1]), a), minus(row(vertices, faces[f, 2]), a)
        size = max(largest(u), largest(v))
        flat[f] = not size > 0.0 or not length(cross(scaled(u, size), scaled(v, size))) > 0.0


@kernel
def _look_against(vertices, faces, normals, over):
    for f in range(len(faces)):
        a = row(vertices, faces[f, 0])
        front = cross(minus(row(vertices, faces[f, 1]), a), minus(row(vertices, faces[f, 2]), a))
        along = 0.0
        for k in range(3):
            along += dot(front, row(normals, faces[f, k]))
        over[f] = along < 0.0

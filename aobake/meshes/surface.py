"""What of a mesh occludes and what of it is baked: usable faces with one front, unit normals, vertices.

Nothing of the asset itself is changed by any of this; it is how a bake looks at it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.coincident import first_equal_row
from aobake.meshes.normals import CREASE_DEGREES, computed_normals, unit_rows
from aobake.meshes.orientation import consistent_winding
from aobake.meshes.scene import Mesh
from aobake.tracing.compiled import kernel

__all__ = ["Findings", "Surface", "surface_of"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Findings:
    """How many elements of a mesh were passed over, mended or left in doubt."""

    non_finite_vertices: int = 0
    non_finite_faces: int = 0
    degenerate_faces: int = 0
    reoriented_faces: int = 0
    replaced_normals: int = 0
    undefined_normals: int = 0


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh as the tracer needs it.

    faces : (F', 3) uint32, all corners finite and different, fronts consistent
    normals : (V, 3) float64, unit length; zeros where none can be told
    asked : (V,) bool, the vertices to trace from: used by a face, finite, with a normal, and the first
        of those that have the same place and the same normal
    same_as : (V,) int64, the vertex whose value each one takes
    findings : what had to be done
    """

    faces: NDArray[np.uint32]
    normals: FloatArray
    asked: NDArray[np.bool_]
    same_as: NDArray[np.int64]
    findings: Findings


def surface_of(mesh: Mesh) -> Surface:
    """Look at a mesh; never fails, whatever is in it."""
    vertices = mesh.vertices
    finite = np.isfinite(vertices).all(axis=1)
    clean = vertices if finite.all() else np.where(finite[:, None], vertices, 0.0)
    faces = mesh.faces.astype(np.uint32)
    whole = np.ones(len(faces), bool) if finite.all() else finite[faces].all(axis=1)
    spread = (
        (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    )
    if not (whole & spread).all():
        faces = faces[whole & spread]
    faces, normals, reoriented, replaced = _with_normals(mesh, clean, faces)
    defined = normals.any(axis=1)
    used = np.zeros(len(vertices), bool)
    used[faces.reshape(-1)] = True
    same_as = first_equal_row(clean, normals)
    # A vertex that no face uses may come first: only those that are traced may stand for others.
    asked = used & finite & defined
    same_as = _first_asked(same_as, asked)
    return Surface(
        faces=faces,
        normals=normals,
        asked=asked & (same_as == np.arange(len(vertices))),
        same_as=same_as,
        findings=Findings(
            non_finite_vertices=int((~finite).sum()),
            non_finite_faces=int((~whole).sum()),
            degenerate_faces=int((whole & ~spread).sum()),
            reoriented_faces=reoriented,
            replaced_normals=replaced,
            undefined_normals=int((used & finite & ~defined).sum()),
        ),
    )


def _with_normals(
    mesh: Mesh, vertices: FloatArray, faces: NDArray[np.uint32]
) -> tuple[NDArray[np.uint32], FloatArray, int, int]:
    """Faces with one front, unit normals, how many faces were turned, how many normals replaced."""
    crease = 0.0 if mesh.flat_shaded else CREASE_DEGREES
    if mesh.normals is not None:
        normals = unit_rows(mesh.normals)
        faces, turned = _turned(faces, _against(vertices, faces, normals))
        used = np.zeros(len(vertices), bool)
        used[faces.reshape(-1)] = True
        lacking = used & ~normals.any(axis=1)
        if not lacking.any():
            return faces, normals, 0, 0
        place = first_equal_row(vertices)
        computed = computed_normals(vertices, faces, place, crease)
        normals[lacking] = computed[lacking]
        return faces, normals, 0, int(lacking.sum())
    place = first_equal_row(vertices)
    faces, turned = _turned(faces, consistent_winding(vertices, faces, place))
    return faces, computed_normals(vertices, faces, place, crease), turned, 0


def _turned(
    faces: NDArray[np.uint32], over: NDArray[np.bool_]
) -> tuple[NDArray[np.uint32], int]:
    if not over.any():
        return faces, 0
    return np.where(over[:, None], faces[:, [0, 2, 1]], faces), int(over.sum())


def _first_asked(same_as: NDArray[np.int64], asked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Like same_as, but pointing at the first of equal vertices that is asked, where one is."""
    rows = np.arange(len(same_as))
    best = np.full(len(same_as), len(same_as))
    np.minimum.at(best, same_as[asked], rows[asked])
    chosen = best[same_as]
    return np.where(asked & (chosen < len(same_as)), chosen, rows)


def _against(
    vertices: FloatArray, faces: NDArray[np.uint32], normals: FloatArray
) -> NDArray[np.bool_]:
    """(F,) whether a face looks against the normals at its corners: then its back is its front."""
    over = np.zeros(len(faces), bool)
    _look_against(vertices, faces, normals, over)
    return over


@kernel
def _look_against(vertices, faces, normals, over):  # type: ignore[no-untyped-def]
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
        along = 0.0
        for k in range(3):
            n = normals[faces[f, k]]
            along += n0 * n[0] + n1 * n[1] + n2 * n[2]
        over[f] = along < 0.0

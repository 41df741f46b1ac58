"""A broken mesh mended for the bake: edges and vertices made manifold, holes closed. Imports pymeshlab.

Only what occludes is mended, and only faces are added to it, between vertices that are there already:
the points that are asked for stay the asset's own vertices, so that nothing has to be mapped back, and
the asset itself is never touched. MeshLab's filters run on a copy without coincident vertices, which
carry the numbers of the asset's vertices through them; orientation is told afterwards, by
orientation.py, from the mended faces.

Holes are closed as in P. Liepa, Filling holes in meshes, SGP 2003, without its refinement.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from aobake.errors import EngineError
from aobake.findings import EXAMPLES, Finding, FindingKind
from aobake.meshes.coincident import first_equal_row
from aobake.meshes.scene import Mesh
from aobake.meshes.surface import faces_without_area
from aobake.tracing.conditioning import unit_frame

__all__ = ["Mended", "mended"]

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

FOLDED = 0.99  # cosine of the angle between a patch and a face that count as one on the other


@dataclass(frozen=True, eq=False)
class Mended:
    """A mesh for the bake, with the vertices of the asset's, and what was done to it."""

    mesh: Mesh
    findings: tuple[Finding, ...]


def mended(mesh: Mesh, max_hole: int, name: str = "") -> Mended:
    """Close the holes of a mesh, across vertices and edges that are not manifold.

    max_hole : edges of the largest hole that is closed
    name : what findings call the mesh
    The faces of the asset come first in the result, as they were; patches follow. A hole whose patch
    would lie back on the surface, such as the outline of a flat sheet, stays open.
    Raises EngineError where pymeshlab is not installed.
    """
    meshlab = _meshlab()
    vertices = mesh.vertices
    place = first_equal_row(vertices).astype(np.int64)  # two of them make the number of an edge
    corners = _sound_faces(vertices, mesh.faces, place)
    found: dict[FindingKind, NDArray[np.bool_]] = {
        "joined": _among(place != np.arange(len(place)), mesh.faces.reshape(-1)),
        "unreferenced": ~_among(np.ones(len(vertices), bool), mesh.faces.reshape(-1)),
        "non-manifold": np.zeros(len(vertices), bool),
    }
    patches, holes = np.zeros((0, 3), np.int64), 0
    if len(corners):
        patches, split = _patches(meshlab, vertices, corners, max_hole)
        patches = patches[~faces_without_area(vertices, patches.astype(np.uint32))]
        found["non-manifold"][split] = True
        groups = _groups(patches)
        kept = ~np.isin(groups, groups[_folded(vertices, corners, patches)])
        patches, holes = patches[kept], len(np.unique(groups[kept]))
    return Mended(
        mesh=Mesh(
            vertices=vertices,
            faces=np.concatenate([mesh.faces, patches]).astype(np.int32),
            normals=mesh.normals,
            name=mesh.name,
            flat_shaded=mesh.flat_shaded,
            material=mesh.material,
        ),
        findings=_summary(name, found, patches, holes),
    )


def _meshlab() -> ModuleType:
    try:
        import pymeshlab
    except ImportError as error:
        raise EngineError(
            "repair needs pymeshlab, which is not installed. "
            'Install it (pip install "aobake[repair]"), or bake without repair.'
        ) from error
    module: ModuleType = pymeshlab
    return module


def _sound_faces(vertices: FloatArray, faces: NDArray[np.int32], place: IndexArray) -> IndexArray:
    """Faces by the places of their corners, one of each, without those that have no area or extent."""
    finite = np.asarray(np.isfinite(vertices).all(axis=1), bool)
    corners = place[faces[finite[faces].all(axis=1)]]
    at = np.where(finite[:, None], vertices, 0.0)
    corners = corners[~faces_without_area(at, corners.astype(np.uint32))]
    if len(corners) == 0:
        return corners
    same = first_equal_row(np.sort(corners, axis=1).astype(np.float64))
    return np.asarray(corners[same == np.arange(len(same))], np.int64)


def _patches(
    meshlab: ModuleType, vertices: FloatArray, corners: IndexArray, max_hole: int
) -> tuple[IndexArray, IndexArray]:
    """(N, 3) faces that close the holes, and the vertices that had to be split to tell them."""
    used, compact = np.unique(corners, return_inverse=True)
    compact = compact.reshape(-1, 3)
    at = unit_frame([vertices[used]]).apply(vertices[used])
    document = meshlab.MeshSet(verbose=False)
    numbers = np.arange(len(used), dtype=np.float64)
    marks = np.ones(len(compact))
    document.add_mesh(
        meshlab.Mesh(at, compact.astype(np.int32), v_scalar_array=numbers, f_scalar_array=marks)
    )
    document.meshing_repair_non_manifold_edges(method="Split Vertices")
    document.meshing_repair_non_manifold_vertices()
    with contextlib.suppress(meshlab.PyMeshLabException):  # a Moebius band has no orientation
        document.meshing_re_orient_faces_coherently()
    document.meshing_close_holes(maxholesize=max_hole + 1, newfaceselected=False)
    closed = document.current_mesh()
    number = closed.vertex_scalar_array().astype(np.int64)
    copies = np.bincount(number[np.unique(closed.face_matrix())], minlength=len(used))
    added = closed.face_scalar_array() != 1.0
    return used[number[closed.face_matrix()[added]]], used[copies > 1]


def _edges(faces: IndexArray) -> IndexArray:
    """(3 N,) a number for each side of each face, the same in both directions."""
    a, b = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    return np.minimum(a, b) << 32 | np.maximum(a, b)


def _groups(patches: IndexArray) -> IndexArray:
    """(N,) the hole that each patch belongs to: patches that share sides are of one."""
    group = np.arange(len(patches))
    _, side = np.unique(_edges(patches), return_inverse=True)
    face = np.arange(len(side)) // 3
    while len(patches):
        least = np.full(len(patches) * 3, len(patches))
        np.minimum.at(least, side, group[face])
        lowered = least[side].reshape(-1, 3).min(axis=1)
        if np.array_equal(lowered, group):
            break
        group = lowered
    return group


def _folded(vertices: FloatArray, corners: IndexArray, patches: IndexArray) -> NDArray[np.bool_]:
    """(N,) whether a patch lies back on a face that it shares a side with."""
    folded = np.zeros(len(patches), bool)
    if len(patches) == 0:
        return folded
    sides, own = _edges(patches), _edges(corners)
    order = np.argsort(own, kind="stable")
    at = np.minimum(np.searchsorted(own[order], sides), len(own) - 1)
    beside = order[at]
    shared = own[beside] == sides
    patch, face = np.flatnonzero(shared) // 3, beside[shared] // 3
    inward = _inward(vertices, patches[patch], sides[shared])
    along = np.einsum("ij,ij->i", inward, _inward(vertices, corners[face], sides[shared]))
    folded[patch[along > FOLDED]] = True
    return folded


def _inward(vertices: FloatArray, faces: IndexArray, sides: IndexArray) -> FloatArray:
    """(N, 3) unit vectors within each face, square to the given side of it, away from that side."""
    a, b = sides >> 32, sides & 0xFFFFFFFF
    third = vertices[faces.sum(axis=1) - a - b]
    side = vertices[b] - vertices[a]
    side /= np.linalg.norm(side, axis=1)[:, None]
    to = third - vertices[a]
    to -= np.einsum("ij,ij->i", to, side)[:, None] * side
    length = np.linalg.norm(to, axis=1)
    return np.asarray(to / np.where(length > 0.0, length, 1.0)[:, None])


def _among(marks: NDArray[np.bool_], corners: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(V,) the marked vertices that faces use."""
    used = np.zeros(len(marks), bool)
    used[corners] = True
    return marks & used


def _summary(
    name: str, found: Mapping[FindingKind, NDArray[np.bool_]], patches: IndexArray, holes: int
) -> tuple[Finding, ...]:
    lines = [
        Finding(
            kind=kind,
            where=name,
            count=int(marks.sum()),
            examples=tuple(np.flatnonzero(marks)[:EXAMPLES].tolist()),
        )
        for kind, marks in found.items()
        if marks.any()
    ]
    if holes:
        rim = tuple(np.unique(patches)[:EXAMPLES].tolist())
        lines.append(Finding(kind="closed-hole", where=name, count=holes, examples=rim))
    return tuple(lines)

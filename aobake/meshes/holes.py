"""A mesh as it stands in the tree once alpha is looked at: what is whole, what has holes, nothing of the rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.alpha import HOLED, WHOLE, MeshAlpha
from aobake.meshes.scene import Mesh
from aobake.meshes.surface import Surface
from aobake.tracing.backfaces import pass_through_backfaces
from aobake.tracing.cutouts import pass_through_holes
from aobake.tracing.world import Triangles

__all__ = ["occluding_parts"]

AS_GIVEN, TURNED = np.array([0, 1, 2]), np.array([0, 2, 1])


def occluding_parts(
    mesh: Mesh, surface: Surface, alpha: MeshAlpha | None, *, mirrored: bool, one_sided: bool
) -> list[Triangles]:
    """The triangles of a mesh that occlude, one after the other: those that are whole, those with holes.

    alpha : of the mesh; None: all of it is opaque
    mirrored : whether the mesh stands mirrored, so that its faces are wound back
    one_sided : whether rays that meet the triangles from behind are let through
    Returns none, one or two parts, each with at least one face.
    """
    faces = surface.faces[:, TURNED] if mirrored else surface.faces
    whole = np.ones(len(faces), bool)
    parts = []
    if alpha is not None:
        kinds, numbers = _kinds(surface, alpha)
        whole = kinds == WHOLE
        holed = np.flatnonzero(kinds == HOLED)
        if len(holed):
            turned = surface.faces[holed, 1] != mesh.faces[numbers[holed], 1]
            order = np.where((turned != mirrored)[:, None], TURNED, AS_GIVEN)
            cutout = alpha.cutout(numbers[holed], order, one_sided=one_sided)
            parts.append(Triangles(mesh.vertices, faces[holed], pass_through_holes(cutout)))
    if whole.any():
        backs = pass_through_backfaces() if one_sided else None
        parts.append(Triangles(mesh.vertices, faces if whole.all() else faces[whole], backs))
    return parts


def _kinds(surface: Surface, alpha: MeshAlpha) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """(F',) the kind of each face of a surface, and which face of the mesh it is; what mends a hole is whole."""
    count = len(surface.faces)
    numbers = np.arange(count) if surface.numbers is None else surface.numbers
    kinds = np.full(count, WHOLE, np.uint8)
    given = numbers < len(alpha.kinds)
    kinds[given] = alpha.kinds[numbers[given]]
    return kinds, numbers

"""Bent normals at texels, in the space that an image keeps them in: that of normal maps, or of the mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.layout import Page
from aobake.atlas.tangents import in_tangent_space, placed_tangents, tangents_at_corners
from aobake.lightmaps.bands import TextureBake
from aobake.meshes.normals import unit_rows
from aobake.meshes.scene import FloatArray
from aobake.points import SurfacePoints
from aobake.prepare import Prepared

__all__ = ["PageFrames"]


class PageFrames:
    """The spaces of bent normals on a page. Tangents are found when they are first asked for."""

    def __init__(self, bake: TextureBake, page: Page) -> None:
        self._bake = bake
        self._page = page
        self._tangents: dict[int, FloatArray] = {}

    def turned_in(
        self,
        bent: NDArray[np.float32],
        points: SurfacePoints,
        owners: NDArray[np.int32],
        faces: NDArray[np.int32],
        weights: FloatArray,
    ) -> FloatArray:
        """(P, 3) directions in the space asked for, from those in the scene's space.

        points : (P,) on instances, with the normals that they are shaded with, no normal map taken in
        owners, faces, weights : (P,) which of the page's layouts, (P,) and (P, 2) where on its mesh
        """
        if self._bake.settings.bent_space == "object":
            return _in_mesh_space(self._bake.prepared, points.owners, bent)
        found = np.empty((len(points), 3))
        for number in np.unique(points.owners).tolist():
            mine = np.flatnonzero(points.owners == number)
            tangents = placed_tangents(
                self._of(int(owners[mine[0]])),
                faces[mine],
                weights[mine],
                self._bake.scene.instances[number].transform[:3, :3],
            )
            directions = bent[mine].astype(np.float64)
            found[mine] = in_tangent_space(directions, tangents, points.normals[mine])
        return found

    def _of(self, owner: int) -> FloatArray:
        """(F, 3, 4) tangents of a layout's mesh; those of the layout where the mesh tells none itself."""
        if owner not in self._tangents:
            instance = self._bake.scene.instances[self._page.instances[owner]]
            surface = self._bake.prepared.surfaces[instance.mesh]
            found = self._bake.materials.tangents(instance.mesh, surface)
            if found is None:
                mesh = self._bake.scene.meshes[instance.mesh]
                found = tangents_at_corners(
                    mesh.vertices[mesh.faces],
                    surface.normals[mesh.faces],
                    self._page.corners[owner],
                )
            self._tangents[owner] = found
        return self._tangents[owner]


def _in_mesh_space(
    prepared: Prepared,
    instances: NDArray[np.int32],
    directions: NDArray[np.float32] | FloatArray,
) -> FloatArray:
    """(P, 3) unit directions, turned back as normals of the mesh are: the inverse of how those are placed."""
    linear = prepared.spaces.linear.reshape(-1, 3, 3)[instances]
    return unit_rows(np.einsum("pi,pij->pj", directions, linear))

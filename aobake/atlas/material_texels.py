"""What materials say at texels: the normal map that turns them, the occlusion that is there already."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aobake import images
from aobake.atlas.lookup import looked_up
from aobake.atlas.tangents import normal_mapped, placed_tangents, tangents_at_corners
from aobake.errors import InputError
from aobake.meshes.scene import FloatArray, IntArray, Mesh, Scene, Texture
from aobake.meshes.surface import Surface
from aobake.points import SurfacePoints
from aobake.prepare import Prepared

__all__ = ["MaterialTexels"]

Pixels = NDArray[np.float32]
T = TypeVar("T")


class MaterialTexels:
    """Images of a scene's materials, each decoded when it is first looked up.

    warnings : a line for each texture that could not be used
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.warnings: list[str] = []
        self._decoded: dict[int, Pixels | None] = {}
        self._frames: dict[int, FloatArray | None] = {}

    def occlusion(self, mesh: Mesh, faces: IntArray, weights: FloatArray) -> Pixels | None:
        """(T,) what is left of the light at points of a mesh by its occlusion texture; None without one.

        faces : (T,); weights : (T, 2) of the second and third corner
        Source: glTF 2.0, 3.9.2 and 3.9.3: 1 + strength (red - 1).
        """
        if mesh.material is None:
            return None
        material = self.scene.materials[mesh.material]
        found = self._at(mesh, material.occlusion_texture, faces, weights)
        if found is None:
            return None
        return np.asarray(1.0 + material.occlusion_strength * (found[:, 0] - 1.0), np.float32)

    def _normal_map(self, mesh: Mesh, faces: IntArray, weights: FloatArray) -> Pixels | None:
        """(T, 3) what the normal map of a mesh holds at points, as stored; None without one."""
        if mesh.material is None:
            return None
        texture = self.scene.materials[mesh.material].normal_texture
        found = self._at(mesh, texture, faces, weights)
        return None if found is None or found.shape[1] < 3 else found[:, :3]

    def turn(
        self,
        points: SurfacePoints,
        rows: NDArray[np.int64],
        prepared: Prepared,
        number: int,
        faces: IntArray,
        weights: FloatArray,
    ) -> None:
        """Turn the normals of points of one instance as the normal map of its material says.

        rows : (R,) of the points; faces, weights : (R,) and (R, 2), where on the mesh these are
        """
        stands = prepared.placed[number]
        if stands is None:
            return
        instance, surface = stands
        mesh = self.scene.meshes[instance.mesh]
        stored = self._normal_map(mesh, faces, weights)
        if stored is None or mesh.material is None or points.geometric is None:
            return
        frames = self.tangents(instance.mesh, surface)
        if frames is None:
            return
        points.normals[rows] = normal_mapped(
            stored,
            self.scene.materials[mesh.material].normal_scale,
            placed_tangents(frames, faces, weights, instance.transform[:3, :3]),
            points.normals[rows],
            points.geometric[rows],
        )

    def tangents(self, number: int, surface: Surface) -> FloatArray | None:
        """(F, 3, 4) tangents of a mesh: its own, or those that MikkTSpace defines.

        None where it has neither tangents nor the texture coordinates of its normal map (TEXCOORD_0 without one).
        """
        if number not in self._frames:
            mesh = self.scene.meshes[number]
            given = self._noted(lambda: mesh.at_corners("TANGENT"))
            self._frames[number] = self._computed(mesh, surface) if given is None else given
        return self._frames[number]

    def _computed(self, mesh: Mesh, surface: Surface) -> FloatArray | None:
        texture = (
            None if mesh.material is None else self.scene.materials[mesh.material].normal_texture
        )
        uv_set = texture.uv_set if texture else 0
        uv = self._noted(lambda: mesh.at_corners(f"TEXCOORD_{uv_set}"))
        if uv is None:
            return None
        return tangents_at_corners(mesh.vertices[mesh.faces], surface.normals[mesh.faces], uv)

    def _at(
        self, mesh: Mesh, texture: Texture | None, faces: IntArray, weights: FloatArray
    ) -> Pixels | None:
        if texture is None:
            return None
        uv = self._noted(lambda: mesh.at_corners(f"TEXCOORD_{texture.uv_set}"))
        pixels = self._pixels(texture.image)
        if uv is None or pixels is None:
            return None
        return looked_up(texture, pixels, np.einsum("tc,tcx->tx", _shares(weights), uv[faces]))

    def _pixels(self, number: int) -> Pixels | None:
        if number not in self._decoded:
            image = self.scene.images[number]
            self._decoded[number] = self._noted(lambda: images.decode(image.data(), image.name))
        return self._decoded[number]

    def _noted(self, read: Callable[[], T | None]) -> T | None:
        """What is read, or None and a warning where it is broken: a bake goes on without it."""
        try:
            return read()
        except InputError as error:
            if str(error) not in self.warnings:
                self.warnings.append(str(error))
            return None


def _shares(weights: FloatArray) -> FloatArray:
    """(T, 3) the weights of all three corners."""
    return np.stack([1.0 - weights.sum(axis=1), weights[:, 0], weights[:, 1]], axis=1)

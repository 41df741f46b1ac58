"""Texture coordinates of corners, as coordinates of vertices that are split for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aobake.meshes.lightmap import Kept, Lightmap, Placing, Unwrapped
from aobake.meshes.scene import Attribute, IntArray, Mesh, Scene

__all__ = ["with_split_corners"]


def with_split_corners(scene: Scene, lightmap: Lightmap) -> Lightmap:
    """The same lightmap, for a format in which every texture coordinate belongs to a vertex.

    Where the coordinates kept belong to corners of faces, as in OBJ, the vertices are split for them.
    Raises InputError where they cannot be read.
    """
    split: dict[tuple[int, int], Unwrapped | None] = {}

    def placed(mesh: int, placing: Placing | None) -> Placing | None:
        if placing is None or not isinstance(placing.layout, Kept):
            return placing
        key = mesh, placing.layout.uv_set
        if key not in split:
            split[key] = _split(scene.meshes[mesh], placing.layout.uv_set)
        return Placing(page=placing.page, layout=split[key] or placing.layout)

    return replace(
        lightmap,
        placings=tuple(
            placed(instance.mesh, placing)
            for instance, placing in zip(scene.instances, lightmap.placings, strict=True)
        ),
    )


def _split(mesh: Mesh, uv_set: int) -> Unwrapped | None:
    """A layout with the coordinates that a mesh has at its corners; None where it has none there."""
    found = mesh.attributes.get(f"TEXCOORD_{uv_set}")
    if found is None or found.corners is None:
        return None
    return _layout(mesh.faces, found, found.corners)


def _layout(faces: IntArray, attribute: Attribute, corners: IntArray) -> Unwrapped:
    rows = max(len(attribute.values), 1)
    pairs = faces.astype(np.int64) * rows + corners
    unique, number = np.unique(pairs, return_inverse=True)
    return Unwrapped(
        source=(unique // rows).astype(np.int32),
        faces=number.reshape(faces.shape).astype(np.int32),
        uv=attribute.values[unique % rows],
    )

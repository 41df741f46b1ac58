"""A lightmap on its way into an asset: images, and where on them each instance lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.scene import FloatArray, IntArray
from aobake.settings import BentSpace

__all__ = ["BentPages", "Kept", "Lightmap", "Placing", "Unwrapped"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Kept:
    """Texture coordinates that the mesh has already.

    uv_set : the n of its TEXCOORD_n
    """

    uv_set: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Unwrapped:
    """New texture coordinates, for which a mesh is split along seams.

    source : (V',) int32, the vertex of the mesh that each new vertex is a copy of; every vertex that a
        face uses occurs. Instances of one mesh share this array and `faces` (the same objects)
    faces : (F, 3) int32 corners among the new vertices, in the order of the mesh's faces
    uv : (V', 2) float64 in [0, 1]; u runs right and v down from the image's top left corner; vertices of
        faces that got no place on the image have (0, 0)
    """

    source: IntArray
    faces: IntArray
    uv: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Placing:
    """Where an instance is on the images.

    page : index into Lightmap.pages
    """

    page: int
    layout: Kept | Unwrapped


@dataclass(frozen=True, eq=False, kw_only=True)
class BentPages:
    """Bent normals beside the images of a lightmap.

    pages : (H, W, 3) float32 of each image, unit length, row 0 at the top; x runs along growing u, y up the
        image and z along the normal in tangent space, and all three as in the mesh in object space
    """

    pages: tuple[NDArray[np.float32], ...]
    space: BentSpace

    def image(self, page: int) -> NDArray[np.float32]:
        """(H, W, 3) float32 in [0, 1], as an image keeps them: n / 2 + 1 / 2."""
        return np.asarray(0.5 * self.pages[page] + 0.5, np.float32)


@dataclass(frozen=True, eq=False, kw_only=True)
class Lightmap:
    """What is written into an asset.

    pages : (H, W) float32 images in [0, 1], row 0 at the top, 1 = open
    placings : one per instance of the scene; None for one without a triangle. Instances that are stored
        together (Instance.stored_with) have the same one
    bent : bent normals in images of their own; None where they were not asked for
    """

    pages: tuple[NDArray[np.float32], ...]
    placings: tuple[Placing | None, ...]
    bent: BentPages | None = None

"""Occlusion in the red of a metallic-roughness image: where that is possible, and the image that it gives."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.meshes.formats.gltf.textures import read_images, read_texture
from aobake.meshes.scene import Texture
from aobake.settings import Encoding

__all__ = ["OrmImages", "with_packed"]

Pixels = NDArray[np.float32]
PBR, KEY = "pbrMetallicRoughness", "metallicRoughnessTexture"


class OrmImages:
    """The metallic-roughness images of a document; what was found out about each is kept."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._images = read_images(document)
        self._sizes: dict[int, tuple[int, ...] | str] = {}

    def texture(self, material: Element) -> Texture | None:
        """The metallic-roughness texture of a material; None without one. Raises InputError."""
        pbr = material.child(PBR)
        info = pbr.child(KEY) if pbr else None
        return read_texture(self._document, info) if info else None

    def objection(self, material: Element, uv_set: int, size: tuple[int, ...]) -> str:
        """Why an occlusion image of this (height, width) on this set cannot go into the red; '' where it can.

        Both are looked up in the same way only with the same set, transform and resolution.
        """
        try:
            texture = self.texture(material)
        except InputError as error:
            return str(error)
        if texture is None:
            return "it has no metallic-roughness image"
        if texture.uv_set != uv_set:
            return (
                f"its metallic-roughness image is on TEXCOORD_{texture.uv_set}, and the occlusion "
                f"on TEXCOORD_{uv_set}"
            )
        if texture.transform is not None:
            return "its metallic-roughness image is transformed (KHR_texture_transform)"
        found = self._size(texture.image)
        if isinstance(found, str) or found == size:
            return found if isinstance(found, str) else ""
        return (
            f"its metallic-roughness image has {found[1]} x {found[0]} pixels, and the occlusion "
            f"{size[1]} x {size[0]}"
        )

    def packed(self, texture: Texture, occlusion: Pixels, encoding: Encoding | None) -> bytes:
        """The image as a PNG with the occlusion in its red, and in 16 bits where it or the other channels need them."""
        from aobake.images import encode  # heavy: only where it is asked for

        before = self._decoded(texture.image)
        others = before if before.shape[2] > 2 else before[:, :, [0, 0, *range(before.shape[2])]]
        pixels = np.concatenate([occlusion[:, :, np.newaxis], others[:, :, 1:]], axis=2)
        steps = pixels[:, :, 1:].astype(np.float64) * 255.0
        whole = bool((np.abs(steps - np.rint(steps)) < 1e-3).all())
        return encode(pixels, "png", encoding if whole else "16")

    def _size(self, image: int) -> tuple[int, ...] | str:
        if image not in self._sizes:
            try:
                self._sizes[image] = self._decoded(image).shape[:2]
            except InputError as error:
                self._sizes[image] = str(error)
        return self._sizes[image]

    def _decoded(self, image: int) -> Pixels:
        from aobake.images import decode

        return decode(self._images[image].data(), self._images[image].name)


def with_packed(material: JsonObject, texture: int) -> JsonObject:
    """A material whose metallic-roughness texture is another one, looked up in the same way."""
    pbr = cast(JsonObject, material[PBR])
    info = cast(JsonObject, pbr[KEY])
    return {**material, PBR: {**pbr, KEY: {**info, "index": texture}}}

"""The images of a lightmap as textures of a glTF document: in the GLB, or in files beside it."""

from __future__ import annotations

import urllib.parse
from pathlib import Path

from aobake.meshes.formats.gltf.bent_textures import with_bent_normals, without_bent_normals
from aobake.meshes.formats.gltf.container import Bytes
from aobake.meshes.formats.gltf.edit import NAME, Edit
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.meshes.formats.gltf.layout import Layout, free_name
from aobake.meshes.formats.gltf.looks import Look, with_occlusion
from aobake.meshes.formats.gltf.orm import OrmImages, with_packed
from aobake.meshes.lightmap import BentPages, Lightmap
from aobake.meshes.scene import Texture
from aobake.settings import ImageSettings

__all__ = ["PageTextures"]

LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071


class PageTextures:
    """Textures made so far, each when the first material asks for it.

    files : images to be written beside the asset, with their content
    """

    def __init__(
        self, edit: Edit, layout: Layout, lightmap: Lightmap, settings: ImageSettings
    ) -> None:
        self.files: dict[Path, list[Bytes]] = {}
        self._edit = edit
        self._layout = layout
        self._lightmap = lightmap
        self._settings = settings
        self._orm = OrmImages(edit.document) if settings.pack == "orm" else None
        self._pages: dict[int, int] = {}
        self._packed: dict[tuple[int, object, int], int] = {}
        self._bent: dict[int, int] = {}
        self._sampler: int | None = None

    def dressed(self, material: JsonObject, look: Look) -> JsonObject:
        """A material that looks its occlusion up in the lightmap; a copy, all else as it was."""
        occluded = self._occluded(material, look)
        bent = self._lightmap.bent
        if bent is None:
            return without_bent_normals(occluded)
        return with_bent_normals(
            occluded, self._bent_page(bent, look.page), look.uv_set, bent.space
        )

    def _occluded(self, material: JsonObject, look: Look) -> JsonObject:
        whole = Element(material, str(self._edit.document.path))
        size = self._lightmap.pages[look.page].shape
        if self._orm is not None and not self._orm.objection(whole, look.uv_set, size):
            texture = self._orm.texture(whole)
            if texture is not None:
                number = self._packed_page(self._orm, whole, texture, look.page)
                return with_occlusion(with_packed(material, number), number, look.uv_set)
        return with_occlusion(material, self._page(look.page), look.uv_set)

    def _page(self, page: int) -> int:
        """The texture of a page alone."""
        from aobake.images import encode  # heavy: a vertex bake does without

        if page not in self._pages:
            data = encode(self._lightmap.pages[page], "png", self._settings.encoding)
            texture: JsonObject = {"sampler": self._clamped(), "source": self._image(data)}
            self._pages[page] = self._edit.append("textures", texture)
        return self._pages[page]

    def _bent_page(self, bent: BentPages, page: int) -> int:
        """The texture of the bent normals of a page."""
        from aobake.images import encode  # heavy, as above

        if page not in self._bent:
            data = encode(bent.image(page), "png", self._settings.encoding)
            source = self._image(data, "bent_normal")
            self._bent[page] = self._edit.append(
                "textures", {"sampler": self._clamped(), "source": source}
            )
        return self._bent[page]

    def _packed_page(self, orm: OrmImages, material: Element, texture: Texture, page: int) -> int:
        """The texture of a page within a copy of the metallic-roughness image, sampled as that one was."""
        info = material.needed("pbrMetallicRoughness").needed("metallicRoughnessTexture")
        sampler = self._edit.document.entry("textures", info.integer("index")).value.get("sampler")
        key = texture.image, sampler, page
        if key not in self._packed:
            data = orm.packed(texture, self._lightmap.pages[page], self._settings.encoding)
            entry: JsonObject = {} if sampler is None else {"sampler": sampler}
            self._packed[key] = self._edit.append(
                "textures", {**entry, "source": self._image(data)}
            )
        return self._packed[key]

    def _image(self, data: bytes, what: str = "ao") -> int:
        if self._layout.glb:
            view = self._edit.add_view(data)
            return self._edit.append(
                "images", {"bufferView": view, "mimeType": "image/png", "name": NAME}
            )
        path = free_name(self._layout.target, self._edit.document, ".png", self.files, what)
        self.files[path] = [data]
        return self._edit.append("images", {"uri": urllib.parse.quote(path.name), "name": NAME})

    def _clamped(self) -> int:
        if self._sampler is None:
            self._sampler = self._edit.append(
                "samplers",
                {
                    "magFilter": LINEAR,
                    "minFilter": LINEAR_MIPMAP_LINEAR,
                    "wrapS": CLAMP_TO_EDGE,
                    "wrapT": CLAMP_TO_EDGE,
                },
            )
        return self._sampler

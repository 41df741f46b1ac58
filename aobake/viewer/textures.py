"""The textures of a scene's materials, put into a glTF document that was made for it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

from aobake.errors import AobakeError
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.meshes.scene import FloatArray, Material, Scene, Texture

__all__ = ["dress_materials"]

SHOWN = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}  # by every browser
WRAPS = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
NEAREST, LINEAR, LINEAR_MIPMAP_LINEAR = 9728, 9729, 9987
TRANSFORM = "KHR_texture_transform"


@dataclass(frozen=True)
class _Slot:
    """Where a material keeps a texture: the object that holds it (None: the material), its name there."""

    within: str | None
    name: str
    texture: Texture
    more: tuple[tuple[str, float], ...] = ()


def dress_materials(edit: Edit, scene: Scene, warnings: list[str]) -> None:
    """Give every material of the document the textures and the glow of the scene's.

    Images that cannot be had are left out, with a line in `warnings`; others than PNG and JPEG are
    converted to PNG.
    """
    images: dict[int, int | None] = {}
    for number, material in enumerate(scene.materials):
        entry = dict(edit.entries("materials")[number])
        if any(material.emissive):
            entry["emissiveFactor"] = [min(max(value, 0.0), 1.0) for value in material.emissive]
        for slot in _slots(material):
            image = slot.texture.image
            if image not in images:
                images[image] = _image(edit, scene, image, warnings)
            source = images[image]
            if source is not None:
                home = entry if slot.within is None else _child(entry, slot.within)
                home[slot.name] = {**_info(edit, slot.texture, source), **dict(slot.more)}
        edit.entries("materials")[number] = entry


def _slots(material: Material) -> Iterator[_Slot]:
    pbr = "pbrMetallicRoughness"
    if material.base_color_texture:
        yield _Slot(pbr, "baseColorTexture", material.base_color_texture)
    if material.metallic_roughness_texture:
        yield _Slot(pbr, "metallicRoughnessTexture", material.metallic_roughness_texture)
    if material.emissive_texture:
        yield _Slot(None, "emissiveTexture", material.emissive_texture)
    if material.normal_texture:
        scale = ("scale", material.normal_scale)
        yield _Slot(None, "normalTexture", material.normal_texture, (scale,))
    if material.occlusion_texture:
        strength = ("strength", material.occlusion_strength)
        yield _Slot(None, "occlusionTexture", material.occlusion_texture, (strength,))


def _child(entry: JsonObject, name: str) -> JsonObject:
    """An object within an entry, as a copy that may be changed."""
    child = dict(cast(JsonObject, entry.get(name, {})))
    entry[name] = child
    return child


def _image(edit: Edit, scene: Scene, number: int, warnings: list[str]) -> int | None:
    """The number of an image in the document; None where it cannot be had."""
    image = scene.images[number]
    try:
        data = image.data()
        kind = next((kind for begin, kind in SHOWN.items() if data.startswith(begin)), None)
        if kind is None:
            from aobake.images import decode, encode  # heavy: most assets do without

            data, kind = encode(decode(data, image.name), "png"), "image/png"
    except AobakeError as error:
        warnings.append(str(error))
        return None
    return edit.append(
        "images", {"bufferView": edit.add_view(data), "mimeType": kind, "name": image.name}
    )


def _info(edit: Edit, texture: Texture, source: int) -> JsonObject:
    """What a material says of a texture, which is made for it."""
    sampler: JsonObject = {
        "magFilter": NEAREST if texture.nearest else LINEAR,
        "minFilter": NEAREST if texture.nearest else LINEAR_MIPMAP_LINEAR,
        "wrapS": WRAPS[texture.wrap[0]],
        "wrapT": WRAPS[texture.wrap[1]],
    }
    number = edit.append(
        "textures", {"sampler": edit.append("samplers", sampler), "source": source}
    )
    info: JsonObject = {"index": number, "texCoord": texture.uv_set}
    if texture.transform is not None:
        info["extensions"] = {TRANSFORM: _transform(texture.transform)}
        edit.json["extensionsUsed"] = [TRANSFORM]
    return info


def _transform(matrix: FloatArray) -> JsonObject:
    """Offset, rotation and scale of KHR_texture_transform for a (2, 3) matrix without shear.

    Its matrix is ((sx cos r, sy sin r, x), (-sx sin r, sy cos r, y)).
    """
    (a, b, x), (c, d, y) = matrix.tolist()
    rotation = math.atan2(-c, a)
    across = math.hypot(a, c)
    down = b * math.sin(rotation) + d * math.cos(rotation)
    return {"offset": [x, y], "rotation": rotation, "scale": [across, down]}

"""Which texture coordinates a lightmap gets in a primitive."""

from __future__ import annotations

from aobake.meshes.formats.gltf.edit import NAME
from aobake.meshes.formats.gltf.looks import materials_of
from aobake.meshes.formats.gltf.places import Place

__all__ = ["lightmap_set"]


def lightmap_set(place: Place) -> int:
    """The n of the TEXCOORD_n that an earlier bake has left for its occlusion alone, else the lowest free one.

    Sets are numbered without a gap.
    """
    attributes = place.primitive.needed("attributes")
    n = 0
    while (number := attributes.maybe_integer(f"TEXCOORD_{n}")) is not None:
        ours = place.reader.reader.accessor(number).name == NAME
        if ours and not _looked_up(place, n):
            break
        n += 1
    return n


def _looked_up(place: Place, uv_set: int) -> bool:
    """Whether a material of the primitive reads this set for anything but its occlusion."""
    document = place.reader.reader.document
    for number in materials_of(place.primitive):
        if number is not None:
            material = document.entry("materials", number).value
            others = [value for key, value in material.items() if key != "occlusionTexture"]
            if uv_set in _sets(others):
                return True
    return False


def _sets(value: object) -> set[int]:
    """Every set that the texture references within a JSON value read."""
    found: set[int] = set()
    waiting = [value]
    while waiting:
        item = waiting.pop()
        if isinstance(item, dict):
            if isinstance(item.get("index"), int):
                found.add(item.get("texCoord", 0))
            elif isinstance(item.get("texCoord"), int):  # of KHR_texture_transform
                found.add(item["texCoord"])
            waiting += item.values()
        elif isinstance(item, list):
            waiting += item
    return found

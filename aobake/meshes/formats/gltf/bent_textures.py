"""Bent normals of a material: a texture in its extras, as glTF has no place of its own for them.

    "extras": {"bentNormalTexture": {"index": 2, "texCoord": 1, "space": "tangent"}}

It reads like a normalTexture; `space` says whether its directions are relative to the tangents, as those of a
normal map are, or to the mesh, as its normals are ("object").
"""

from __future__ import annotations

from aobake.errors import OutputError
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.settings import BentSpace

__all__ = ["with_bent_normals", "without_bent_normals"]

BENT_NORMAL_TEXTURE = "bentNormalTexture"


def with_bent_normals(
    material: JsonObject, texture: int, uv_set: int, space: BentSpace
) -> JsonObject:
    """A material with these bent normals alone; a copy, all else as it was.

    Raises OutputError where its extras are something else than an object.
    """
    extras = material.get("extras", {})
    if not isinstance(extras, dict):
        raise OutputError(
            f"material {material.get('name', '')!r}: its extras are no object, so bent normals have no place "
            "there. Leave them out, or make its extras an object."
        )
    found: JsonObject = {"index": texture}
    found |= {"texCoord": uv_set} if uv_set else {}
    return {**material, "extras": {**extras, BENT_NORMAL_TEXTURE: {**found, "space": space}}}


def without_bent_normals(material: JsonObject) -> JsonObject:
    """A material without the bent normals of an earlier bake, whose coordinates may be others now."""
    extras = material.get("extras")
    if not isinstance(extras, dict) or BENT_NORMAL_TEXTURE not in extras:
        return material
    kept = {name: value for name, value in extras.items() if name != BENT_NORMAL_TEXTURE}
    rest = {name: value for name, value in material.items() if name != "extras"}
    return {**rest, "extras": kept} if kept else rest

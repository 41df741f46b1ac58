"""Materials that look occlusion up: the same ones, or copies where something else needs them as they were."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias, cast

from aobake.errors import OutputError
from aobake.meshes.formats.gltf.copies import primitives_of
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.meshes.formats.gltf.places import Key

__all__ = ["Look", "give_looks", "materials_of", "with_occlusion"]

VARIANTS = "KHR_materials_variants"
Number: TypeAlias = int | None  # of a material; None: the default one


@dataclass(frozen=True)
class Look:
    """Where a primitive finds its occlusion.

    page : the image;  uv_set : the n of the TEXCOORD_n
    """

    page: int
    uv_set: int


def give_looks(
    edit: Edit, looks: Mapping[Key, Look], dressed: Callable[[JsonObject, Look], JsonObject]
) -> None:
    """Give every primitive a material with its look, and so all materials of its variants.

    looks : (mesh, primitive) of the new JSON -> its look;  dressed : a material with a look
    A material that is used without a look as well stays, and so does the first of several looks. Raises
    OutputError where a material does not exist.
    """
    chosen = _materials(edit, _uses(edit, looks), dressed) if looks else {}
    for (mesh, number), look in looks.items():
        primitives = primitives_of(edit, mesh)
        primitives[number] = _repointed(primitives[number], look, chosen)


def with_occlusion(material: JsonObject, texture: int, uv_set: int) -> JsonObject:
    """A material with this occlusion texture alone: a strength or a transform of an old one would bend it."""
    found: JsonObject = {"index": texture}
    return {**material, "occlusionTexture": found | ({"texCoord": uv_set} if uv_set else {})}


def materials_of(primitive: Element) -> list[int | None]:
    """Every material that a primitive names (None: the default one), those of its variants included."""
    found = [primitive.maybe_integer("material")]
    variants = primitive.extension(VARIANTS)
    if variants:
        found += [
            mapping.integer("material") for mapping in variants.children("mappings", "mapping")
        ]
    return found


def _uses(edit: Edit, looks: Mapping[Key, Look]) -> dict[Number, dict[Look | None, None]]:
    """Material -> the looks that it is used with (None: without), in order."""
    found: dict[Number, dict[Look | None, None]] = {}
    for mesh, entry in enumerate(edit.entries("meshes")):
        whole = Element(entry, f"{edit.document.path}: mesh {mesh}")
        for number, primitive in enumerate(whole.children("primitives", "primitive")):
            for material in materials_of(primitive):
                found.setdefault(material, {})[looks.get((mesh, number))] = None
    return found


def _materials(
    edit: Edit,
    uses: dict[Number, dict[Look | None, None]],
    dressed: Callable[[JsonObject, Look], JsonObject],
) -> dict[tuple[Number, Look], int]:
    """(material, look) -> the material that has it: the same one, or a copy."""
    chosen: dict[tuple[Number, Look], int] = {}
    materials = edit.entries("materials")
    for material, wanted in uses.items():
        if material is not None and material >= len(materials):
            raise OutputError(
                f"{edit.document.path}: material {material} does not exist. Export it again."
            )
        before: JsonObject = {} if material is None else materials[material]
        keep = material is None or None in wanted
        for look in wanted:
            if look is None:
                continue
            if material is None or keep:
                name = before.get("name")
                renamed: JsonObject = {"name": f"{name}_ao"} if isinstance(name, str) else {}
                chosen[material, look] = edit.append(
                    "materials", dressed({**before, **renamed}, look)
                )
            else:
                materials[material] = dressed(before, look)
                chosen[material, look] = material
                keep = True  # another look needs a copy
    return chosen


def _repointed(
    primitive: JsonObject, look: Look, chosen: dict[tuple[Number, Look], int]
) -> JsonObject:
    """A primitive whose materials have its look."""
    element = Element(primitive, "primitive")
    result = {**primitive, "material": chosen[element.maybe_integer("material"), look]}
    variants = element.extension(VARIANTS)
    if variants:
        mappings = [
            {**mapping.value, "material": chosen[mapping.integer("material"), look]}
            for mapping in variants.children("mappings", "mapping")
        ]
        extensions = cast(JsonObject, primitive["extensions"])
        result["extensions"] = {**extensions, VARIANTS: {**variants.value, "mappings": mappings}}
    return result

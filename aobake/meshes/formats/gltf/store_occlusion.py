"""Ambient occlusion as an occlusion texture: an extra TEXCOORD set whose u looks it up in a gradient.

Stock viewers then darken ambient light only, which is what occlusionTexture means. Materials that are
also used without the new set are copied. The gradient does not change with v, so v is free to hold the
value itself, and _AO reads it there: programs find the same attribute as with the attribute store, and a
later bake finds the set that it may replace. Floats, since attributes start at multiples of four bytes.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.gradient import coordinate, gradient_png
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.meshes.formats.gltf.store_attribute import AO
from aobake.meshes.formats.gltf.stores import Place

__all__ = ["OcclusionStore", "free_set"]

MOST_SETS = 8
VARIANTS = "KHR_materials_variants"
CLAMP_TO_EDGE, LINEAR = 33071, 9729


def free_set(place: Place) -> int:
    """The n of the TEXCOORD_n that an earlier bake has left, else the lowest one that is not there.

    Sets are numbered without a gap.
    """
    attributes = place.primitive.needed("attributes")
    ours = _view_of(place, AO)
    for n in range(len(attributes.value) + 1):
        name = f"TEXCOORD_{n}"
        if name not in attributes or (ours is not None and _view_of(place, name) == ours):
            return n
    raise OutputError(f"{place.label} has no texture coordinate set left.")


def _view_of(place: Place, name: str) -> int | None:
    """The buffer view that an attribute reads; None without one."""
    number = place.primitive.needed("attributes").maybe_integer(name)
    if number is None:
        return None
    return place.reader.reader.accessor(number).maybe_integer("bufferView")


class OcclusionStore:
    """TEXCOORD_n and a material that looks it up."""

    normalized = False
    parts: tuple[slice, ...] = (slice(None), slice(1, 2))

    def check(self, place: Place) -> None:
        """Raise OutputError where the primitive has no texture coordinate set left."""
        if free_set(place) >= MOST_SETS:
            raise OutputError(
                f"{place.label} has {MOST_SETS} texture coordinate sets already, and the occlusion needs one "
                "more. Keep it in the vertex colours instead (--store color)."
            )

    def column(self, place: Place, ao: NDArray[np.float32]) -> NDArray[np.generic]:  # noqa: ARG002
        """(V, 2) float32: u looks the value up, v is the value itself."""
        return np.stack([coordinate(ao), ao], axis=1).astype(np.float32)

    def names(self, place: Place) -> tuple[str, ...]:
        """The first TEXCOORD_n that is free, and _AO."""
        return f"TEXCOORD_{free_set(place)}", AO

    def finish(self, edit: Edit, places: dict[tuple[int, int], Place]) -> None:
        """Give every primitive a material whose occlusion texture reads its new set."""
        if not places:
            return
        sets = {key: free_set(place) for key, place in places.items()}
        chosen = _materials(edit, _uses(edit, sets), _texture(edit))
        meshes = edit.entries("meshes")
        for (mesh, number), level in sets.items():
            primitives = list(cast(list[JsonObject], meshes[mesh]["primitives"]))
            primitives[number] = _repointed(primitives[number], level, chosen)
            meshes[mesh] = {**meshes[mesh], "primitives": primitives}


def _texture(edit: Edit) -> int:
    """The gradient as a new texture; its number."""
    view = edit.add_view(gradient_png())
    image = edit.append(
        "images", {"bufferView": view, "mimeType": "image/png", "name": "ambient occlusion"}
    )
    sampler = edit.append(
        "samplers",
        {"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE},
    )
    return edit.append("textures", {"sampler": sampler, "source": image})


def _uses(edit: Edit, sets: dict[tuple[int, int], int]) -> dict[int | None, dict[int | None, None]]:
    """Material (None: the default one) -> the new sets that it is used with (None: without), in order."""
    found: dict[int | None, dict[int | None, None]] = {}
    for mesh, entry in enumerate(edit.entries("meshes")):
        whole = Element(entry, f"{edit.document.path}: mesh {mesh}")
        for number, primitive in enumerate(whole.children("primitives", "primitive")):
            for material in _named(primitive):
                found.setdefault(material, {})[sets.get((mesh, number))] = None
    return found


def _named(primitive: Element) -> list[int | None]:
    """Every material that a primitive names, those of its variants included."""
    found = [primitive.maybe_integer("material")]
    variants = primitive.extension(VARIANTS)
    if variants:
        found += [
            mapping.integer("material") for mapping in variants.children("mappings", "mapping")
        ]
    return found


def _materials(
    edit: Edit, uses: dict[int | None, dict[int | None, None]], texture: int
) -> dict[tuple[int | None, int], int]:
    """(material, new set) -> the material that reads the set: the same one, or a copy."""
    chosen: dict[tuple[int | None, int], int] = {}
    materials = edit.entries("materials")
    for material, levels in uses.items():
        if material is not None and material >= len(materials):
            raise OutputError(
                f"{edit.document.path}: material {material} does not exist. Export it again."
            )
        keep = material is None or None in levels
        for level in levels:
            if level is None:
                continue
            look: JsonObject = (
                {"index": texture, "texCoord": level} if level else {"index": texture}
            )
            before: JsonObject = {} if material is None else materials[material]
            if material is None or keep:
                name = before.get("name")
                renamed: JsonObject = {"name": f"{name}_ao"} if isinstance(name, str) else {}
                copy = {**before, **renamed, "occlusionTexture": look}
                chosen[material, level] = edit.append("materials", copy)
            else:
                materials[material] = {**before, "occlusionTexture": look}
                chosen[material, level] = material
                keep = True  # another set needs a copy
    return chosen


def _repointed(
    primitive: JsonObject, level: int, chosen: dict[tuple[int | None, int], int]
) -> JsonObject:
    """A copy of a primitive whose materials read its new set."""
    element = Element(primitive, "primitive")
    result = {**primitive, "material": chosen[element.maybe_integer("material"), level]}
    variants = element.extension(VARIANTS)
    if variants:
        mappings = [
            {**mapping.value, "material": chosen[mapping.integer("material"), level]}
            for mapping in variants.children("mappings", "mapping")
        ]
        extensions = cast(JsonObject, primitive["extensions"])
        result["extensions"] = {**extensions, VARIANTS: {**variants.value, "mappings": mappings}}
    return result

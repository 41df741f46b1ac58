"""What a bake into a glTF document does that its owner may not expect."""

from __future__ import annotations

from collections.abc import Mapping

from aobake.errors import InputError
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.edit import NAME
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.looks import materials_of
from aobake.meshes.formats.gltf.nodes import INSTANCING
from aobake.meshes.formats.gltf.places import Key, Place
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.settings import StoreSettings

__all__ = ["instanced", "materials_touched", "warnings_of"]

POINTER = "KHR_animation_pointer"
UNLIT = "KHR_materials_unlit"


def warnings_of(
    source: GltfSource, store: StoreSettings, places: Mapping[Key, Place]
) -> tuple[str, ...]:
    """One line for each: what is replaced, shared, or will not be seen."""
    found = instanced(source, "occlusion, their mean")
    if store.store == "color":
        found += _baked_before(source, places)
    if store.store == "occlusion":
        found += materials_touched(source, places)
    return tuple(found)


def instanced(source: GltfSource, what: str) -> list[str]:
    """One line for each node whose instances cannot differ in what they get."""
    nodes = dict.fromkeys(binding.node for binding in source.bindings if binding.gpu is not None)
    return [
        f"{source.path.name}: {source.document.label('nodes', node)} places its mesh with {INSTANCING}; "
        f"all of these instances share one {what}"
        for node in nodes
    ]


def _baked_before(source: GltfSource, places: Mapping[Key, Place]) -> list[str]:
    """Colours that an earlier bake has multiplied: what they were without it cannot be told."""
    count = 0
    for place in places.values():
        number = place.primitive.needed("attributes").maybe_integer("COLOR_0")
        if number is not None:
            count += source.document.entry("accessors", number).name == NAME
    if not count:
        return []
    return [
        f"{source.path.name}: the vertex colours of {count} primitives hold the occlusion of an earlier bake, "
        "and are darkened a second time; bake the original file"
    ]


def materials_touched(source: GltfSource, places: Mapping[Key, Place]) -> list[str]:
    """One line for each occlusion texture that is replaced, or that will not be seen."""
    document, name = source.document, source.path.name
    used = {material for place in places.values() for material in materials_of(place.primitive)}
    found: list[str] = []
    for number in sorted(material for material in used if material is not None):
        material = document.entry("materials", number)
        label = document.label("materials", number)
        if "occlusionTexture" in material and not _is_ours(document, material):
            found.append(
                f"{name}: {label} has an occlusion texture, which gives way to the new one"
            )
        if material.extension(UNLIT):
            found.append(f"{name}: {label} is unlit, so viewers ignore its occlusion texture")
    if found and any(
        POINTER in text for text in document.top.list_of("extensionsUsed") if isinstance(text, str)
    ):
        found.append(
            f"{name}: {POINTER} may animate a material that had to be copied; the copy stands still"
        )
    return found


def _is_ours(document: Document, material: Element) -> bool:
    """Whether an earlier bake has made the occlusion texture of a material."""
    try:
        texture = document.entry("textures", material.needed("occlusionTexture").integer("index"))
        image = texture.maybe_integer("source")
        return image is not None and document.entry("images", image).name == NAME
    except InputError:  # it points at nothing, and goes
        return False

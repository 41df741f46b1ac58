"""What a bake into a glTF document does that its owner may not expect."""

from __future__ import annotations

from aobake.meshes.formats.gltf.nodes import INSTANCING
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.meshes.formats.gltf.stores import Place
from aobake.settings import StoreSettings

__all__ = ["warnings_of"]

POINTER = "KHR_animation_pointer"
UNLIT = "KHR_materials_unlit"


def warnings_of(
    source: GltfSource, store: StoreSettings, places: dict[tuple[int, int], Place]
) -> tuple[str, ...]:
    """One line for each: what is replaced, shared, or will not be seen."""
    found = _instanced(source)
    if store.store == "occlusion":
        found += _materials(source, places)
    return tuple(found)


def _instanced(source: GltfSource) -> list[str]:
    nodes = dict.fromkeys(binding.node for binding in source.bindings if binding.gpu is not None)
    return [
        f"{source.path.name}: {source.document.label('nodes', node)} places its mesh with {INSTANCING}; "
        "all of these instances share one occlusion, their mean"
        for node in nodes
    ]


def _materials(source: GltfSource, places: dict[tuple[int, int], Place]) -> list[str]:
    document, name = source.document, source.path.name
    used = {place.primitive.maybe_integer("material") for place in places.values()}
    found = []
    for number in sorted(material for material in used if material is not None):
        material = document.entry("materials", number)
        label = document.label("materials", number)
        if "occlusionTexture" in material:
            found.append(f"{name}: {label} has an occlusion texture, which is replaced")
        if material.extension(UNLIT):
            found.append(f"{name}: {label} is unlit, so viewers ignore its occlusion texture")
    if found and any(
        POINTER in text for text in document.top.list_of("extensionsUsed") if isinstance(text, str)
    ):
        found.append(
            f"{name}: {POINTER} may animate a material that had to be copied; the copy stands still"
        )
    return found

"""What a bake into a glTF document does that its owner may not expect."""

from __future__ import annotations

from aobake.meshes.formats.gltf.edit import NAME
from aobake.meshes.formats.gltf.nodes import INSTANCING
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.meshes.formats.gltf.store_occlusion import free_set
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
    if store.store == "color":
        found += _baked_before(source, places)
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


def _baked_before(source: GltfSource, places: dict[tuple[int, int], Place]) -> list[str]:
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


def _materials(source: GltfSource, places: dict[tuple[int, int], Place]) -> list[str]:
    document, name = source.document, source.path.name
    ours = _ours(places)
    used = {place.primitive.maybe_integer("material") for place in places.values()}
    found: list[str] = []
    for number in sorted(material for material in used if material is not None):
        material = document.entry("materials", number)
        label = document.label("materials", number)
        if "occlusionTexture" in material and number not in ours:
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


def _ours(places: dict[tuple[int, int], Place]) -> set[int]:
    """Materials that every primitive reads through the set of an earlier bake."""
    found: dict[int, bool] = {}
    for place in places.values():
        material = place.primitive.maybe_integer("material")
        if material is not None:
            set_ = f"TEXCOORD_{free_set(place)}"
            again = set_ in place.primitive.needed("attributes")
            found[material] = found.get(material, True) and again
    return {material for material, again in found.items() if again}

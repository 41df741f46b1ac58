"""What a lightmap in a glTF document does that its owner may not expect."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from aobake.meshes.formats.gltf.lightmap_sets import lightmap_set
from aobake.meshes.formats.gltf.looks import Look, materials_of
from aobake.meshes.formats.gltf.orm import OrmImages
from aobake.meshes.formats.gltf.places import Key, Place
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.meshes.formats.gltf.warnings import instanced, materials_touched
from aobake.meshes.lightmap import Lightmap
from aobake.settings import ImageSettings

__all__ = ["layout_warnings", "lightmap_warnings"]

SHOWN_SETS = 4  # three.js reads uv, uv1, uv2 and uv3
# They number the vertices of a primitive, which a split changes.
NUMBERING = (
    "CESIUM_primitive_outline",
    "EXT_mesh_manifold",
    "EXT_mesh_primitive_edge_visibility",
)


def lightmap_warnings(source: GltfSource, places: Mapping[Key, Place]) -> list[str]:
    """One line for each thing that is so whatever the layout: what is replaced, shared, or will not be seen."""
    return [*instanced(source, "part of the lightmap"), *materials_touched(source, places)]


def layout_warnings(
    source: GltfSource,
    places: Mapping[Key, Place],
    looks: Mapping[Key, Sequence[Look]],
    lightmap: Lightmap,
    image: ImageSettings,
) -> list[str]:
    """One line for each thing that comes with the layout.

    looks : (mesh, primitive) of the document as it was read -> its looks
    """
    found = [
        line
        for key, several in looks.items()
        for line in _of_new_set(places[key], {look.uv_set for look in several})
    ]
    if image.pack == "orm":
        found += _not_packed(source, places, looks, lightmap)
    return [f"{source.path.name}: {line}" for line in dict.fromkeys(found)]


def _of_new_set(place: Place, sets: set[int]) -> Iterator[str]:
    if lightmap_set(place) not in sets:
        return
    label = place.label.rpartition(": ")[2]
    if max(sets) >= SHOWN_SETS:
        yield (
            f"{label} gets TEXCOORD_{max(sets)}, and viewers read {SHOWN_SETS} sets at most: "
            "its occlusion may not be seen"
        )
    for name in NUMBERING:
        if place.primitive.extension(name):
            yield f"{label} may be split along seams, and the vertex numbers of its {name} with it"


def _not_packed(
    source: GltfSource,
    places: Mapping[Key, Place],
    looks: Mapping[Key, Sequence[Look]],
    lightmap: Lightmap,
) -> Iterator[str]:
    images = OrmImages(source.document)
    asked = {
        (material, look): None
        for key, several in looks.items()
        for material in materials_of(places[key].primitive)
        for look in several
    }
    for material, look in asked:
        if material is None:
            yield "a primitive without a material has its occlusion in an image of its own"
            continue
        entry = source.document.entry("materials", material)
        reason = images.objection(entry, look.uv_set, lightmap.pages[look.page].shape)
        if reason:
            label = source.document.label("materials", material)
            yield f"{label} has its occlusion in an image of its own: {reason}"

"""Values at vertices put into a glTF document: attributes added, everything else left as it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats.gltf.columns import ColumnPool
from aobake.meshes.formats.gltf.copies import primitives_of, shares, with_attribute
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.means import Values
from aobake.meshes.formats.gltf.places import Key, Place, touched_places, vertices_of
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.meshes.formats.gltf.store_attribute import AttributeStore
from aobake.meshes.formats.gltf.store_color import ColorStore
from aobake.meshes.formats.gltf.store_occlusion import OcclusionStore
from aobake.meshes.formats.gltf.stores import Store
from aobake.meshes.scene import Scene
from aobake.settings import StoreSettings

__all__ = ["chosen_store", "patch"]

Added = tuple[str, int]  # the name of an attribute, and its accessor


def chosen_store(settings: StoreSettings) -> Store:
    """The way to keep ambient occlusion that the settings name."""
    stores: dict[str, Store] = {
        "color": ColorStore(),
        "occlusion": OcclusionStore(),
        "attribute": AttributeStore(),
    }
    return stores[settings.store]


def patch(
    edit: Edit, source: GltfSource, scene: Scene, kept: Sequence[tuple[Store, Sequence[Values]]]
) -> None:
    """Write what is kept at the vertices of every instance into the edit.

    kept : how, and one float32 array per instance of the scene, in its order: (V_i,) of occlusion and of
        distances, (V_i, 3) of directions in the space of its mesh
    Meshes whose nodes differ in it are copied; the first keeps the original. Raises OutputError.
    """
    places = touched_places(source)
    wanted: dict[int, dict[Key, tuple[Added, ...]]] = {}
    for store, values in kept:
        for place in places.values():
            store.check(place)
        found = _accessors(edit, source, scene, values, places, store)
        for node, parts in found.items():
            for key, added in parts.items():
                before = wanted.setdefault(node, {}).get(key, ())
                wanted[node][key] = (*before, *added)
    written: dict[Key, Place] = {}
    for share in shares(edit, source, wanted):
        primitives = primitives_of(edit, share.mesh)
        for number, attributes in share.parts.items():
            for name, accessor in attributes:
                primitives[number] = with_attribute(primitives[number], name, accessor)
            written[share.mesh, number] = places[share.original, number]
    for store, _ in kept:
        store.finish(edit, written)


def _accessors(
    edit: Edit,
    source: GltfSource,
    scene: Scene,
    values: Sequence[Values],
    places: dict[Key, Place],
    store: Store,
) -> dict[int, dict[Key, tuple[Added, ...]]]:
    """node -> (mesh, primitive) -> the attributes that hold its values; their bytes go into the edit."""
    pool = ColumnPool()
    columns = _columns(source, scene, _by_node(source, scene, values, store), places, store, pool)
    numbers = [
        edit.add_accessors(column, store.parts, normalized=_scaled(column, store))
        for column in pool.columns
    ]
    return {
        node: {
            key: tuple(zip(store.names(places[key]), numbers[column], strict=True))
            for key, column in parts.items()
        }
        for node, parts in columns.items()
    }


def _scaled(column: NDArray[np.generic], store: Store) -> bool:
    return store.normalized and column.dtype.kind == "u"


def _by_node(
    source: GltfSource, scene: Scene, kept: Sequence[Values], store: Store
) -> dict[int, dict[Key, Values]]:
    """node -> (mesh, primitive) -> its values; GPU instances of a node share the mean of theirs."""
    if not len(kept) == len(source.bindings) == len(scene.instances):
        raise OutputError(
            f"{source.path}: there are values for {len(kept)} instances, and the scene that was read has "
            f"{len(source.bindings)}. Bake the scene as it was read."
        )
    gathered: dict[int, dict[Key, list[Values]]] = {}
    for binding, instance, values in zip(source.bindings, scene.instances, kept, strict=True):
        if values.shape[:1] != (len(scene.meshes[instance.mesh].vertices),):
            raise OutputError(
                f"{source.path}: instance {instance.name!r} has {len(scene.meshes[instance.mesh].vertices)} "
                f"vertices and values of the shape {values.shape}."
            )
        node = gathered.setdefault(binding.node, {})
        node.setdefault((binding.mesh, binding.primitive), []).append(values)
    return {
        node: {key: store.mean(several) for key, several in parts.items()}
        for node, parts in gathered.items()
    }


def _columns(
    source: GltfSource,
    scene: Scene,
    by_node: dict[int, dict[Key, Values]],
    places: dict[Key, Place],
    store: Store,
    pool: ColumnPool,
) -> dict[int, dict[Key, int]]:
    """node -> (mesh, primitive) -> number of its column in the pool."""
    vertices = vertices_of(places)
    faces = {
        (binding.mesh, binding.primitive): scene.meshes[instance.mesh].faces
        for binding, instance in zip(source.bindings, scene.instances, strict=True)
    }
    found: dict[int, dict[Key, int]] = {}
    for node, parts in by_node.items():
        for key, values in parts.items():
            column = store.column(places[key], values)
            found.setdefault(node, {})[key] = pool.place(vertices[key], column, faces[key])
    return found

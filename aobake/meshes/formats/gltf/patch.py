"""Ambient occlusion put into a glTF document: attributes added, everything else left as it is."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.columns import ColumnPool
from aobake.meshes.formats.gltf.draco import DRACO
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.geometry import PrimitiveReader
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.meshes.formats.gltf.store_attribute import AttributeStore
from aobake.meshes.formats.gltf.store_color import ColorStore
from aobake.meshes.formats.gltf.store_occlusion import OcclusionStore
from aobake.meshes.formats.gltf.stores import Place, Store
from aobake.meshes.scene import Scene
from aobake.settings import StoreSettings

__all__ = ["chosen_store", "patch", "touched_places"]

Values = NDArray[np.float32]
Key = tuple[int, int]  # (mesh, primitive)


def chosen_store(settings: StoreSettings) -> Store:
    """The way to keep ambient occlusion that the settings name."""
    stores: dict[str, Store] = {
        "color": ColorStore(),
        "occlusion": OcclusionStore(),
        "attribute": AttributeStore(),
    }
    return stores[settings.store]


def touched_places(source: GltfSource) -> dict[Key, Place]:
    """(mesh, primitive) of everything that a bake of this scene writes to."""
    document = source.document
    reader = PrimitiveReader(AccessorReader(document))
    primitives: dict[int, list[Element]] = {}
    found: dict[Key, Place] = {}
    for binding in source.bindings:
        mesh, number = binding.mesh, binding.primitive
        if mesh not in primitives:
            primitives[mesh] = document.entry("meshes", mesh).children("primitives", "primitive")
        if (mesh, number) not in found:
            primitive = primitives[mesh][number]
            found[mesh, number] = Place(reader, primitive, primitive.where)
    return found


def patch(edit: Edit, source: GltfSource, scene: Scene, ao: Sequence[Values], store: Store) -> None:
    """Write the occlusion of every instance into the edit.

    ao : one (V_i,) float32 array per instance of the scene, in its order
    Meshes whose nodes differ in it are copied; the first keeps the original. Raises OutputError.
    """
    places = touched_places(source)
    for place in places.values():
        store.check(place)
    pool = ColumnPool()
    columns = _columns(source, scene, _by_node(source, scene, ao), places, store, pool)
    accessors = [
        edit.add_accessors(column, store.parts, normalized=_scaled(column, store))
        for column in pool.columns
    ]
    written: dict[Key, Place] = {}
    users = _users(source)
    for mesh, nodes in _by_mesh(columns).items():
        free = len(nodes) == users[mesh]
        for node_group, placed in _groups(nodes):
            number = mesh if free else _copied_mesh(edit, mesh)
            free = False
            _write(edit, number, {p: (places[mesh, p], accessors[c]) for p, c in placed}, store)
            written |= {(number, p): places[mesh, p] for p, _ in placed}
            for node in node_group if number != mesh else ():
                edit.entries("nodes")[node] = {**edit.entries("nodes")[node], "mesh": number}
    store.finish(edit, written)


def _scaled(column: NDArray[np.generic], store: Store) -> bool:
    return store.normalized and column.dtype.kind == "u"


def _by_node(
    source: GltfSource, scene: Scene, ao: Sequence[Values]
) -> dict[int, dict[Key, Values]]:
    """node -> (mesh, primitive) -> (V,) in [0, 1]; GPU instances of a node share the mean of theirs."""
    if not len(ao) == len(source.bindings) == len(scene.instances):
        raise OutputError(
            f"{source.path}: there are values for {len(ao)} instances, and the scene that was read has "
            f"{len(source.bindings)}. Bake the scene as it was read."
        )
    gathered: dict[int, dict[Key, list[Values]]] = {}
    for binding, instance, values in zip(source.bindings, scene.instances, ao, strict=True):
        if values.shape != (len(scene.meshes[instance.mesh].vertices),):
            raise OutputError(
                f"{source.path}: instance {instance.name!r} has {len(scene.meshes[instance.mesh].vertices)} "
                f"vertices and values of the shape {values.shape}."
            )
        node = gathered.setdefault(binding.node, {})
        node.setdefault((binding.mesh, binding.primitive), []).append(values)
    return {
        node: {key: _mean(several) for key, several in parts.items()}
        for node, parts in gathered.items()
    }


def _mean(several: list[Values]) -> Values:
    if len(several) == 1:
        mean = several[0]
    else:
        total = np.zeros(len(several[0]), np.float64)
        for values in several:
            total += np.nan_to_num(values, nan=1.0)
        mean = (total / len(several)).astype(np.float32)
    return np.clip(np.nan_to_num(mean, nan=1.0), 0.0, 1.0).astype(np.float32, copy=False)


def _columns(
    source: GltfSource,
    scene: Scene,
    by_node: dict[int, dict[Key, Values]],
    places: dict[Key, Place],
    store: Store,
    pool: ColumnPool,
) -> dict[int, dict[Key, int]]:
    """node -> (mesh, primitive) -> number of its column in the pool."""
    domains = {key: _domain(place) for key, place in places.items()}
    users: dict[Hashable, int] = {}
    for domain in domains.values():
        users[domain] = users.get(domain, 0) + 1
    faces = {
        (binding.mesh, binding.primitive): scene.meshes[instance.mesh].faces
        for binding, instance in zip(source.bindings, scene.instances, strict=True)
    }
    found: dict[int, dict[Key, int]] = {}
    for node, parts in by_node.items():
        for key, values in parts.items():
            column = store.column(places[key], values)
            alone = users[domains[key]] == 1
            used = np.zeros(0 if alone else len(column), np.bool_)
            if not alone:
                used[faces[key]] = True
            number = pool.place(domains[key], column, used, alone=alone)
            found.setdefault(node, {})[key] = number
    return found


def _domain(place: Place) -> Hashable:
    """What the vertices of a primitive are: its attributes, and the stream that they are packed in."""
    attributes = place.primitive.needed("attributes").value
    packed = place.primitive.extension(DRACO)
    return frozenset(attributes.items()), packed.integer("bufferView") if packed else None


def _by_mesh(
    columns: dict[int, dict[Key, int]],
) -> dict[int, dict[int, tuple[tuple[int, int], ...]]]:
    """mesh -> node -> (primitive, column) of each of its primitives."""
    found: dict[int, dict[int, tuple[tuple[int, int], ...]]] = {}
    for node, parts in columns.items():
        for mesh in {mesh for mesh, _ in parts}:
            placed = tuple(sorted((p, column) for (m, p), column in parts.items() if m == mesh))
            found.setdefault(mesh, {})[node] = placed
    return found


def _users(source: GltfSource) -> dict[int, int]:
    """mesh -> how many nodes show it, those outside of the scene included."""
    found: dict[int, int] = {}
    for node in source.document.entries("nodes"):
        mesh = node.maybe_integer("mesh")
        if mesh is not None:
            found[mesh] = found.get(mesh, 0) + 1
    return found


def _groups(
    nodes: dict[int, tuple[tuple[int, int], ...]],
) -> list[tuple[list[int], tuple[tuple[int, int], ...]]]:
    """Nodes whose columns are the same, with these columns, in the order of the nodes."""
    found: dict[tuple[tuple[int, int], ...], list[int]] = {}
    for node, placed in nodes.items():
        found.setdefault(placed, []).append(node)
    return [(group, placed) for placed, group in found.items()]


def _copied_mesh(edit: Edit, mesh: int) -> int:
    """A copy of a mesh at the end of the list; everything in it is shared by number."""
    before = cast(list[JsonObject], edit.document.json["meshes"])[mesh]
    number = len(edit.entries("meshes"))
    name = before.get("name")
    renamed: JsonObject = {"name": f"{name}_ao{number}"} if isinstance(name, str) else {}
    return edit.append("meshes", {**before, **renamed})


def _write(
    edit: Edit, mesh: int, placed: dict[int, tuple[Place, tuple[int, ...]]], store: Store
) -> None:
    """Give primitives of a mesh their accessors."""
    entry = edit.entries("meshes")[mesh]
    primitives = list(cast(list[JsonObject], entry["primitives"]))
    for number, (place, accessors) in placed.items():
        primitive = primitives[number]
        for name, accessor in zip(store.names(place), accessors, strict=True):
            attributes = {**cast(JsonObject, primitive["attributes"]), name: accessor}
            primitive = _unpacked({**primitive, "attributes": attributes}, name)
        primitives[number] = primitive
    edit.entries("meshes")[mesh] = {**entry, "primitives": primitives}


def _unpacked(primitive: JsonObject, name: str) -> JsonObject:
    """The same with the attribute taken off those that Draco holds: loaders would read the old one there."""
    extensions = cast(JsonObject, primitive.get("extensions", {}))
    packed = cast(JsonObject, extensions.get(DRACO, {}))
    inside = cast(JsonObject, packed.get("attributes", {}))
    if name not in inside:
        return primitive
    left = {key: value for key, value in inside.items() if key != name}
    return {**primitive, "extensions": {**extensions, DRACO: {**packed, "attributes": left}}}

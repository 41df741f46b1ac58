"""Meshes copied for nodes that are to differ: what each node's mesh gets, and which mesh gets it."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar, cast

from aobake.meshes.formats.gltf.draco import DRACO
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.meshes.formats.gltf.places import Key
from aobake.meshes.formats.gltf.source import GltfSource

__all__ = ["Share", "primitives_of", "shares", "with_attribute"]

Part = TypeVar("Part", bound=Hashable)


@dataclass(frozen=True)
class Share(Generic[Part]):
    """What one mesh of the new document gets.

    mesh : its number;  original : the number of the mesh that it is, or is a copy of
    parts : primitive -> what it gets
    """

    mesh: int
    original: int
    parts: Mapping[int, Part]


def shares(
    edit: Edit, source: GltfSource, wanted: Mapping[int, Mapping[Key, Part]]
) -> Iterator[Share[Part]]:
    """A mesh for every group of nodes that want the same of it; the nodes are pointed to copies on the way.

    wanted : node -> (mesh, primitive) -> what it is to get
    The first group of a mesh keeps the original, unless a node outside of the scene shows it as well.
    """
    users = _users(source)
    for mesh, nodes in _by_mesh(wanted).items():
        free = len(nodes) == users[mesh]
        for group, parts in _groups(nodes):
            number = mesh if free else _copied_mesh(edit, mesh)
            free = False
            for node in group if number != mesh else ():
                edit.entries("nodes")[node] = {**edit.entries("nodes")[node], "mesh": number}
            yield Share(number, mesh, dict(parts))


def primitives_of(edit: Edit, mesh: int) -> list[JsonObject]:
    """The primitives of a mesh, in a list that may be changed; its entries may not, but may be replaced."""
    entry = edit.entries("meshes")[mesh]
    primitives = list(cast(list[JsonObject], entry["primitives"]))
    edit.entries("meshes")[mesh] = {**entry, "primitives": primitives}
    return primitives


def with_attribute(primitive: JsonObject, name: str, accessor: int) -> JsonObject:
    """A primitive with one more attribute, or another one of that name."""
    attributes = {**cast(JsonObject, primitive["attributes"]), name: accessor}
    return _unpacked({**primitive, "attributes": attributes}, name)


def _unpacked(primitive: JsonObject, name: str) -> JsonObject:
    """The same with the attribute taken off those that Draco holds: loaders would read the old one there."""
    extensions = cast(JsonObject, primitive.get("extensions", {}))
    packed = cast(JsonObject, extensions.get(DRACO, {}))
    inside = cast(JsonObject, packed.get("attributes", {}))
    if name not in inside:
        return primitive
    left = {key: value for key, value in inside.items() if key != name}
    return {**primitive, "extensions": {**extensions, DRACO: {**packed, "attributes": left}}}


def _by_mesh(
    wanted: Mapping[int, Mapping[Key, Part]],
) -> dict[int, dict[int, tuple[tuple[int, Part], ...]]]:
    """mesh -> node -> (primitive, part) of each of its primitives."""
    found: dict[int, dict[int, tuple[tuple[int, Part], ...]]] = {}
    for node, parts in wanted.items():
        for mesh in {mesh for mesh, _ in parts}:
            placed = sorted(((p, part) for (m, p), part in parts.items() if m == mesh), key=_first)
            found.setdefault(mesh, {})[node] = tuple(placed)
    return found


def _first(placed: tuple[int, Part]) -> int:
    return placed[0]


def _users(source: GltfSource) -> dict[int, int]:
    """mesh -> how many nodes show it, those outside of the scene included."""
    found: dict[int, int] = {}
    for node in source.document.entries("nodes"):
        mesh = node.maybe_integer("mesh")
        if mesh is not None:
            found[mesh] = found.get(mesh, 0) + 1
    return found


def _groups(
    nodes: dict[int, tuple[tuple[int, Part], ...]],
) -> list[tuple[list[int], tuple[tuple[int, Part], ...]]]:
    """Nodes that get the same, with what they get, in the order of the nodes."""
    found: dict[tuple[tuple[int, Part], ...], list[int]] = {}
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

"""The primitives of a document that a bake writes to."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.draco import DRACO
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.geometry import PrimitiveReader
from aobake.meshes.formats.gltf.source import GltfSource

__all__ = ["Key", "Place", "Vertices", "touched_places", "vertices_of"]

Key: TypeAlias = tuple[int, int]  # (mesh, primitive)


@dataclass(frozen=True, eq=False)
class Place:
    """A primitive that is to hold ambient occlusion.

    label : 'mesh 3 "wheel" primitive 0', for messages
    """

    reader: PrimitiveReader
    primitive: Element
    label: str


@dataclass(frozen=True)
class Vertices:
    """The vertices of a primitive.

    domain : names them: their attributes, and the stream that they are packed in
    alone : whether no other primitive has the same ones
    """

    domain: Hashable
    alone: bool


def touched_places(source: GltfSource) -> dict[Key, Place]:
    """Everything that a bake of this scene writes to."""
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


def vertices_of(places: Mapping[Key, Place]) -> dict[Key, Vertices]:
    """The vertices of each place, and whether it shares them with another one."""
    domains = {key: _domain(place) for key, place in places.items()}
    users = Counter(domains.values())
    return {key: Vertices(domain, users[domain] == 1) for key, domain in domains.items()}


def _domain(place: Place) -> Hashable:
    attributes = place.primitive.needed("attributes").value
    packed = place.primitive.extension(DRACO)
    return frozenset(attributes.items()), packed.integer("bufferView") if packed else None

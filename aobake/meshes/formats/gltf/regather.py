"""Primitives whose vertices are split: every attribute and morph target gathered again, as it is stored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats.gltf.draco import DRACO
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.jsontext import JsonObject
from aobake.meshes.formats.gltf.places import Place
from aobake.meshes.scene import IntArray

__all__ = ["Regathering", "Split"]

TRIANGLES = 4
WHERE_VALUES_LIE = ("bufferView", "byteOffset", "sparse", "count", "min", "max")


@dataclass(frozen=True, eq=False)
class Split:
    """New vertices of a primitive.

    source : (V',) int32, the vertex that each is a copy of;  faces : (F, 3) int32 corners among them
    """

    source: IntArray
    faces: IntArray


class Regathering:
    """Attributes gathered so far, each to be stored once."""

    def __init__(self, edit: Edit) -> None:
        self.edit = edit
        self._attributes: dict[tuple[int, int | None, Split], int] = {}
        self._indices: dict[Split, int] = {}

    def primitive(self, place: Place, split: Split, without: str) -> JsonObject:
        """The JSON of the primitive with its vertices split: a list of triangles, without Draco.

        without : an attribute that is left out
        Raises OutputError where an attribute has not as many values as there are vertices.
        """
        whole = place.primitive
        names = [name for name in whole.needed("attributes").value if name != without]
        found: JsonObject = {
            **whole.value,
            "attributes": {name: self._attribute(place, split, name) for name in names},
            "indices": self._faces(split),
        }
        if "targets" in whole:
            found["targets"] = [
                {name: self._moved(place, split, target, name) for name in target.value}
                for target in whole.children("targets", "target")
            ]
        if "mode" in whole:
            found["mode"] = TRIANGLES
        return _without_draco(found)

    def _faces(self, split: Split) -> int:
        if split not in self._indices:
            self._indices[split] = self.edit.add_indices(split.faces, len(split.source))
        return self._indices[split]

    def _attribute(self, place: Place, split: Split, name: str) -> int:
        number = place.primitive.needed("attributes").integer(name)
        packed = place.primitive.extension(DRACO)
        inside = packed is not None and name in packed.needed("attributes")
        key = number, packed.integer("bufferView") if packed and inside else None, split
        if key not in self._attributes:
            kind = place.reader.reader.accessor(number).text("type")
            values = place.reader.stored(place.primitive, name, (kind,))
            self._attributes[key] = self._stored(place, split, name, number, values)
        return self._attributes[key]

    def _moved(self, place: Place, split: Split, target: Element, name: str) -> int:
        """An attribute of a morph target."""
        number = target.integer(name)
        key = number, None, split
        if key not in self._attributes:
            reader = place.reader.reader
            values = reader.values(number, (reader.accessor(number).text("type"),))
            self._attributes[key] = self._stored(place, split, name, number, values)
        return self._attributes[key]

    def _stored(
        self, place: Place, split: Split, name: str, number: int, values: NDArray[np.generic]
    ) -> int:
        reader = place.reader.reader
        positions = place.primitive.needed("attributes").integer("POSITION")
        vertices = reader.accessor(positions).integer("count")
        if len(values) != vertices:
            raise OutputError(
                f"{place.label}: {name} has {len(values)} values for {vertices} vertices. Export it again."
            )
        before = reader.accessor(number).value
        entry = {key: value for key, value in before.items() if key not in WHERE_VALUES_LIE}
        gathered = values[split.source]
        if name == "POSITION" or "min" in before or "max" in before:
            entry |= _bounds(gathered, before)
        return self.edit.add_attribute(gathered, entry)


def _bounds(values: NDArray[np.generic], before: Mapping[str, object]) -> JsonObject:
    """Least and largest value of each component; those of before where none is finite."""
    finite = values[np.isfinite(values.astype(np.float64)).all(axis=1)]
    if not len(finite):
        return {key: before[key] for key in ("min", "max") if key in before}
    return {"min": finite.min(axis=0).tolist(), "max": finite.max(axis=0).tolist()}


def _without_draco(primitive: JsonObject) -> JsonObject:
    extensions = cast(JsonObject, primitive.get("extensions", {}))
    if DRACO not in extensions:
        return primitive
    left = {name: value for name, value in extensions.items() if name != DRACO}
    rest = {key: value for key, value in primitive.items() if key != "extensions"}
    return {**rest, "extensions": left} if left else rest

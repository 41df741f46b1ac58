"""A glTF document being edited: JSON is copied where it changes, new bytes are gathered for the end."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.gltf.container import Bytes, padding
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.jsontext import JsonObject

__all__ = ["NAME", "Edit"]

NAME = (
    "ambient occlusion"  # of the accessors; by it a later bake knows the colours of an earlier one
)

COMPONENT_OF = {
    "int8": 5120,
    "uint8": 5121,
    "int16": 5122,
    "uint16": 5123,
    "uint32": 5125,
    "float32": 5126,
}
TYPE_OF = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
ARRAY_BUFFER = 34962


class Edit:
    """Changes to a document, which itself stays as it is.

    json : the new JSON
    pieces : bytes for the end of buffer number `buffer`, whose first one stands at byte `start`
    """

    def __init__(self, document: Document, buffer: int, start: int) -> None:
        self.document = document
        self.json: JsonObject = dict(document.json)
        self.buffer = buffer
        self.start = start
        self.pieces: list[Bytes] = []
        self.size = 0
        self._copied: set[str] = set()

    def entries(self, name: str) -> list[JsonObject]:
        """A list of the document that may be changed; its entries may not, but may be replaced."""
        if name not in self._copied:
            self.json[name] = list(cast(list[JsonObject], self.json.get(name, [])))
            self._copied.add(name)
        return cast(list[JsonObject], self.json[name])

    def append(self, name: str, entry: JsonObject) -> int:
        """Put an entry at the end of a list; its number."""
        entries = self.entries(name)
        entries.append(entry)
        return len(entries) - 1

    def add_view(self, data: Bytes, **more: int) -> int:
        """A new buffer view that holds these bytes, aligned to 4; its number."""
        view: JsonObject = {"buffer": self.buffer, "byteOffset": self.start + self.size}
        view |= {"byteLength": len(data), **more}
        filler = padding(len(data))
        self.pieces += [data, b"\0" * filler]
        self.size += len(data) + filler
        return self.append("bufferViews", view)

    def add_accessors(
        self, column: NDArray[np.generic], parts: tuple[slice, ...], *, normalized: bool = False
    ) -> tuple[int, ...]:
        """New vertex attributes over one column, (V, components); their numbers.

        parts : the components that each of them reads. Each element starts at a multiple of 4 bytes.
        """
        count, width = column.shape
        spare = padding(width * column.itemsize) // column.itemsize
        if spare:
            column = np.concatenate([column, np.zeros((count, spare), column.dtype)], axis=1)
        data = np.ascontiguousarray(column).data.cast("B") if count else b""
        view = self.add_view(
            data, byteStride=(width + spare) * column.itemsize, target=ARRAY_BUFFER
        )
        numbers = []
        for part in parts:
            first, end, _ = part.indices(width)
            accessor: JsonObject = {"name": NAME, "bufferView": view}
            accessor |= {"byteOffset": first * column.itemsize} if first else {}
            accessor["componentType"] = COMPONENT_OF[column.dtype.name]
            accessor |= {"normalized": True} if normalized else {}
            accessor |= {"count": count, "type": TYPE_OF[end - first]}
            numbers.append(self.append("accessors", accessor))
        return tuple(numbers)

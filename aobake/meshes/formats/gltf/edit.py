"""A glTF document being edited: JSON is copied where it changes, new bytes are gathered for the end."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.gltf.accessors import SHAPES
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
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
LARGEST_UINT16 = 65535


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
        view = self._add_column(column, 1)
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

    def add_attribute(self, values: NDArray[np.generic], entry: JsonObject) -> int:
        """A new vertex attribute; its number.

        values : (V, components) as stored, columns of matrices without padding
        entry : its accessor, as far as it does not say where the values lie
        """
        columns, _ = SHAPES[str(entry["type"])]
        view = self._add_column(values, columns)
        return self.append("accessors", {**entry, "bufferView": view, "count": len(values)})

    def add_indices(self, corners: NDArray[np.integer], vertices: int) -> int:
        """A new accessor of indices below `vertices`, as narrow as they can be; its number."""
        narrow = vertices <= LARGEST_UINT16  # the largest number itself restarts a primitive
        flat = np.ascontiguousarray(corners, np.uint16 if narrow else np.uint32).reshape(-1)
        view = self.add_view(flat.data.cast("B") if len(flat) else b"", target=ELEMENT_ARRAY_BUFFER)
        kind = COMPONENT_OF[flat.dtype.name]
        return self.append(
            "accessors",
            {"bufferView": view, "componentType": kind, "count": len(flat), "type": "SCALAR"},
        )

    def _add_column(self, values: NDArray[np.generic], columns: int) -> int:
        """A view of (V, components), where every element and every column of a matrix starts at 4 bytes."""
        rows = values.reshape(len(values), columns, values.shape[1] // columns)
        spare = padding(rows.shape[2] * values.itemsize) // values.itemsize
        if spare:
            rows = np.pad(rows, ((0, 0), (0, 0), (0, spare)))
        data = np.ascontiguousarray(rows).data.cast("B") if rows.size else b""
        stride = columns * rows.shape[2] * values.itemsize
        return self.add_view(data, byteStride=stride, target=ARRAY_BUFFER)

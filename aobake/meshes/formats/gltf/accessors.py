"""Accessors: the numbers behind attributes and indices, exactly as they are stored."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.element import Element

__all__ = ["COMPONENTS", "SHAPES", "AccessorReader", "Numbers", "accessor_dtype", "decoded"]

Numbers: TypeAlias = NDArray[Any]

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
SHAPES = {  # columns and rows
    "SCALAR": (1, 1),
    "VEC2": (1, 2),
    "VEC3": (1, 3),
    "VEC4": (1, 4),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
# A file may claim far more than it holds: zeros without bytes, views that overlap. Decoded values
# may take this much, and this many times the bytes that were really read.
FREE_BYTES = 1 << 30
BYTES_PER_BYTE = 48


class AccessorReader:
    """Reads accessors of a document, each once; keeps account of what they claim."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self._values: dict[int, Numbers] = {}
        self._views: dict[int, memoryview] = {}
        self._spent = 0

    def accessor(self, number: int) -> Element:
        """The JSON of an accessor."""
        return self.document.entry("accessors", number)

    def values(self, number: int, types: tuple[str, ...]) -> Numbers:
        """Stored values, sparse ones applied: (count, components), of the stored type, read-only.

        types : the accessor types that are allowed, such as ('VEC3',)
        Raises InputError for another type, and where the accessor reaches beyond its bytes.
        """
        accessor = self.accessor(number)
        kind = accessor.text("type")
        if kind not in types:
            raise InputError(f"{accessor.where} is {kind[:20]!r}; {' or '.join(types)} is needed.")
        if number not in self._values:
            values = self._read(accessor)
            values.flags.writeable = False
            self._values[number] = values
        return self._values[number]

    def floats(self, number: int, types: tuple[str, ...]) -> NDArray[np.float64]:
        """Values as float64, normalised ones scaled: (count, components)."""
        values = self.values(number, types)
        self.spend(values.size * 8, self.accessor(number).where)
        return decoded(values, self.accessor(number).flag("normalized"))

    def spend(self, size: int, where: str) -> None:
        """Account for bytes to be allocated. Raises InputError where a file claims beyond all sense."""
        self._spent += size
        held = sum(len(data) for data in self.document.buffers_read.values())
        if self._spent > FREE_BYTES + BYTES_PER_BYTE * held:
            raise InputError(
                f"{where} claims more than the file can hold: {self._spent >> 20} MiB from "
                f"{held >> 10} KiB. Export it again."
            )

    def _read(self, accessor: Element) -> Numbers:
        dtype, shape = accessor_dtype(accessor), SHAPES[accessor.text("type")]
        count = accessor.integer("count")
        if "bufferView" in accessor:
            values = self._rows(accessor, count, dtype, shape)
        else:
            self.spend(count * shape[0] * shape[1] * dtype.itemsize, accessor.where)
            values = np.zeros((count, shape[0] * shape[1]), dtype)
        sparse = accessor.child("sparse")
        return self._sparse(values, sparse, dtype, shape) if sparse else values

    def _sparse(
        self, values: Numbers, sparse: Element, dtype: np.dtype[Any], shape: tuple[int, int]
    ) -> Numbers:
        count = sparse.integer("count")
        indices, new = sparse.needed("indices"), sparse.needed("values")
        where = self._rows(indices, count, accessor_dtype(indices), (1, 1))[:, 0]
        if where.dtype.kind != "u":
            raise InputError(
                f"{indices.where} are {where.dtype}; unsigned whole numbers are needed."
            )
        if count and int(where.max()) >= len(values):
            raise InputError(
                f"{indices.where} name element {int(where.max())}, and the accessor has {len(values)}."
            )
        self.spend(values.nbytes, sparse.where)
        values = values.copy()
        values[where.astype(np.int64)] = self._rows(new, count, dtype, shape)
        return values

    def _rows(
        self, entry: Element, count: int, dtype: np.dtype[Any], shape: tuple[int, int]
    ) -> Numbers:
        """(count, columns * rows) view of a buffer view; matrix columns are padded to 4 bytes."""
        number = entry.index("bufferView", self.document.size("bufferViews"), "buffer views")
        view = self.document.entry("bufferViews", number)
        data = self.view(number)
        columns, rows = shape
        column = rows * dtype.itemsize
        column += -column % 4 if columns > 1 else 0
        stride = view.integer("byteStride", 0) or columns * column
        start = entry.integer("byteOffset", 0)
        if count == 0:
            return np.zeros((0, columns * rows), dtype)
        end = start + stride * (count - 1) + (columns - 1) * column + rows * dtype.itemsize
        if end > len(data):
            raise InputError(
                f"{entry.where} claims {count} elements up to byte {end} of buffer view {number}, "
                f"which has {len(data)}. Export it again."
            )
        found = np.ndarray(
            (count, columns, rows), dtype, data, start, (stride, column, dtype.itemsize)
        )
        return found[:, 0, :] if columns == 1 else found.reshape(count, columns * rows)

    def view(self, number: int) -> memoryview:
        """The bytes of a buffer view, decompressed where they are compressed. Raises InputError."""
        if number not in self._views:
            view = self.document.entry("bufferViews", number)
            packed = next((found for name in MESHOPT if (found := view.extension(name))), None)
            self._views[number] = self._unpacked(packed) if packed else self.document.view(view)
        return self._views[number]

    def _unpacked(self, packed: Element) -> memoryview:
        from aobake.meshes.formats.gltf import meshopt  # numba: only where a file needs it

        stream = self.document.view(packed)
        self.spend(packed.integer("count") * packed.integer("byteStride"), packed.where)
        return meshopt.decompress(stream, packed)


def decoded(values: Numbers, normalized: bool) -> NDArray[np.float64]:
    """Stored values as float64: whole numbers that are normalised give [0, 1] or [-1, 1].

    Source: glTF 2.0, section 3.6.2.2.
    """
    with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one
        found = values.astype(np.float64)
    if normalized and values.dtype.kind in "iu":
        found /= np.iinfo(values.dtype).max
        if values.dtype.kind == "i":
            np.maximum(found, -1.0, out=found)
    return found


def accessor_dtype(entry: Element) -> np.dtype[Any]:
    """The stored type of a component. Raises InputError for one that does not exist."""
    kind = entry.integer("componentType")
    if kind not in COMPONENTS:
        raise InputError(f"{entry.where}: componentType {kind} does not exist in glTF 2.0.")
    return np.dtype(COMPONENTS[kind])

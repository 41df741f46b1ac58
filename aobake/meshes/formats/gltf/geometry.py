"""One primitive as triangles: corners, positions and normals, morphed and unpacked."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.gltf import draco
from aobake.meshes.formats.gltf.accessors import (
    SHAPES,
    AccessorReader,
    Numbers,
    accessor_dtype,
    decoded,
)
from aobake.meshes.formats.gltf.element import Element

__all__ = ["TRIANGLE_MODES", "Geometry", "PrimitiveReader", "corners", "is_morphed"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

TRIANGLES, STRIP, FAN = 4, 5, 6
TRIANGLE_MODES = (TRIANGLES, STRIP, FAN)


@dataclass(frozen=True, eq=False)
class Geometry:
    """Triangles of a primitive in its node's space.

    vertices : (V, 3) float64;  faces : (F, 3) int32;  normals : (V, 3) float64, or None
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray | None


class PrimitiveReader:
    """Reads primitives of a document; what several of them share is read once."""

    def __init__(self, reader: AccessorReader) -> None:
        self.reader = reader
        self._floats: dict[int, FloatArray] = {}
        self._faces: dict[tuple[int | None, int, int], IntArray] = {}
        self._draco: dict[int, tuple[object, draco.DracoPrimitive]] = {}

    def geometry(self, primitive: Element, weights: tuple[float, ...]) -> Geometry:
        """The triangles of a primitive, its morph targets applied with these weights. Raises InputError."""
        attributes = primitive.needed("attributes")
        for name in attributes.value:
            self._accessor(attributes, name)
        vertices = self.column(primitive, "POSITION")
        if vertices is None:
            raise InputError(f"{primitive.where} has no POSITION. Export it again.")
        faces = self.faces(primitive, len(vertices))
        normals = self.column(primitive, "NORMAL")
        if normals is not None and len(normals) != len(vertices):
            raise InputError(
                f"{primitive.where} has {len(normals)} normals for {len(vertices)} vertices. Export it again."
            )
        vertices = self._morphed(vertices, "POSITION", primitive, weights)
        if normals is not None:
            normals = self._morphed(normals, "NORMAL", primitive, weights)
        return Geometry(vertices, faces, normals)

    def column(self, primitive: Element, name: str) -> FloatArray | None:
        """(V, 3) float64 of an attribute; None where the primitive has none of that name."""
        if name not in primitive.needed("attributes"):
            return None
        return self.floats(primitive, name, ("VEC3",))

    def floats(self, primitive: Element, name: str, types: tuple[str, ...]) -> FloatArray:
        """(V, components) float64 of an attribute that the primitive has, normalised ones scaled."""
        number = self._accessor(primitive.needed("attributes"), name)
        packed = self.packed(primitive)
        if packed is None or name not in packed.attributes:
            self.reader.values(number, types)  # refuses another type, even where it was read before
            if number not in self._floats:
                self._floats[number] = self.reader.floats(number, types)
            return self._floats[number]
        values = self.stored(primitive, name, types)
        self.reader.spend(values.size * 8, primitive.where)
        return decoded(values, self.reader.accessor(number).flag("normalized"))

    def stored(self, primitive: Element, name: str, types: tuple[str, ...]) -> Numbers:
        """(V, components) of an attribute as it is stored, unpacked where Draco holds it."""
        number = self._accessor(primitive.needed("attributes"), name)
        packed = self.packed(primitive)
        if packed is None or name not in packed.attributes:
            return self.reader.values(number, types)
        accessor = self.reader.accessor(number)
        values, kind = packed.attributes[name], accessor.text("type")
        if kind not in types or values.shape[1] != math.prod(SHAPES[kind]):
            raise InputError(
                f"{primitive.where}: {name} is {kind[:20]} with {values.shape[1]} numbers in the Draco stream; "
                f"{' or '.join(types)} is needed."
            )
        if len(values) != accessor.integer("count"):
            raise InputError(
                f"{accessor.where} claims {accessor.integer('count')} values, and the Draco stream has "
                f"{len(values)}. Export it again."
            )
        # DracoPy gives 16-bit whole numbers as 32-bit ones; the accessor says what they are.
        return values.astype(accessor_dtype(accessor), copy=False)

    def packed(self, primitive: Element) -> draco.DracoPrimitive | None:
        """The primitive in its Draco stream; None where it is not compressed so."""
        extension = primitive.extension(draco.DRACO)
        if extension is None:
            return None
        key = id(primitive.value)
        if key not in self._draco:
            document = self.reader.document
            number = extension.index("bufferView", document.size("bufferViews"), "buffer views")
            found = draco.decompress(self.reader.view(number), extension)
            # The JSON object is kept beside, so that its id stays its own.
            self._draco[key] = (primitive.value, found)
        return self._draco[key][1]

    def faces(self, primitive: Element, vertices: int) -> IntArray:
        """(F, 3) int32 corners of the triangles. Raises InputError for indices out of range."""
        packed = self.packed(primitive)
        if packed is not None:
            return _checked(packed.faces, vertices, f"{primitive.where}, Draco indices")
        mode = primitive.integer("mode", TRIANGLES)
        number = primitive.maybe_index(
            "indices", self.reader.document.size("accessors"), "accessors"
        )
        key = (number, mode, vertices)
        if key not in self._faces:
            self._faces[key] = self._corners(primitive, number, mode, vertices)
        return self._faces[key]

    def _corners(
        self, primitive: Element, number: int | None, mode: int, vertices: int
    ) -> IntArray:
        if number is None:
            return corners(np.arange(vertices, dtype=np.int32), mode)
        accessor = self.reader.accessor(number)
        values = self.reader.values(number, ("SCALAR",))[:, 0]
        if values.dtype.kind != "u":
            raise InputError(
                f"{accessor.where} is {values.dtype}, used as indices; unsigned is needed."
            )
        self.reader.spend(len(values) * (4 if mode == TRIANGLES else 12), accessor.where)
        return corners(
            _checked(values, vertices, f"{primitive.where}, {accessor.where.rpartition(': ')[2]}"),
            mode,
        )

    def _morphed(
        self, values: FloatArray, name: str, primitive: Element, weights: tuple[float, ...]
    ) -> FloatArray:
        moved: FloatArray | None = None
        for target, weight in _active_targets(primitive, name, weights):
            number = self._accessor(target, name)
            delta = self.reader.floats(number, ("VEC3",))
            if len(delta) != len(values):
                raise InputError(
                    f"{target.where}: {name} has {len(delta)} values for {len(values)} vertices. Export it again."
                )
            moved = values.copy() if moved is None else moved
            with np.errstate(over="ignore", invalid="ignore"):
                moved += weight * delta
        return values if moved is None else moved

    def _accessor(self, attributes: Element, name: str) -> int:
        return attributes.index(name, self.reader.document.size("accessors"), "accessors")


def _active_targets(
    primitive: Element, name: str, weights: tuple[float, ...]
) -> Iterator[tuple[Element, float]]:
    """The morph targets that move an attribute, with their weights."""
    for target, weight in zip(primitive.children("targets", "target"), weights, strict=False):
        if weight != 0.0 and name in target:
            yield target, weight


def is_morphed(primitive: Element, name: str, weights: tuple[float, ...]) -> bool:
    """Whether a morph target moves an attribute with these weights."""
    return any(True for _ in _active_targets(primitive, name, weights))


def _checked(indices: NDArray[np.generic], vertices: int, where: str) -> IntArray:
    """The same as int32. Raises InputError where one points at no vertex; restart values do as well."""
    if indices.size:
        worst = int(indices.max())
        if worst >= vertices:
            raise InputError(
                f"{where}: an index is {worst}, and there are {vertices} vertices. Export it again."
            )
    flat = np.ascontiguousarray(indices)
    return flat.view(np.int32) if flat.dtype == np.dtype("<u4") else flat.astype(np.int32)


def corners(indices: IntArray, mode: int) -> IntArray:
    """(F, 3) corners of a triangle list, strip or fan, counter-clockwise; what is left over is dropped.

    Source: glTF 2.0, section 3.7.2.1.
    """
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    i = np.arange(max(len(indices) - 2, 0))
    if mode == STRIP:
        return np.stack([indices[i], indices[i + 1 + i % 2], indices[i + 2 - i % 2]], axis=1)
    return np.stack([indices[i + 1], indices[i + 2], indices[np.zeros(len(i), np.int64)]], axis=1)

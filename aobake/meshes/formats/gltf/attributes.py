"""What a primitive has on its surface beside positions and normals, read when it is asked for."""

from __future__ import annotations

import re
from functools import cached_property, partial

from aobake.errors import InputError
from aobake.meshes.attributes import DeferredAttributes
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.geometry import PrimitiveReader
from aobake.meshes.formats.gltf.store_bent_normals import BENT_NORMAL
from aobake.meshes.formats.gltf.store_mean_distance import MEAN_DISTANCE
from aobake.meshes.scene import Attribute

__all__ = ["TANGENT", "SurfaceReader"]

TANGENT = "TANGENT"
TYPES = (
    (re.compile(r"TEXCOORD_\d+"), ("VEC2",)),
    (re.compile(r"COLOR_\d+"), ("VEC3", "VEC4")),
    (re.compile(TANGENT), ("VEC4",)),
    (re.compile("_AO"), ("SCALAR",)),
    (re.compile(BENT_NORMAL), ("VEC3",)),
    (re.compile(MEAN_DISTANCE), ("SCALAR",)),
)


class SurfaceReader:
    """Gives primitives of a document their attributes.

    It has a PrimitiveReader of its own, made with the first attribute: the one that reads the geometry
    holds decompressed streams and joint weights, which need not outlive it in a bake that asks for none.
    """

    def __init__(self, document: Document) -> None:
        self._document = document

    def attributes(
        self, primitive: Element, vertices: int, *, tangents: bool
    ) -> DeferredAttributes:
        """TEXCOORD_n, COLOR_n, TANGENT, _AO, _BENT_NORMAL and _MEAN_DISTANCE of a primitive with so many vertices.

        tangents : whether those of the file belong to the shape that the mesh is given
        Asking for one raises InputError where it is of another type or length, or cannot be read.
        """
        readers = {}
        for name in primitive.needed("attributes").value:
            types = _types(name)
            if types and (tangents or name != TANGENT):
                readers[name] = partial(self._attribute, primitive, name, types, vertices)
        return DeferredAttributes(readers)

    @cached_property
    def _primitives(self) -> PrimitiveReader:
        return PrimitiveReader(AccessorReader(self._document))

    def _attribute(
        self, primitive: Element, name: str, types: tuple[str, ...], vertices: int
    ) -> Attribute:
        values = self._primitives.floats(primitive, name, types)
        if len(values) != vertices:
            raise InputError(
                f"{primitive.where}: {name} has {len(values)} values for {vertices} vertices. Export it again."
            )
        return Attribute(values=values)


def _types(name: str) -> tuple[str, ...] | None:
    """The accessor types that an attribute may have; None for one that is not read."""
    return next((types for pattern, types in TYPES if pattern.fullmatch(name)), None)

"""Draco-compressed primitives. The one file that imports DracoPy.

Source: KHR_draco_mesh_compression; the Draco bitstream specification 2.2 for the header.
"""

from __future__ import annotations

from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.gltf.element import Element

__all__ = ["DRACO", "DracoPrimitive", "decompress"]

DRACO = "KHR_draco_mesh_compression"
# A stream of equal values packs thousands of faces into a byte; beyond this it is a bomb.
FREE_FACES = 1 << 20
FACES_PER_BYTE = 512


class DracoPrimitive:
    """A decompressed primitive.

    faces : (F, 3) uint32
    attributes : name -> (V, components), of the stored type
    """

    def __init__(
        self, faces: NDArray[np.uint32], attributes: dict[str, NDArray[np.generic]]
    ) -> None:
        self.faces = faces
        self.attributes = attributes


class _Mesh(Protocol):
    faces: object

    def get_attribute_by_unique_id(self, unique_id: int) -> dict[str, object]: ...


def decompress(stream: memoryview, extension: Element) -> DracoPrimitive:
    """The primitive in a Draco stream.

    extension : KHR_draco_mesh_compression of the primitive, whose attributes name what is in the stream
    Raises InputError where the stream is cut, claims beyond sense, or lacks an attribute.
    """
    where = extension.where
    _check_claims(stream, where)
    try:
        import DracoPy

        mesh = cast(_Mesh, DracoPy.decode(bytes(stream)))
        faces = np.ascontiguousarray(np.asarray(mesh.faces), np.uint32).reshape(-1, 3)
    except MemoryError as error:
        raise InputError(f"{where}: the Draco stream does not fit into memory.") from error
    except Exception as error:  # DracoPy's errors have no common base
        raise InputError(
            f"{where}: the Draco stream cannot be decoded ({_line(error)}). Export it again."
        ) from error
    attributes = {}
    for name in extension.needed("attributes").value:
        attributes[name] = _attribute(mesh, name, extension)
    sizes = {len(values) for values in attributes.values()}
    if len(sizes) > 1:
        raise InputError(
            f"{where}: its attributes have {sorted(sizes)} values; one number is needed."
        )
    return DracoPrimitive(faces, attributes)


def _attribute(mesh: _Mesh, name: str, extension: Element) -> NDArray[np.generic]:
    number = extension.needed("attributes").integer(name)
    try:
        found = np.asarray(mesh.get_attribute_by_unique_id(number)["data"])
    except Exception as error:
        raise InputError(
            f"{extension.where}: attribute {number}, {name}, is not in the stream. Export it again."
        ) from error
    return found.reshape(len(found), -1)


def _check_claims(stream: memoryview, where: str) -> None:
    """Raise InputError for what is no Draco mesh, and for a number of faces beyond all sense."""
    if len(stream) < 12 or bytes(stream[:5]) != b"DRACO":
        raise InputError(f"{where}: this is no Draco stream. Export it again.")
    major, minor, kind, method = stream[5:9]
    if kind != 1:
        raise InputError(f"{where}: the Draco stream holds points, not triangles. Export it again.")
    has_metadata = stream[10] & 0x80
    if has_metadata or (major, minor) < (2, 2):
        return  # the numbers stand elsewhere; the decoder checks them against the stream
    position = 11 if method == 0 else 12  # edgebreaker: one byte for the kind of traversal
    first, position = _varint(stream, position, where)
    second, position = _varint(stream, position, where)
    if max(first, second) > FREE_FACES + FACES_PER_BYTE * len(stream):
        raise InputError(
            f"{where}: the Draco stream claims {max(first, second)} faces or vertices in "
            f"{len(stream)} bytes. Export it again."
        )


def _varint(stream: memoryview, position: int, where: str) -> tuple[int, int]:
    value = 0
    for shift in range(0, 35, 7):
        if position >= len(stream):
            break
        byte = stream[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, position
    raise InputError(f"{where}: the Draco stream is cut short. Export it again.")


def _line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:80]

"""The file around the JSON: GLB with its chunks, or plain JSON text."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from aobake.errors import InputError, OutputError

__all__ = ["BIN_CHUNK", "Bytes", "Container", "glb_pieces", "open_container", "padding"]

Bytes: TypeAlias = bytes | bytearray | memoryview

MAGIC = b"glTF"
JSON_CHUNK = 0x4E4F534A
BIN_CHUNK = 0x004E4942
MOST_BYTES = 2**32 - 1  # the length of a GLB is a 32-bit number


@dataclass(frozen=True, eq=False)
class Container:
    """The parts of a file, none of them copied.

    text : the JSON
    chunks : (type, content) of every GLB chunk after the JSON, in order; empty for plain JSON
    trailing : what follows the last chunk
    """

    is_glb: bool
    text: Bytes
    chunks: tuple[tuple[int, memoryview], ...] = ()
    trailing: memoryview = memoryview(b"")  # noqa: RUF009 - read-only

    @property
    def binary(self) -> memoryview | None:
        """The content of the BIN chunk; None where there is none."""
        return next((content for kind, content in self.chunks if kind == BIN_CHUNK), None)


def open_container(data: bytes, path: Path) -> Container:
    """The parts of a glTF or GLB file, known by its content. Raises InputError."""
    if not data:
        raise InputError(f"{path}: the file is empty. Export it again.")
    if not data.startswith(MAGIC):
        if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] != b"{":
            raise InputError(
                f"{path}: this is neither GLB nor glTF: it begins with {bytes(data[:8])!r}. "
                "Check that the file is what its name says."
            )
        return Container(is_glb=False, text=data)
    if len(data) < 20:
        raise InputError(
            f"{path}: the GLB ends within its header ({len(data)} bytes). Export it again."
        )
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise InputError(
            f"{path}: this is GLB version {version}; 2 is needed. Convert it to glTF 2.0."
        )
    if length > len(data):
        raise InputError(
            f"{path}: the GLB is cut short: it has {len(data)} of {length} bytes. Copy it again."
        )
    chunks, end = _chunks(memoryview(data), length, path)
    if not chunks or chunks[0][0] != JSON_CHUNK:
        raise InputError(f"{path}: the first chunk of the GLB is not JSON. Export it again.")
    return Container(True, chunks[0][1], tuple(chunks[1:]), memoryview(data)[end:])


def _chunks(data: memoryview, length: int, path: Path) -> tuple[list[tuple[int, memoryview]], int]:
    chunks: list[tuple[int, memoryview]] = []
    offset = 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", data, offset)
        if offset + 8 + size > length:
            raise InputError(
                f"{path}: chunk {len(chunks)} of the GLB claims {size} bytes, and {length - offset - 8} "
                "are left. Export it again."
            )
        chunks.append((kind, data[offset + 8 : offset + 8 + size]))
        offset += 8 + size
    return chunks, offset


def padding(size: int, to: int = 4) -> int:
    """How many bytes are missing to a multiple of `to`."""
    return -size % to


def glb_pieces(
    text: bytes, binary: list[Bytes] | None, before: Container | None, path: Path
) -> list[Bytes]:
    """The bytes of a GLB, in pieces.

    text : the JSON
    binary : the content of the BIN chunk, in pieces; None for a GLB without one
    before : the container whose other chunks are kept, in their order
    Raises OutputError where it would exceed 4 GiB.
    """
    others = (
        [(kind, content) for kind, content in before.chunks if kind != BIN_CHUNK] if before else []
    )
    pieces = _chunk(JSON_CHUNK, [text], b" ")
    if binary is not None:  # it is found in the second place only
        pieces += _chunk(BIN_CHUNK, binary, b"\0")
    for kind, content in others:
        pieces += [struct.pack("<II", len(content), kind), content]
    length = 12 + sum(len(piece) for piece in pieces)
    if before:
        pieces.append(before.trailing)
    if length > MOST_BYTES:
        raise OutputError(f"{path}: a GLB cannot exceed 4 GiB. Write .gltf instead.")
    return [struct.pack("<4sII", MAGIC, 2, length), *pieces]


def _chunk(kind: int, content: list[Bytes], filler: bytes) -> list[Bytes]:
    """Header, content and padding of a chunk."""
    size = sum(len(piece) for piece in content)
    more = padding(size)
    return [struct.pack("<II", size + more, kind), *content, filler * more]

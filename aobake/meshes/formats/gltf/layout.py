"""Where the bytes of a written asset lie: within the GLB, in a file beside it, or in the JSON itself."""

from __future__ import annotations

import urllib.parse
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from aobake.errors import AobakeError, OutputError
from aobake.meshes.formats.gltf import uris
from aobake.meshes.formats.gltf.container import Bytes, padding
from aobake.meshes.formats.gltf.document import Document, open_document, side_uris
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.jsontext import JsonObject

__all__ = ["Layout", "free_name", "known_uris", "place_bytes", "plan_layout"]

Home = Literal["bin", "file", "data"]


@dataclass(frozen=True, eq=False)
class Layout:
    """How an asset is laid out in its target.

    glb : whether the target is a GLB
    home : where new bytes go: the BIN chunk, a file beside the target, or a data URI
    buffer : the number of the buffer that holds them
    before : the bytes that this buffer holds already
    """

    target: Path
    glb: bool
    home: Home
    buffer: int
    before: memoryview

    @property
    def start(self) -> int:
        """Where the new bytes begin in their buffer."""
        return len(self.before) + padding(len(self.before))


def plan_layout(document: Document, target: Path) -> Layout:
    """Decide where things go. Raises OutputError where the target cannot hold what the document has."""
    glb = target.suffix.lower() == ".glb"
    first = document.entry("buffers", 0) if document.size("buffers") else None
    binary = document.container.binary
    nothing = memoryview(b"")
    if not glb and (document.container.trailing or _other_chunks(document)):
        raise OutputError(
            f"{target}: {document.path.name} holds GLB chunks that a .gltf cannot hold. Write a .glb instead."
        )
    if first is None and glb:
        return Layout(target, glb, "bin", 0, nothing)
    if first is not None and "uri" not in first and binary is not None:
        return Layout(target, glb, "bin" if glb else "file", 0, binary)
    if first is not None and glb and not document.container.is_glb and _readable(document):
        return Layout(target, glb, "bin", 0, document.buffer(0))
    external = any(
        "uri" in buffer and not uris.is_data(buffer.text("uri"))
        for buffer in document.entries("buffers")
    )
    return Layout(target, glb, "file" if external else "data", document.size("buffers"), nothing)


def _other_chunks(document: Document) -> bool:
    binary = document.container.binary
    return any(content is not binary for _, content in document.container.chunks)


def _readable(document: Document) -> bool:
    """Whether the first buffer has bytes: the placeholder of compressed ones has none."""
    try:
        return len(document.buffer(0)) > 0
    except AobakeError:
        return False


def place_bytes(layout: Layout, edit: Edit) -> tuple[list[Bytes] | None, dict[Path, list[Bytes]]]:
    """Give the new bytes their buffer: the content of the BIN chunk (None: none), and files beside the target."""
    document = edit.document
    kept: list[Bytes] = [layout.before]
    if not edit.pieces and layout.home != "bin" and layout.buffer >= document.size("buffers"):
        return _old_binary(layout, document), {}
    content = [*kept, b"\0" * padding(len(layout.before)), *edit.pieces] if edit.pieces else kept
    size = sum(len(piece) for piece in content)
    buffers = edit.entries("buffers")
    known = layout.buffer < len(buffers)
    entry: JsonObject = dict(buffers[layout.buffer]) if known else {}
    entry.pop("uri", None)
    if edit.pieces or not known:
        entry["byteLength"] = size
    files: dict[Path, list[Bytes]] = {}
    if layout.home == "file":
        beside = free_name(layout.target, document, ".bin")
        entry = {"uri": urllib.parse.quote(beside.name), **entry}
        files[beside] = content
    elif layout.home == "data":
        entry = {"uri": uris.data_uri(b"".join(content)), **entry}
    if known:
        buffers[layout.buffer] = entry
    else:
        buffers.append(entry)
    return (content if layout.home == "bin" else _old_binary(layout, document)), files


def _old_binary(layout: Layout, document: Document) -> list[Bytes] | None:
    """A BIN chunk that stays, though no buffer stands for it."""
    binary = document.container.binary
    return [binary] if layout.glb and binary is not None and layout.buffer != 0 else None


def free_name(
    target: Path, document: Document, ending: str, taken: Collection[Path] = (), what: str = "ao"
) -> Path:
    """A name beside the target for new bytes: one that is free, or that an earlier bake took for them.

    taken : names given away already; what : the bytes are, a word in the name
    A file that the source document itself needs is never taken. Raises OutputError.
    """
    needed = {side.path.resolve() for side in document.side_files().values()}
    needed |= {
        (target.parent / urllib.parse.unquote(uri)).resolve()
        for uri in side_uris(document.json)
        if _plain(uri)
    }
    earlier = known_uris(target)
    for number in range(1, 1000):
        path = target.with_name(f"{target.stem}_{what}{number if number > 1 else ''}{ending}")
        if path in taken or path.resolve() in needed:
            continue
        if not path.exists() or urllib.parse.quote(path.name) in earlier:
            return path
    raise OutputError(f"{target}: every name for its {ending} is taken. Write it somewhere else.")


def _plain(uri: str) -> bool:
    return (
        not uris.is_data(uri) and not uris.names_host(uri) and "\0" not in uri and len(uri) < 1024
    )


def known_uris(target: Path) -> frozenset[str]:
    """URIs in the asset that stands at the target already: its side files belong to it."""
    if not target.is_file():
        return frozenset()
    try:
        return frozenset(side_uris(open_document(target, None).json))
    except AobakeError:
        return frozenset()

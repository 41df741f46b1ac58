"""An asset as one GLB in memory, with everything in it that it refers to."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from aobake.errors import InputError
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.animations import pose_of, posed_nodes
from aobake.meshes.formats.gltf.container import Bytes, glb_pieces, padding
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.jsontext import JsonObject, serialise
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.meshes.scene import Scene
from aobake.viewer.conversion import converted

__all__ = ["Packed", "packed_glb"]

SIGNATURES = (
    (b"\x89PNG", "image/png"),
    (b"\xff\xd8\xff", "image/jpeg"),
    (b"RIFF", "image/webp"),
    (b"\xabKTX", "image/ktx2"),
)
NO_IMAGE = bytes(4)  # nothing that a browser could show: the surface keeps its plain colour
KTX2 = "KHR_texture_basisu"


@dataclass(frozen=True, eq=False)
class Packed:
    """A GLB that refers to nothing outside of it, and what there is to say about it, one line each."""

    glb: bytes
    warnings: tuple[str, ...] = ()


def packed_glb(scene: Scene, pose: str | None = None) -> Packed:
    """A scene as one GLB: a glTF document as it is, everything else as a document made for it.

    pose : the moment of an animation that the scene was read at; None: the rest pose
    The glTF scene that was read is the one to be shown. An image that cannot be had is left out, with a
    warning. Raises InputError where the pose cannot be read, OutputError beyond 4 GiB.
    """
    if not isinstance(scene.source, GltfSource):
        glb, warnings = converted(scene)
        return Packed(glb, warnings)
    packing = _Packing(scene.source.document)
    packing.take_buffers()
    packing.take_images()
    packing.show(scene.source.scene)
    if pose is not None:
        packing.strike(pose)
    return Packed(packing.glb(), tuple(packing.warnings))


class _Packing:
    """A document on its way into one file: a copy of its JSON, and the content of the BIN chunk so far."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.json: JsonObject = copy.deepcopy(document.json)
        self.pieces: list[Bytes] = []
        self.size = 0
        self.placeholders: list[JsonObject] = []
        self.warnings: list[str] = []

    def take_buffers(self) -> None:
        """Put the bytes of all buffers into one, and turn what refers to them there."""
        places = [
            self._buffer(number, entry) for number, entry in enumerate(self._entries("buffers"))
        ]
        for view in self._entries("bufferViews"):
            extensions = view.get("extensions")
            compressed = extensions.values() if isinstance(extensions, dict) else ()
            for place in (view, *compressed):
                if isinstance(place, dict) and "buffer" in place:
                    _move(place, places)

    def _buffer(self, number: int, entry: JsonObject) -> tuple[int, int]:
        """Where a buffer goes: the number of its new buffer, and the byte where it begins."""
        try:
            content = self.document.buffer(number)
        except InputError:  # the placeholder of what is compressed elsewhere: nobody reads it
            self.placeholders.append({k: v for k, v in entry.items() if k != "uri"})
            return len(self.placeholders), 0
        return 0, self._add(content)

    def take_images(self) -> None:
        """Put images that lie elsewhere into the file."""
        for number, image in enumerate(self._entries("images")):
            uri = image.pop("uri", None)
            if isinstance(uri, str):
                content = self._fetched(uri, self.document.label("images", number))
                kinds = (kind for begin, kind in SIGNATURES if content.startswith(begin))
                image["mimeType"] = next(kinds, image.get("mimeType", "image/png"))
                image["bufferView"] = self._view(content)
        if any(KTX2 in str(texture.get("extensions")) for texture in self._entries("textures")):
            self.warnings.append(
                f"{self.document.path}: textures in KTX2 are not shown. Use PNG, JPEG or WebP."
            )

    def _fetched(self, uri: str, label: str) -> bytes:
        try:
            return self.document.fetch(uri, f"{self.document.path}: {label}")
        except InputError as error:
            self.warnings.append(str(error))
            return NO_IMAGE

    def show(self, scene: int | None) -> None:
        """Have the file show one of its scenes; one of all nodes where it has none."""
        if scene is None:
            nodes = self._entries("nodes")
            below = {child for node in nodes for child in cast(list[int], node.get("children", []))}
            roots = [number for number in range(len(nodes)) if number not in below]
            self.json["scenes"], scene = [{"nodes": roots}], 0
        self.json["scene"] = scene

    def strike(self, pose: str) -> None:
        """Put the nodes that a clip moves where they are at a moment."""
        nodes = self._entries("nodes")
        for number, node in posed_nodes(AccessorReader(self.document), pose_of(pose)).nodes.items():
            nodes[number] = node.value

    def glb(self) -> bytes:
        """The file."""
        if self.size:
            self.json["buffers"] = [{"byteLength": self.size}, *self.placeholders]
        pieces = glb_pieces(serialise(self.json), self.pieces, None, self.document.path)
        return b"".join(pieces)

    def _entries(self, name: str) -> list[JsonObject]:
        return cast(list[JsonObject], self.json.get(name, []))

    def _add(self, content: Bytes) -> int:
        begin = self.size
        filler = padding(len(content), 8)  # what a view inside was aligned to, it stays aligned to
        self.pieces += [content, bytes(filler)]
        self.size += len(content) + filler
        return begin

    def _view(self, content: bytes) -> int:
        view = {"buffer": 0, "byteOffset": self._add(content), "byteLength": len(content)}
        self.json["bufferViews"] = [*self._entries("bufferViews"), view]
        return len(self._entries("bufferViews")) - 1


def _move(view: JsonObject, places: Sequence[tuple[int, int]]) -> None:
    """Turn a view, or the compressed one within it, to where its buffer has gone."""
    buffer, begin = places[cast(int, view["buffer"])]
    view["buffer"] = buffer
    view["byteOffset"] = cast(int, view.get("byteOffset", 0)) + begin

"""Small glTF files, made piece by piece."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.images import decode
from aobake.meshes.formats import gltf
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.document import open_document
from aobake.meshes.scene import Scene
from aobake.settings import Store, StoreSettings

Json = dict[str, Any]
KINDS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
SQUARE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
UV = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]  # of its corners
TWO_TRIANGLES = [0, 1, 2, 0, 2, 3]
JSON_CHUNK, BIN_CHUNK = 0x4E4F534A, 0x004E4942


class Builder:
    """A document under construction; `json` may be changed at will."""

    def __init__(self) -> None:
        self.json: Json = {"asset": {"version": "2.0", "generator": "by hand"}}
        self.data = bytearray()

    def put(self, name: str, entry: Json) -> int:
        """An entry at the end of a list; its number."""
        self.json.setdefault(name, []).append(entry)
        return len(self.json[name]) - 1

    def view(self, data: bytes, **more: Any) -> int:
        """A buffer view of its own."""
        self.data += b"\0" * (-len(self.data) % 4)
        start = len(self.data)
        self.data += data
        return self.put(
            "bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data), **more}
        )

    def accessor(self, values: ArrayLike, dtype: str = "f4", **more: Any) -> int:
        """An accessor of its own, (N,) or (N, k)."""
        array: NDArray[Any] = np.asarray(values, "<" + dtype)
        rows = array.reshape(len(array), -1)
        entry = {"componentType": KINDS[dtype], "count": len(rows), "type": TYPES[rows.shape[1]]}
        return self.put("accessors", {"bufferView": self.view(rows.tobytes()), **entry, **more})

    def primitive(
        self, positions: ArrayLike = SQUARE, indices: ArrayLike | None = TWO_TRIANGLES, **more: Any
    ) -> Json:
        """A primitive; further attributes by name, as numbers of accessors."""
        attributes = {"POSITION": self.accessor(positions), **more.pop("attributes", {})}
        found: Json = {"attributes": attributes, **more}
        if indices is not None:
            found["indices"] = self.accessor(indices, "u2")
        return found

    def mesh(self, *primitives: Json, **more: Any) -> int:
        """A mesh; of one square if no primitives are given."""
        return self.put("meshes", {"primitives": list(primitives) or [self.primitive()], **more})

    def node(self, **entry: Any) -> int:
        """A node."""
        return self.put("nodes", entry)

    def show(self, *nodes: int) -> Builder:
        """A scene of these nodes."""
        self.put("scenes", {"nodes": list(nodes)})
        self.json.setdefault("scene", 0)
        return self

    def with_buffer(self, **entry: Any) -> Json:
        """The JSON with its buffer filled in."""
        if not self.data:
            return self.json
        others = self.json.get("buffers", [])[1:]
        return {**self.json, "buffers": [{"byteLength": len(self.data), **entry}, *others]}

    def glb(self, path: Path, *more: tuple[int, bytes], **entry: Any) -> Path:
        """Write a GLB, with further chunks."""
        path.write_bytes(pack_glb(self.with_buffer(**entry), bytes(self.data), *more))
        return path

    def gltf(self, path: Path, *, embed: bool = False, uri: str | None = None) -> Path:
        """Write a .gltf with its buffer as a data URI, or in a file beside it."""
        name = uri or f"{path.stem}.bin"
        if embed:
            name = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        elif uri is None:
            path.with_name(name).write_bytes(self.data)
        path.write_text(json.dumps(self.with_buffer(uri=name)), encoding="utf-8")
        return path


def square_builder(**node: Any) -> Builder:
    """One square in one node."""
    builder = Builder()
    return builder.show(builder.node(mesh=builder.mesh(name="square"), **node))


def mapped(material: Json | None = None, **more: Any) -> Builder:
    """A square with TEXCOORD_0, of one material."""
    builder = Builder()
    uv = builder.accessor(UV)
    if material is not None:
        builder.put("materials", material)
        more["material"] = 0
    part = builder.primitive(attributes={"TEXCOORD_0": uv}, **more)
    return builder.show(builder.node(mesh=builder.mesh(part, name="square")))


def pack_glb(document: Json, data: bytes | None = None, *more: tuple[int, bytes]) -> bytes:
    """A GLB of this JSON, this BIN chunk and further chunks."""
    text = json.dumps(document).encode()
    chunks = [(JSON_CHUNK, text + b" " * (-len(text) % 4))]
    if data:
        chunks.append((BIN_CHUNK, data + b"\0" * (-len(data) % 4)))
    body = b"".join(struct.pack("<II", len(c), kind) + c for kind, c in (*chunks, *more))
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def unpack_glb(file: Path | bytes) -> tuple[Json, bytes, list[tuple[int, bytes]]]:
    """JSON, BIN and the other chunks of a GLB; checks the lengths and the alignment of what it must align."""
    data = file if isinstance(file, bytes) else file.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version) == (b"glTF", 2)
    chunks, at = [], 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        assert at + 8 + size <= length
        chunks.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    assert at == length
    assert all(len(c) % 4 == 0 for kind, c in chunks if kind in (JSON_CHUNK, BIN_CHUNK))
    binary = next((c for kind, c in chunks[1:2] if kind == BIN_CHUNK), b"")
    others = [(kind, c) for kind, c in chunks[1:] if kind != BIN_CHUNK]
    return json.loads(chunks[0][1]), binary, others


def load(path: Path, root: Path | None = None, scene: str | None = None) -> Scene:
    """Read a file."""
    return gltf.read(path, root=root, scene=scene)


def ramp(scene: Scene) -> list[NDArray[np.float32]]:
    """Values that differ at every vertex of every instance."""
    rng = np.random.default_rng(7)
    return [rng.random(len(mesh.vertices), np.float32) for _, mesh in scene.placed()]


def constant(*values: float) -> list[NDArray[np.float32]]:
    """One value for all vertices of each instance, which is a square."""
    return [np.full(4, value, np.float32) for value in values]


def bake(
    source: Path,
    target: Path,
    store: Store = "color",
    ao: list[NDArray[np.float32]] | None = None,
    **options: Any,
) -> Scene:
    """Read a file, write it with these values (a ramp for None), and give the scene that was read."""
    scene = load(source, **options)
    gltf.write(scene, ramp(scene) if ao is None else ao, target, StoreSettings(store=store))
    return scene


def attribute(path: Path, name: str, mesh: int = 0, primitive: int = 0) -> NDArray[Any]:
    """Stored values of an attribute, (V, k)."""
    document = open_document(path, None)
    part = document.entry("meshes", mesh).children("primitives", "primitive")[primitive]
    number = part.needed("attributes").integer(name)
    return AccessorReader(document).values(number, ("SCALAR", "VEC2", "VEC3", "VEC4"))


def textures_of(path: Path) -> dict[str, np.ndarray]:
    """Decoded image of every texture that a material of a GLB names, by 'number key'."""
    document, binary, _ = unpack_glb(path)
    found = {}
    for number, material in enumerate(document.get("materials", [])):
        named = {**material, **material.get("pbrMetallicRoughness", {})}
        for key in ("occlusionTexture", "metallicRoughnessTexture"):
            if key in named:
                image = document["images"][document["textures"][named[key]["index"]]["source"]]
                view = document["bufferViews"][image["bufferView"]]
                start = view.get("byteOffset", 0)
                data = binary[start : start + view["byteLength"]]
                found[f"{number} {key}"] = decode(data, key)
    return found

"""A glTF document, whole: the JSON as parsed, every chunk, and the bytes behind every buffer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from aobake.errors import InputError, nearest
from aobake.files import read_bytes
from aobake.meshes.formats.gltf import uris
from aobake.meshes.formats.gltf.container import Container, open_container
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.jsontext import JsonObject, JsonText, parse

__all__ = ["KINDS", "Document", "open_document", "side_uris"]

# The lists of a glTF file, and what one entry is called.
KINDS = {
    "accessors": "accessor",
    "animations": "animation",
    "buffers": "buffer",
    "bufferViews": "buffer view",
    "cameras": "camera",
    "images": "image",
    "materials": "material",
    "meshes": "mesh",
    "nodes": "node",
    "samplers": "sampler",
    "scenes": "scene",
    "skins": "skin",
    "textures": "texture",
}


@dataclass(frozen=True, eq=False)
class Document:
    """A glTF file as it was found. Nothing in it is ever changed.

    path : the file
    root : a folder whose files may be read as well; None: that of the file alone
    layout : how the JSON text was laid out
    buffers_read : the bytes of buffers that were asked for, so that each is fetched once
    """

    path: Path
    root: Path | None
    container: Container
    json: JsonObject
    layout: JsonText
    buffers_read: dict[int, memoryview] = field(default_factory=dict, repr=False)

    @property
    def top(self) -> Element:
        """The outermost object."""
        return Element(self.json, str(self.path))

    def size(self, name: str) -> int:
        """How many entries a list of KINDS has."""
        return len(self.top.list_of(name))

    def entry(self, name: str, number: int) -> Element:
        """One entry of a list of KINDS. Raises InputError where there is none."""
        entries = self.top.list_of(name)
        if not 0 <= number < len(entries):
            raise InputError(
                f"{self.path}: {KINDS[name]} {number} is asked for, and the file has {len(entries)}."
            )
        value = entries[number]
        if not isinstance(value, dict):
            raise InputError(f"{self.path}: {KINDS[name]} {number} is no object. Export it again.")
        return Element(value, f"{self.path}: {self.label(name, number)}")

    def entries(self, name: str) -> Iterator[Element]:
        """Every entry of a list of KINDS."""
        for number in range(self.size(name)):
            yield self.entry(name, number)

    def find(self, name: str, asked: str) -> int:
        """The entry of a list of KINDS with a name, or else with a number. Raises InputError."""
        names = [entry.name for entry in self.entries(name)]
        if asked in names:
            return names.index(asked)
        if asked.isdecimal() and int(asked) < len(names):
            return int(asked)
        known = [*filter(None, names), *map(str, range(len(names)))]
        found = nearest(asked, known) if known else " It has none."
        raise InputError(f"{self.path}: there is no {KINDS[name]} {asked!r}.{found}")

    def label(self, name: str, number: int) -> str:
        """'mesh 3 "wheel"'."""
        value = self.top.list_of(name)[number]
        title = value.get("name") if isinstance(value, dict) else None
        named = f' "{title}"' if isinstance(title, str) and title.isprintable() and title else ""
        return f"{KINDS[name]} {number}{named}"

    def buffer(self, number: int) -> memoryview:
        """The bytes of a buffer. Raises InputError where they are missing, broken or elsewhere."""
        if number not in self.buffers_read:
            entry = self.entry("buffers", number)
            data = self._buffer(number, entry)
            length = entry.integer("byteLength")
            if length > len(data):
                raise InputError(
                    f"{entry.where} claims {length} bytes, and there are {len(data)}. Export it again."
                )
            self.buffers_read[number] = data[:length]
        return self.buffers_read[number]

    def _buffer(self, number: int, entry: Element) -> memoryview:
        if "uri" in entry:
            return memoryview(self.fetch(entry.text("uri"), entry.where))
        binary = self.container.binary
        if number != 0 or binary is None:
            raise InputError(
                f"{entry.where} has no bytes: neither a uri nor a BIN chunk. Export it again."
            )
        return binary

    def view(self, view: Element) -> memoryview:
        """The bytes that {buffer, byteOffset, byteLength} stands for. Raises InputError."""
        number = view.index("buffer", self.size("buffers"), "buffers")
        data = self.buffer(number)
        start, length = view.integer("byteOffset", 0), view.integer("byteLength")
        if start + length > len(data):
            raise InputError(
                f"{view.where} ends at byte {start + length} of buffer {number}, which has {len(data)}. "
                "Export it again."
            )
        return data[start : start + length]

    def fetch(self, uri: str, where: str) -> bytes:
        """The bytes of a data URI or of a side file. Raises InputError."""
        if uris.is_data(uri):
            return uris.data_bytes(uri, where)
        if uris.names_host(uri):
            raise InputError(
                f"{where} lies elsewhere ({uri[:60]!r}), and nothing is fetched. "
                "Put the file beside the asset, and name it relatively."
            )
        found = uris.find(uri, self.path.parent, self.root)
        if found is None:
            raise InputError(f"{where}: {uri[:60]!r} is no file name. Give it another one.")
        if not found.inside:
            raise InputError(
                f"{where}: {uri[:60]!r} leaves the folder of the asset. "
                "Allow the folder that holds both (--root FOLDER)."
            )
        return read_bytes(found.path, needed_by=where)

    def side_files(self) -> dict[str, uris.SideFile]:
        """URI -> file, of every file that the document refers to, that exists and that may be read."""
        found: dict[str, uris.SideFile] = {}
        for uri in side_uris(self.json):
            if not uris.is_data(uri) and not uris.names_host(uri):
                side = uris.find(uri, self.path.parent, self.root)
                if side is not None and side.inside and side.exists:
                    found[uri] = side
        return found


def side_uris(value: object) -> list[str]:
    """Every string under a key `uri`, at any depth, extensions included; each once, in order."""
    found: dict[str, None] = {}
    waiting = [value]
    while waiting:
        item = waiting.pop()
        if isinstance(item, dict):
            uri = item.get("uri")
            if isinstance(uri, str):
                found[uri] = None
            waiting += [inner for inner in item.values() if isinstance(inner, dict | list)]
        elif isinstance(item, list):
            waiting += [inner for inner in item if isinstance(inner, dict | list)]
    return list(found)


def open_document(path: Path, root: Path | None) -> Document:
    """Read a glTF or GLB file. Raises InputError where it is none."""
    container = open_container(read_bytes(path), path)
    text = bytes(container.text)
    document = Document(path, root, container, parse(text, str(path)), JsonText(text))
    asset = document.top.needed("asset")
    version = asset.text("version")
    if version.partition(".")[0] != "2":
        raise InputError(f"{path}: this is glTF {version}; 2.0 is needed. Convert it to glTF 2.0.")
    for name, kind in KINDS.items():
        document.top.children(name, kind)  # lists of objects from here on
    return document

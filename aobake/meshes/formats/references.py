"""Which files an asset refers to, told from its text alone: for what must be fetched before it can be read."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from aobake.errors import InputError
from aobake.files import read_bytes

__all__ = ["references"]

LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+([^\r\n]+)", re.MULTILINE)
DRIVE = re.compile(r"[A-Za-z]:")


def references(path: Path) -> tuple[str, ...]:
    """The files that an asset refers to, whether or not they are there: names relative to its folder.

    A name that can be read in several ways is given in each. Names inside of files that are not there (the
    textures of an OBJ's material library, say) come out once they are: ask again then.
    Absolute names, and those of other hosts, are left out, as they are never followed; names that lead out of
    the folder are not. Empty for what refers to nothing, and for what cannot be read.
    """
    find = FAMILIES.get(path.suffix.lower())
    try:
        names = () if find is None else find(path)
        return tuple(dict.fromkeys(_relative(names)))
    except (InputError, OSError):  # the reader will say it better
        return ()


def _gltf(path: Path) -> Iterator[str]:
    from aobake.meshes.formats.gltf import uris
    from aobake.meshes.formats.gltf.container import open_container
    from aobake.meshes.formats.gltf.document import side_uris
    from aobake.meshes.formats.gltf.jsontext import parse

    text = bytes(open_container(read_bytes(path), path).text)
    for uri in side_uris(parse(text, str(path))):
        if not uris.is_data(uri) and not uris.names_host(uri):
            yield from uris.spellings(uri)


def _obj(path: Path) -> Iterator[str]:
    from aobake.meshes.formats.obj.materials import MOST_LIBRARY_BYTES, library_names, texture_names

    for statement in LIBRARY.findall(read_bytes(path)):
        for name in _relative(library_names(statement)):
            yield name
            library = path.parent / name
            if _is_file(library) and library.stat().st_size <= MOST_LIBRARY_BYTES:
                for texture in texture_names(read_bytes(library)):
                    yield from (texture, texture.replace("\\", "/"))


def _usd(path: Path) -> Iterator[str]:
    from aobake.meshes.formats.usd import available

    if not available():
        return
    from aobake.meshes.formats.usd.stage import layer_names

    known, waiting = {"": None}, [""]
    while waiting:
        name = waiting.pop()
        layer = path.parent / name if name else path
        if not _is_file(layer):
            continue
        for below in _relative(layer_names(layer)):
            full = posixpath.normpath(posixpath.join(posixpath.dirname(name), below))
            if full not in known:
                known[full] = None
                waiting.append(full)
                yield full


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name that the system cannot hold
        return False


def _relative(names: Iterable[str]) -> Iterator[str]:
    """Names that say how to get there from here, each in its shortest form."""
    for name in names:
        if name and not name.startswith(("/", "\\")) and not DRIVE.match(name) and "\0" not in name:
            yield posixpath.normpath(name)


FAMILIES: Mapping[str, Callable[[Path], Iterator[str]]] = {
    ".gltf": _gltf,
    ".glb": _gltf,
    ".obj": _obj,
    **dict.fromkeys((".usd", ".usda", ".usdc"), _usd),
}

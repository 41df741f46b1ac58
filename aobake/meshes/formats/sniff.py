"""What a file is by its first bytes, so that a wrong name gives one clear line."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from aobake.errors import InputError
from aobake.files import read_bytes

__all__ = ["HEAD_BYTES", "Kind", "known_kind", "refuse_wrong_name"]

HEAD_BYTES = 4096


@dataclass(frozen=True)
class Kind:
    """A kind of file that its first bytes give away.

    name : with its article     suffixes : what it may be called, the usual one first
    cure : what helps, where that is not to rename it
    """

    name: str
    suffixes: tuple[str, ...]
    matches: Callable[[bytes], object]
    cure: str = ""


def _begins(magic: bytes) -> Callable[[bytes], object]:
    return lambda head: head.startswith(magic)


IMAGE = "Give the asset itself."
KINDS = (
    Kind("a GLB file", (".glb",), _begins(b"glTF")),
    Kind("a PLY file", (".ply",), re.compile(rb"ply\s*[\r\n]").match),
    Kind("an FBX file", (".fbx",), _begins(b"Kaydara FBX Binary")),
    Kind("a Blender file", (".blend",), _begins(b"BLENDER")),
    Kind("a USD file", (".usdc", ".usd"), _begins(b"PXR-USDC")),
    Kind("a USD file", (".usda", ".usd"), _begins(b"#usda ")),
    Kind(
        "a glTF file",
        (".gltf",),
        re.compile(rb'(\xef\xbb\xbf)?\s*\{.*"asset"\s*:', re.DOTALL).match,
    ),
    Kind(
        "a DAE file",
        (".dae",),
        re.compile(rb"(\xef\xbb\xbf)?\s*<.*<COLLADA\b|\s*<COLLADA\b", re.DOTALL).match,
    ),
    Kind("an STL file", (".stl",), re.compile(rb"\s*solid\b.*\bfacet\s+normal\b", re.DOTALL).match),
    Kind("an OFF file", (".off",), re.compile(rb"\s*C?OFF\s").match),
    Kind("a ZIP archive", (".3mf", ".usdz"), _begins(b"PK\x03\x04")),
    Kind("a gzip archive", (), _begins(b"\x1f\x8b"), "Unpack it first."),
    Kind("a PNG image", (), _begins(b"\x89PNG"), IMAGE),
    Kind("a JPEG image", (), _begins(b"\xff\xd8\xff"), IMAGE),
    Kind("a PDF document", (), _begins(b"%PDF-"), IMAGE),
    Kind(
        "a web page",
        (),
        re.compile(rb"\s*<(!doctype html|html)", re.IGNORECASE).match,
        "Download it again.",
    ),
    Kind("a Git LFS pointer", (), _begins(b"version https://git-lfs"), "Fetch it (git lfs pull)."),
)
MAGIC = {".glb": b"glTF", ".ply": b"ply", ".3mf": b"PK\x03\x04"}
TEXT = (".obj", ".gltf", ".dae", ".off")


def known_kind(head: bytes) -> Kind | None:
    """What a file is, where its first HEAD_BYTES bytes leave no doubt; else None."""
    return next((kind for kind in KINDS if kind.matches(head)), None)


def refuse_wrong_name(path: Path) -> None:
    """Raise InputError where a file is empty, missing, or by its content another kind than its name says."""
    head = _head(path)
    suffix = path.suffix.lower()
    wanted = suffix[1:].upper() if suffix else "an asset"
    if not head:
        raise InputError(f"{path}: the file is empty. Export it again.")
    kind = known_kind(head)
    if kind is not None and suffix not in kind.suffixes:
        cure = kind.cure or f"Rename it to {path.stem}{kind.suffixes[0]}."
        raise InputError(f"{path}: by its content this is {kind.name}, not {wanted}. {cure}")
    if suffix in MAGIC and not head.startswith(MAGIC[suffix]):
        found = "binary data of another kind" if b"\0" in head else "text of another kind"
        raise InputError(
            f"{path}: by its content this is {found}, not {wanted}. Give the right file."
        )
    if suffix in TEXT and b"\0" in head:
        raise InputError(
            f"{path}: by its content this is binary data, not {wanted}. Give the right file."
        )


def _head(path: Path) -> bytes:
    try:
        if path.is_file():
            with path.open("rb") as stream:
                return stream.read(HEAD_BYTES)
    except (OSError, ValueError):
        pass
    return read_bytes(path)[:HEAD_BYTES]  # says in one line why there is no such file

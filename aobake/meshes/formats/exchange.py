"""STL, OFF, 3MF and DAE, read by trimesh. They cannot hold ambient occlusion, and are never written."""

from __future__ import annotations

import importlib.util
import io
import re
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from aobake.errors import InputError
from aobake.files import read_bytes
from aobake.meshes.scene import Scene

__all__ = ["ExchangeSource", "read"]

NEEDS = {".3mf": ("lxml", "networkx"), ".dae": ("collada", "lxml")}
PACKAGES = {"collada": "pycollada"}  # where the package to install is named otherwise
MOST_UNPACKED_BYTES = (
    1 << 29
)  # a 3MF of this size holds ten million triangles; trimesh takes three times that


@dataclass(frozen=True, eq=False, kw_only=True)
class ExchangeSource:
    """A file of a format that trimesh reads, as it was found."""

    path: Path
    format: str
    found: Mapping[str, object]

    @property
    def files(self) -> tuple[Path, ...]:
        """The file alone: no texture or other side file is opened."""
        return (self.path,)

    def facts(self) -> Mapping[str, object]:
        """What is in the file, for people."""
        return self.found


def read(path: Path, *, root: Path | None, scene: str | None) -> Scene:  # noqa: ARG001 - Reader
    """The scene in an STL, OFF, 3MF or DAE file, its vertices as they are in the file.

    root : not used, for no other file is opened
    scene : not None is refused, for there is one alone
    Parts that stand in several places stay instances of one mesh.
    Raises InputError for what trimesh cannot read, and where it needs a package that is not installed.
    """
    kind = path.suffix.lower()
    if scene is not None:
        raise InputError(
            f"{path}: it holds one scene, and scene {scene!r} was asked for. Leave it out."
        )
    _refuse_missing_packages(path, kind)
    data = read_bytes(path)
    if kind == ".3mf":
        _refuse_bomb(path, data)
    if kind == ".dae" and re.search(rb"<!(DOCTYPE|ENTITY)", data):
        raise InputError(
            f"{path}: it declares XML entities, which could name other files. Remove the DOCTYPE."
        )
    found = _loaded(path, kind, data)
    source = ExchangeSource(path=path, format=kind[1:].upper(), found=_facts(found, kind, data))
    return replace(found, source=source)


def _loaded(path: Path, kind: str, data: bytes) -> Scene:
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # trimesh's own deprecations are not the user's
            # A resolver of its own, and empty: without one trimesh looks for side files by itself.
            loaded = trimesh.load_scene(
                io.BytesIO(data),
                file_type=kind[1:],
                resolver=trimesh.resolvers.ZipResolver({}),
                process=False,
            )
            return Scene.from_trimesh(loaded)
    except MemoryError as error:
        raise InputError(f"{path}: it does not fit into memory.") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except Exception as error:
        # Whatever trimesh and its parsers raise, it is this file that they cannot read.
        finding = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(
            f"{path}: it cannot be read as {kind[1:].upper()} ({finding}). Export it again, best as GLB."
        ) from error


def _refuse_missing_packages(path: Path, kind: str) -> None:
    missing = [name for name in NEEDS.get(kind, ()) if importlib.util.find_spec(name) is None]
    if missing:
        names = " and ".join(PACKAGES.get(name, name) for name in missing)
        raise InputError(
            f"{path}: reading {kind[1:].upper()} needs {names}, not installed here. "
            'Install the extra: pip install "aobake[formats]".'
        )


def _refuse_bomb(path: Path, data: bytes) -> None:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(info.file_size for info in archive.infolist())
    except (zipfile.BadZipFile, NotImplementedError, OSError, ValueError) as error:
        raise InputError(
            f"{path}: it is no whole ZIP archive, as 3MF must be ({error}). Export it again."
        ) from error
    if size > MOST_UNPACKED_BYTES:
        raise InputError(
            f"{path}: it unpacks to {size} bytes, and at most {MOST_UNPACKED_BYTES} are read. "
            "Convert it to GLB, or split it."
        )


def _facts(scene: Scene, kind: str, data: bytes) -> Mapping[str, object]:
    binary = b"\0" in data[:1024]
    return {
        "meshes": [mesh.name for mesh in scene.meshes],
        "instances": len(scene.instances),
        "vertices": scene.vertices,
        "triangles": scene.triangles,
        "encoding": {".3mf": "zip", ".dae": "xml"}.get(kind, "binary" if binary else "text"),
        "a bake touches": "nothing: write GLB or PLY (-o NAME.glb)",
        "problems": [],
    }

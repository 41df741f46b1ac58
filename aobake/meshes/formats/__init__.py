"""Files of every format: one reader and one writer each, behind `load` and `write_vertex_ao`.

A format is known by its file name; a file whose content is unmistakably another kind is refused with a
line that says which. The modules are imported when a file asks for them, so that a glTF bake never
pays for trimesh.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError, OutputError, nearest
from aobake.meshes.formats.sniff import refuse_wrong_name
from aobake.meshes.scene import Scene
from aobake.settings import StoreSettings

__all__ = ["READABLE", "WRITABLE", "check_target", "load", "write_vertex_ao"]


class Reader(Protocol):
    """What a format module offers when it can read."""

    def read(self, path: Path, *, root: Path | None, scene: str | None) -> Scene:
        """The scene in a file. Raises InputError."""


class Writer(Protocol):
    """What a format module offers when it can hold ambient occlusion."""

    def check(self, scene: Scene, store: StoreSettings, target: Path) -> tuple[str, ...]:
        """Raise OutputError now for what write would refuse, before a long bake.

        Returns what the user should know about the result, one line each.
        """

    def write(
        self, scene: Scene, ao: Sequence[NDArray[np.float32]], target: Path, store: StoreSettings
    ) -> tuple[Path, ...]:
        """Write the asset with ambient occlusion; the files written, the target first. Raises OutputError.

        Patches the document of scene.source where that is of this format, and makes a new one else.
        """


@dataclass(frozen=True)
class Family:
    """Formats that one module reads."""

    module: str
    reads: tuple[str, ...]
    writes: tuple[str, ...] = ()
    cure: str = ""


FAMILIES = (
    Family("gltf", reads=(".glb", ".gltf"), writes=(".glb", ".gltf")),
    Family("obj", reads=(".obj",), writes=(".obj",)),
    Family("ply", reads=(".ply",), writes=(".ply",)),
    Family("usd", reads=(".usd", ".usda", ".usdc", ".usdz"), writes=(".usda", ".usd", ".usdc")),
    Family("exchange", reads=(".stl", ".off", ".3mf", ".dae")),
)
READABLE = tuple(suffix for family in FAMILIES for suffix in family.reads)
WRITABLE = tuple(suffix for family in FAMILIES for suffix in family.writes)
REFUSED = {
    ".fbx": "no maintained reader of FBX exists. Export it as GLB, for example from Blender.",
    ".blend": "this is Blender's own format. Export it as GLB from Blender.",
}


def load(path: str | Path, *, root: str | Path | None = None, scene: str | None = None) -> Scene:
    """Read an asset.

    path : a file of a format in READABLE
    root : the folder that side files may lie in, with its subfolders; None: the asset's own folder
    scene : name or number of the glTF scene to take; None: the file's default scene
    Returns the scene, with the source document kept whole for writing.
    Raises InputError where the file is missing, broken, of an unknown format, or holds no triangles.
    """
    path = Path(path)
    refuse_wrong_name(path)
    family = _family_of_file(path)
    reader = cast(Reader, _module(family))
    found = reader.read(path, root=None if root is None else Path(root), scene=scene)
    if found.triangles == 0:
        raise InputError(f"{path}: there is no triangle in it, so there is nothing to bake.")
    return found


def check_target(scene: Scene, target: Path, store: StoreSettings) -> tuple[str, ...]:
    """Raise OutputError now where write_vertex_ao would refuse the target, before a long bake.

    Returns what the user should know about the result, one line each.
    """
    return _writer(scene, target).check(scene, store, target)


def write_vertex_ao(
    scene: Scene, ao: Sequence[NDArray[np.float32]], target: Path, store: StoreSettings
) -> tuple[Path, ...]:
    """Write the scene's asset with ambient occlusion at its vertices; the files written, the target first.

    ao : one (V_i,) float32 array per instance of the scene, in its order
    Raises OutputError where the format cannot hold it or the file cannot be written.
    """
    return _writer(scene, target).write(scene, ao, target, store)


def _writer(scene: Scene, target: Path) -> Writer:
    suffix = target.suffix.lower()
    for family in FAMILIES:
        if suffix in family.writes:
            return cast(Writer, _module(family))
    if suffix == ".usdz":
        raise OutputError(
            f"{target}: a package is not written; the result is a layer over the file. "
            "Write that instead (-o NAME.usda), and pack it with usdzip where a package is needed."
        )
    was = f" {scene.source.path.name} was read as {scene.source.format}." if scene.source else ""
    if suffix in READABLE or suffix in REFUSED:
        raise OutputError(
            f"{target}: {suffix[1:].upper()} cannot hold ambient occlusion.{was} "
            "Write GLB or PLY instead (-o NAME.glb)."
        )
    raise OutputError(
        f"{target}: {suffix or 'a name without an ending'} is no format that can be written.{was}"
        f"{nearest(suffix, WRITABLE)}"
    )


def _family_of_file(path: Path) -> Family:
    suffix = path.suffix.lower()
    if suffix in REFUSED:
        raise InputError(f"{path}: {REFUSED[suffix]}")
    for family in FAMILIES:
        if suffix in family.reads:
            return family
    raise InputError(
        f"{path}: {suffix or 'a name without an ending'} is no known format.{nearest(suffix, READABLE)}"
    )


def _module(family: Family) -> object:
    return importlib.import_module(f"{__name__}.{family.module}")

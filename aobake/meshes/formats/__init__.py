"""Files of every format: one reader and one writer each, behind `load` and `write_vertex_ao`.

A format is known by its file name; a file whose content is unmistakably another kind is refused with a
line that says which. The modules are imported when a file asks for them, so that a glTF bake never
pays for trimesh.
"""

from __future__ import annotations

import importlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError, OutputError, nearest
from aobake.meshes.formats.sniff import refuse_wrong_name
from aobake.meshes.lightmap import Lightmap
from aobake.meshes.scene import Scene
from aobake.settings import Further, ImageSettings, StoreSettings

__all__ = [
    "IMAGES",
    "READABLE",
    "TEXTURE_WRITABLE",
    "WRITABLE",
    "check_target",
    "check_texture_target",
    "load",
    "write_texture_ao",
    "write_vertex_ao",
]


class Reader(Protocol):
    """What a format module offers when it can read."""

    def read(self, path: Path, *, root: Path | None, scene: str | None) -> Scene:
        """The scene in a file. Raises InputError."""


class PoseReader(Protocol):
    """What a format module offers when it can read an asset at a moment of an animation."""

    def read(self, path: Path, *, root: Path | None, scene: str | None, pose: str) -> Scene:
        """The scene in a file. Raises InputError, and SettingsError for what is no pose."""


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


class FurtherWriter(Protocol):
    """What a format module offers when it can hold more than ambient occlusion."""

    def write(
        self,
        scene: Scene,
        ao: Sequence[NDArray[np.float32]],
        target: Path,
        store: StoreSettings,
        further: Mapping[Further, Sequence[NDArray[np.float32]]],
    ) -> tuple[Path, ...]:
        """The same with more: some of what Family.further names, see write_vertex_ao."""


class TextureWriter(Protocol):
    """What a format module offers when it can hold a lightmap."""

    def check_texture(
        self, scene: Scene, image: ImageSettings, target: Path, lightmap: Lightmap | None = None
    ) -> tuple[str, ...]:
        """Raise OutputError now for what write_texture would refuse, before a long bake.

        lightmap : None before there is one; with it, what its layout brings with it is said as well
        Returns what the user should know about the result, one line each.
        """

    def write_texture(
        self, scene: Scene, lightmap: Lightmap, target: Path, image: ImageSettings
    ) -> tuple[Path, ...]:
        """Write the asset with its lightmap; the files written, the target first. Raises OutputError.

        Patches the document of scene.source where that is of this format, and makes a new one else.
        """


@dataclass(frozen=True)
class Family:
    """Formats that one module reads.

    poses : whether it reads animations; further : what it can hold at vertices besides ambient occlusion
    """

    module: str
    reads: tuple[str, ...]
    writes: tuple[str, ...] = ()
    holds_textures: tuple[str, ...] = ()
    poses: bool = False
    further: tuple[Further, ...] = ()


FAMILIES = (
    Family(
        "gltf",
        reads=(".glb", ".gltf"),
        writes=(".glb", ".gltf"),
        holds_textures=(".glb", ".gltf"),
        poses=True,
        further=("bent_normals", "mean_distance"),
    ),
    Family("obj", reads=(".obj",), writes=(".obj",), holds_textures=(".obj",)),
    Family("ply", reads=(".ply",), writes=(".ply",), further=("mean_distance",)),
    Family("usd", reads=(".usd", ".usda", ".usdc", ".usdz"), writes=(".usda", ".usd", ".usdc")),
    Family("exchange", reads=(".stl", ".off", ".3mf", ".dae")),
)
READABLE = tuple(suffix for family in FAMILIES for suffix in family.reads)
WRITABLE = tuple(suffix for family in FAMILIES for suffix in family.writes)
TEXTURE_WRITABLE = tuple(suffix for family in FAMILIES for suffix in family.holds_textures)
IMAGES = (".png", ".exr", ".tif", ".tiff")
REFUSED = {
    ".fbx": "no maintained reader of FBX exists. Export it as GLB, for example from Blender.",
    ".blend": "this is Blender's own format. Export it as GLB from Blender.",
}


def load(
    path: str | Path,
    *,
    root: str | Path | None = None,
    scene: str | None = None,
    pose: str | None = None,
) -> Scene:
    """Read an asset.

    path : a file of a format in READABLE
    root : the folder that side files may lie in, with its subfolders; None: the asset's own folder
    scene : name or number of the glTF scene to take; None: the file's default scene
    pose : the moment of a glTF animation to take, as CLIP@SECONDS, the clip by name or number; None: as
        the file has it without any animation, which is the rest pose of what is skinned
    Returns the scene, with the source document kept whole for writing: a pose changes nothing in it.
    Raises InputError where the file is missing, broken, of an unknown format, or holds no triangles, and
    where it has no such scene, clip or moment; SettingsError for a pose that is not CLIP@SECONDS.
    """
    path = Path(path)
    refuse_wrong_name(path)
    family = _family_of_file(path)
    root = None if root is None else Path(root)
    if pose is None:
        found = cast(Reader, _module(family.module)).read(path, root=root, scene=scene)
    elif family.poses:
        posing = cast(PoseReader, _module(family.module))
        found = posing.read(path, root=root, scene=scene, pose=pose)
    else:
        raise InputError(
            f"{path}: animations are read from glTF alone, and pose {pose!r} was asked for. "
            "Leave it out, or convert the file to GLB."
        )
    if found.triangles == 0:
        raise InputError(f"{path}: there is no triangle in it, so there is nothing to bake.")
    return found


def check_target(
    scene: Scene, target: Path, store: StoreSettings, further: Collection[Further] = ()
) -> tuple[str, ...]:
    """Raise OutputError now where write_vertex_ao would refuse the target, before a long bake.

    further : what there will be besides ambient occlusion
    Returns what the user should know about the result, one line each.
    """
    writer = _writer(scene, target)
    if further:
        _further_writer(target, further)
    return writer.check(scene, store, target)


def write_vertex_ao(
    scene: Scene,
    ao: Sequence[NDArray[np.float32]],
    target: Path,
    store: StoreSettings,
    further: Mapping[Further, Sequence[NDArray[np.float32]]] | None = None,
) -> tuple[Path, ...]:
    """Write the scene's asset with ambient occlusion at its vertices; the files written, the target first.

    ao : one (V_i,) float32 array per instance of the scene, in its order
    further : what else there is, per instance: bent normals (V_i, 3) float32, in the space of its mesh, mean
        distances (V_i,) float32
    Raises OutputError where the format cannot hold it or the file cannot be written.
    """
    writer = _writer(scene, target)
    if not further:
        return writer.write(scene, ao, target, store)
    return _further_writer(target, further).write(scene, ao, target, store, further)


def _further_writer(target: Path, further: Collection[Further]) -> FurtherWriter:
    """What writes the target, which holds all of this. Raises OutputError where it has no place for some of it."""
    suffix = target.suffix.lower()
    family = next(family for family in FAMILIES if suffix in family.writes)
    for name in further:
        if name not in family.further:
            raise OutputError(
                f"{target}: {suffix[1:].upper()} is not written with {name.replace('_', ' ')}. "
                "Write GLB instead (-o NAME.glb), or leave that out."
            )
    return cast(FurtherWriter, _module(family.module))


def check_texture_target(
    scene: Scene, target: Path, image: ImageSettings, lightmap: Lightmap | None = None
) -> tuple[str, ...]:
    """Raise OutputError now where write_texture_ao would refuse the target, before a long bake.

    lightmap : None before there is one; with it, what its layout brings with it is said as well
    Returns what the user should know about the result, one line each.
    """
    if lightmap is not None:
        _check_lightmap(scene, lightmap)
    return _texture_writer(scene, target).check_texture(scene, image, target, lightmap)


def write_texture_ao(
    scene: Scene, lightmap: Lightmap, target: Path, image: ImageSettings
) -> tuple[Path, ...]:
    """Write the scene's asset with its lightmap; the files written, the target first.

    target : an asset of TEXTURE_WRITABLE, or an image of IMAGES alone
    Raises OutputError where the format cannot hold it or the file cannot be written.
    """
    _check_lightmap(scene, lightmap)
    return _texture_writer(scene, target).write_texture(scene, lightmap, target, image)


def _check_lightmap(scene: Scene, lightmap: Lightmap) -> None:
    """Raise OutputError where a lightmap is empty, or not one of this scene."""
    if len(lightmap.placings) != len(scene.instances):
        raise OutputError(
            f"the lightmap places {len(lightmap.placings)} instances, and the scene has "
            f"{len(scene.instances)}. Bake the scene as it was read."
        )
    for instance, placing in zip(scene.instances, lightmap.placings, strict=True):
        if placing is not None and not 0 <= placing.page < len(lightmap.pages):
            raise OutputError(
                f"instance {instance.name!r} is on image {placing.page} of the lightmap, which has "
                f"{len(lightmap.pages)}."
            )
    if not lightmap.pages:
        file = f"{scene.source.path}: " if scene.source else ""
        raise OutputError(
            f"{file}no triangle has an area, so there is no lightmap. Scale or repair the asset."
        )


def _texture_writer(scene: Scene, target: Path) -> TextureWriter:
    suffix = target.suffix.lower()
    for family in FAMILIES:
        if suffix in family.holds_textures:
            return cast(TextureWriter, _module(family.module))
    if suffix in IMAGES:
        return cast(TextureWriter, _module("image_alone"))
    was = f" {scene.source.path.name} was read as {scene.source.format}." if scene.source else ""
    if suffix in READABLE or suffix in REFUSED:
        raise OutputError(
            f"{target}: {suffix[1:].upper()} cannot hold a lightmap.{was} Write GLB or OBJ (-o NAME.glb), "
            "or the image alone (-o NAME.png)."
        )
    raise OutputError(
        f"{target}: {suffix or 'a name without an ending'} is no format that can be written.{was}"
        f"{nearest(suffix, (*TEXTURE_WRITABLE, *IMAGES))}"
    )


def _writer(scene: Scene, target: Path) -> Writer:
    suffix = target.suffix.lower()
    for family in FAMILIES:
        if suffix in family.writes:
            return cast(Writer, _module(family.module))
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


def _module(name: str) -> object:
    return importlib.import_module(f"{__name__}.{name}")

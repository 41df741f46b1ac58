"""A scene written as glTF or GLB, with its ambient occlusion: all files, or none."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError, OutputError
from aobake.files import Content, check_writable, write_files
from aobake.meshes.formats.gltf.container import Bytes, glb_pieces
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.fresh import fresh_source, in_stored_space
from aobake.meshes.formats.gltf.jsontext import serialise
from aobake.meshes.formats.gltf.layout import Layout, place_bytes, plan_layout
from aobake.meshes.formats.gltf.lightmap_patch import looks_of, patch_lightmap
from aobake.meshes.formats.gltf.lightmap_warnings import layout_warnings, lightmap_warnings
from aobake.meshes.formats.gltf.page_textures import PageTextures
from aobake.meshes.formats.gltf.patch import chosen_store, patch
from aobake.meshes.formats.gltf.places import touched_places
from aobake.meshes.formats.gltf.sides import side_copies
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.meshes.formats.gltf.store_bent_normals import BentNormalStore
from aobake.meshes.formats.gltf.store_mean_distance import MeanDistanceStore
from aobake.meshes.formats.gltf.stores import Store
from aobake.meshes.formats.gltf.warnings import warnings_of
from aobake.meshes.formats.split_corners import with_split_corners
from aobake.meshes.lightmap import Lightmap
from aobake.meshes.scene import Scene
from aobake.settings import Further, ImageSettings, StoreSettings

__all__ = ["check", "check_texture", "write", "write_texture"]

ENCODINGS = ("8", "16")


def check(scene: Scene, store: StoreSettings, target: Path) -> tuple[str, ...]:
    """Raise OutputError now for what write would refuse, before a long bake.

    Returns what the caller should know about the result, one line each.
    """
    with _refusing():
        source = _source(scene, target)
        chosen = chosen_store(store)
        places = touched_places(source)
        for place in places.values():
            chosen.check(place)
        _check_files(source, target)
        return warnings_of(source, store, places)


def check_texture(
    scene: Scene, image: ImageSettings, target: Path, lightmap: Lightmap | None = None
) -> tuple[str, ...]:
    """Raise OutputError now for what write_texture would refuse.

    lightmap : None before the bake, when its layout is not known
    Returns what the caller should know about the result, one line each.
    """
    if image.encoding not in {None, *ENCODINGS}:
        raise OutputError(
            f"{target}: glTF holds PNG images of 8 or 16 bits, and the encoding {image.encoding!r} was asked for. "
            "Leave it out, or write the image alone (-o NAME.exr)."
        )
    with _refusing():
        source = _source(scene, target)
        places = touched_places(source)
        _check_files(source, target)
        found = lightmap_warnings(source, places)
        if lightmap is not None:
            lightmap = _of_vertices(scene, lightmap)
            looks = looks_of(source, scene, lightmap, places)
            found += layout_warnings(source, places, looks, lightmap, image)
        return tuple(found)


def write(
    scene: Scene,
    ao: Sequence[NDArray[np.float32]],
    target: Path,
    store: StoreSettings,
    further: Mapping[Further, Sequence[NDArray[np.float32]]] | None = None,
) -> tuple[Path, ...]:
    """Write the scene's asset with ambient occlusion; the files written, the target first.

    ao : one (V_i,) float32 array per instance of the scene, in its order
    further : bent normals, (V_i, 3) float32 per instance in the space of its mesh, and mean distances, (V_i,)
    Patches the document that the scene was read from, or makes a new one for a scene from elsewhere.
    Raises OutputError; a file appears whole or not at all.
    """
    with _refusing():
        source = _source(scene, target)
        layout = plan_layout(source.document, target)
        edit = Edit(source.document, layout.buffer, layout.start)
        kept: list[tuple[Store, Sequence[NDArray[np.float32]]]] = [(chosen_store(store), ao)]
        further = further or {}
        if "bent_normals" in further:
            kept.append((BentNormalStore(), in_stored_space(scene, further["bent_normals"])))
        if "mean_distance" in further:
            kept.append((MeanDistanceStore(), further["mean_distance"]))
        patch(edit, source, scene, kept)
        files = _files(layout, edit)
    return _written(files, target)


def write_texture(
    scene: Scene, lightmap: Lightmap, target: Path, image: ImageSettings
) -> tuple[Path, ...]:
    """Write the scene's asset with its lightmap; the files written, the target first.

    Images go into a GLB, and beside a .gltf. Raises OutputError; a file appears whole or not at all.
    """
    check_texture(scene, image, target)
    with _refusing():
        source = _source(scene, target)
        layout = plan_layout(source.document, target)
        edit = Edit(source.document, layout.buffer, layout.start)
        textures = PageTextures(edit, layout, lightmap, image)
        patch_lightmap(edit, source, scene, _of_vertices(scene, lightmap), textures)
        files = {**textures.files, **_files(layout, edit)}
    return _written(files, target)


@contextlib.contextmanager
def _refusing() -> Iterator[None]:
    """What is wrong with the document is a reason why it cannot be written."""
    try:
        yield
    except InputError as error:
        raise OutputError(str(error)) from error


def _source(scene: Scene, target: Path) -> GltfSource:
    return scene.source if isinstance(scene.source, GltfSource) else fresh_source(scene, target)


def _of_vertices(scene: Scene, lightmap: Lightmap) -> Lightmap:
    """The lightmap, for a document whose texture coordinates all belong to vertices."""
    return lightmap if isinstance(scene.source, GltfSource) else with_split_corners(scene, lightmap)


def _check_files(source: GltfSource, target: Path) -> None:
    plan_layout(source.document, target)
    check_writable(target)
    side_copies(source.document, source.document.json, target)


def _files(layout: Layout, edit: Edit) -> dict[Path, Content]:
    """Everything to be written, the asset itself last: it refers to the rest."""
    binary, beside = place_bytes(layout, edit)
    sides = side_copies(edit.document, edit.json, layout.target)
    container = edit.document.container
    if layout.glb:
        text = serialise(edit.json)
        before = container if container.is_glb else None
        asset: list[Bytes] = glb_pieces(text, binary, before, layout.target)
    else:
        asset = [serialise(edit.json, edit.document.layout)]
    return {**sides, **beside, layout.target: asset}


def _written(files: Mapping[Path, Content], target: Path) -> tuple[Path, ...]:
    """Write the files, and make the folders below the target's that they need; take them back on failure.

    The files, the target first.
    """
    check_writable(target)
    made: list[Path] = []
    try:
        for path in files:
            missing = [folder for folder in path.parents if not folder.exists()]
            for folder in reversed(missing):
                folder.mkdir()
                made.append(folder)
        write_files(files)
        return (target, *(path for path in files if path != target))
    except BaseException as error:
        for folder in reversed(made):
            with contextlib.suppress(OSError):
                folder.rmdir()
        if isinstance(error, OSError):
            raise OutputError(
                f"{target}: a folder beside it cannot be made ({error.strerror})."
            ) from error
        raise

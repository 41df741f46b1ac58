"""A scene written as glTF or GLB, with its ambient occlusion: all files, or none."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError, OutputError
from aobake.files import Content, check_writable, write_files
from aobake.meshes.formats.gltf.container import Bytes, glb_pieces
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.fresh import fresh_source
from aobake.meshes.formats.gltf.jsontext import serialise
from aobake.meshes.formats.gltf.layout import Layout, place_bytes, plan_layout
from aobake.meshes.formats.gltf.patch import chosen_store, patch, touched_places
from aobake.meshes.formats.gltf.sides import side_copies
from aobake.meshes.formats.gltf.source import GltfSource
from aobake.meshes.formats.gltf.warnings import warnings_of
from aobake.meshes.scene import Scene
from aobake.settings import StoreSettings

__all__ = ["check", "write"]


def check(scene: Scene, store: StoreSettings, target: Path) -> tuple[str, ...]:
    """Raise OutputError now for what write would refuse, before a long bake.

    Returns what the caller should know about the result, one line each.
    """
    source = _source(scene, target)
    chosen = chosen_store(store)
    places = touched_places(source)
    try:
        for place in places.values():
            chosen.check(place)
        plan_layout(source.document, target)
        check_writable(target)
        side_copies(source.document, source.document.json, target)
    except InputError as error:
        raise OutputError(str(error)) from error
    return warnings_of(source, store, places)


def write(
    scene: Scene, ao: Sequence[NDArray[np.float32]], target: Path, store: StoreSettings
) -> tuple[Path, ...]:
    """Write the scene's asset with ambient occlusion; the files written, the target first.

    ao : one (V_i,) float32 array per instance of the scene, in its order
    Patches the document that the scene was read from, or makes a new one for a scene from elsewhere.
    Raises OutputError; a file appears whole or not at all.
    """
    source = _source(scene, target)
    try:
        layout = plan_layout(source.document, target)
        edit = Edit(source.document, layout.buffer, layout.start)
        patch(edit, source, scene, ao, chosen_store(store))
        files = _files(layout, edit)
    except InputError as error:
        raise OutputError(str(error)) from error
    _write_with_folders(files, target)
    return (target, *(path for path in files if path != target))


def _source(scene: Scene, target: Path) -> GltfSource:
    return scene.source if isinstance(scene.source, GltfSource) else fresh_source(scene, target)


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


def _write_with_folders(files: Mapping[Path, Content], target: Path) -> None:
    """Write the files, and make the folders below the target's that they need; take them back on failure."""
    check_writable(target)
    made: list[Path] = []
    try:
        for path in files:
            missing = [folder for folder in path.parents if not folder.exists()]
            for folder in reversed(missing):
                folder.mkdir()
                made.append(folder)
        write_files(files)
    except BaseException as error:
        for folder in reversed(made):
            with contextlib.suppress(OSError):
                folder.rmdir()
        if isinstance(error, OSError):
            raise OutputError(
                f"{target}: a folder beside it cannot be made ({error.strerror})."
            ) from error
        raise

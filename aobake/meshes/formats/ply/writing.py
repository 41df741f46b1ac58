"""Ambient occlusion into a PLY file, and every byte that is not concerned as it was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.files import write_files
from aobake.meshes.formats.merged import merged
from aobake.meshes.formats.ply.columns import held_by
from aobake.meshes.formats.ply.fresh import document
from aobake.meshes.formats.ply.patching import patched
from aobake.meshes.formats.ply.source import PlySource
from aobake.meshes.scene import Scene
from aobake.settings import Further, StoreSettings

__all__ = ["check", "write"]


def check(scene: Scene, store: StoreSettings, target: Path) -> tuple[str, ...]:
    """Raise OutputError for properties that cannot hold it.

    PLY knows no occlusion texture: the property ao takes its place, and a line says so. Another one says
    where an earlier bake has left its mark.
    """
    said = []
    if store.store == "occlusion":
        said.append(
            f"{target}: PLY has no occlusion texture, so the values are kept in the property ao; "
            "GLB can hold one"
        )
    if isinstance(scene.source, PlySource):
        vertex = next(part for part in scene.source.header.elements if part.name == "vertex")
        held = held_by(vertex, store, str(scene.source.path))
        if held.colors and held.ao is not None:
            said.append(
                f"{scene.source.path}: the vertices have a property ao, so their colors may hold the occlusion "
                "of an earlier bake, and are darkened a second time; bake the original file"
            )
    return tuple(said)


def write(
    scene: Scene,
    ao: Sequence[NDArray[np.float32]],
    target: Path,
    store: StoreSettings,
    further: Mapping[Further, Sequence[NDArray[np.float32]]] | None = None,
) -> tuple[Path, ...]:
    """Write the scene's PLY file with ambient occlusion, or a new one where it was read from no PLY file.

    ao : one (V_i,) float32 array per instance
    store : "color" gives red, green, blue and ao; any other ao alone
    further : mean distances, as ao
    Returns the target. Raises OutputError; nothing is half-written.
    """
    check(scene, store, target)
    distance = None if further is None else further.get("mean_distance")
    if not isinstance(scene.source, PlySource):
        together = (
            None if distance is None else np.concatenate([np.zeros(0, np.float32), *distance])
        )
        write_files({target: document(merged(scene, ao), store, together)})
        return (target,)
    if len(ao) != 1:
        raise OutputError(
            f"{target}: a PLY file is one mesh, and there are values for {len(ao)}. Write GLB."
        )
    source, own = scene.source, None if distance is None else distance[0]
    write_files({target: patched(source.data, source.header, ao[0], own, store, str(target))})
    return (target,)

"""Ambient occlusion as a USD layer over the file that was read, which stays as it is."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.files import same_file, write_files
from aobake.meshes.formats.usd.prims import Colors, Primvar
from aobake.meshes.formats.usd.source import Binding, UsdSource
from aobake.meshes.scene import Scene
from aobake.settings import StoreSettings

__all__ = ["check", "write"]

Values = NDArray[np.float32]


def check(scene: Scene, store: StoreSettings, target: Path) -> tuple[str, ...]:
    """Raise OutputError for a scene that was read from no USD file, and for a layer over itself.

    A line says what is kept elsewhere, shared, or was baked before.
    """
    source = _source(scene, target)
    said = []
    if store.store == "occlusion":
        said.append(
            f"{target}: a USD layer holds no occlusion texture, so the values are kept in primvars:ao; GLB can hold one"
        )
    if source.was_baked and store.store == "color":
        said.append(
            f"{source.path}: it is the layer of an earlier bake, and its colors are darkened a second time; "
            "bake the file below it"
        )
    shared = len(source.bindings) - len(set(source.bindings))
    if shared:
        said.append(
            f"{source.path.name}: {shared} instances of point instancers share one occlusion with others, their mean"
        )
    return tuple(said)


def write(
    scene: Scene, ao: Sequence[Values], target: Path, store: StoreSettings
) -> tuple[Path, ...]:
    """Write a layer that gives every mesh its occlusion, and refers to the file that was read.

    ao : one (V_i,) float32 array per instance of the scene, in its order
    store : "color" multiplies displayColor; any other gives primvars:ao
    Returns the target. Raises OutputError; nothing is half-written.
    """
    source = _source(scene, target)
    from aobake.meshes.formats.usd.stage import colors_of, layer_over

    means = _means(source, scene, ao, target)
    if store.store == "color":
        colors = colors_of(source.path, list(means))
        primvars = {
            binding: _color(values, before)
            for (binding, values), before in zip(means.items(), colors, strict=True)
        }
    else:
        primvars = {binding: _plain(values) for binding, values in means.items()}
    relative = _relative(source.path, target)
    content = layer_over(source.path, relative, target.suffix.lower(), primvars)
    write_files({target: content})
    return (target,)


def _source(scene: Scene, target: Path) -> UsdSource:
    if not isinstance(scene.source, UsdSource):
        raise OutputError(
            f"{target}: USD is written as a layer over a USD file, and this scene was read from none. "
            "Write GLB instead (-o NAME.glb)."
        )
    if any(same_file(file, target) for file in scene.source.files):
        raise OutputError(
            f"{target}: the result is a layer over this very file, which has to stay. Give another name."
        )
    return scene.source


def _relative(path: Path, target: Path) -> str:
    """The name by which a layer refers to the file below it."""
    below, folder = path.resolve(), target.resolve().parent
    try:
        relative = Path(os.path.relpath(below, folder)).as_posix()
    except ValueError:  # on another drive
        return below.as_posix()
    return relative if relative.startswith("../") else f"./{relative}"


def _means(
    source: UsdSource, scene: Scene, ao: Sequence[Values], target: Path
) -> dict[Binding, Values]:
    """(V,) in [0, 1] for each prim; instances of a point instancer share the mean of theirs."""
    lengths = [len(mesh.vertices) for _, mesh in scene.placed()]
    if [len(values) for values in ao] != lengths:
        raise OutputError(
            f"{target}: the values do not belong to this scene: one for each vertex of each instance is needed."
        )
    gathered: dict[Binding, list[Values]] = {}
    for binding, values in zip(source.bindings, ao, strict=True):
        gathered.setdefault(binding, []).append(np.nan_to_num(values, nan=1.0))
    return {
        binding: np.clip(np.mean(several, axis=0, dtype=np.float64), 0.0, 1.0).astype(np.float32)
        for binding, several in gathered.items()
    }


def _plain(values: Values) -> Primvar:
    return Primvar(name="ao", values=values, interpolation="vertex")


def _color(ao: Values, before: Colors | None) -> Primvar:
    """displayColor times the occlusion: by vertex, or by corner where the colours change within a vertex."""
    values, interpolation = np.ones((1, 3)), "constant"
    if before is not None and len(before.values) == _expected(before, len(ao)):
        values, interpolation = before.values, before.interpolation
    at_points = interpolation in {"constant", "vertex", "varying"}
    if interpolation == "uniform" and before is not None:
        values = np.repeat(values, before.sizes, axis=0)
    factors = ao if at_points or before is None else ao[before.corners]
    return Primvar(
        name="displayColor",
        values=np.ascontiguousarray(values * factors[:, None].astype(np.float64), np.float32),
        interpolation="vertex" if at_points else "faceVarying",
    )


def _expected(colors: Colors, vertices: int) -> int:
    """How many values the interpolation asks for; others are left aside, as USD does."""
    return {
        "constant": 1,
        "uniform": len(colors.sizes),
        "vertex": vertices,
        "varying": vertices,
        "faceVarying": len(colors.corners),
    }.get(colors.interpolation, -1)

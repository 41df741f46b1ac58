"""What holds for any file, however broken: it is read, baked, written and read again, or refused in one line."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

import aobake
from aobake.settings import Store, StoreSettings

__all__ = ["BrokenError", "hold"]

Result = TypeVar("Result")
STORES: dict[str, tuple[Store, ...]] = {
    ".glb": ("color", "occlusion", "attribute"),
    ".gltf": ("color", "occlusion", "attribute"),
    ".obj": ("color",),
    ".ply": ("color", "attribute"),
}
MOST_TRIANGLES = 2000  # of a scene that is baked, so that many inputs are seen


class BrokenError(Exception):
    """Something happened that must not, although nothing unforeseen was raised."""


def hold(path: Path) -> bool:
    """Whether a file was read; False where it was refused as it should be.

    Everything that is written goes beside the file. Raises BrokenError, or lets through whatever else
    aobake raised.
    """
    before = path.read_bytes()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = _allowed(lambda: aobake.load(path), path)
        if scene is None:
            return False
        _usable(scene)
        if scene.source is not None:
            _allowed(scene.source.facts, path)
        if 0 < scene.triangles <= MOST_TRIANGLES:
            baked = aobake.bake_vertices(scene, aobake.BakeSettings(rays=1, threads=1))
            _bounded(baked)
            for store in STORES[path.suffix]:
                _written(baked, path, StoreSettings(store=store))
    if path.read_bytes() != before:
        raise BrokenError("the input was changed")
    return True


def _allowed(action: Callable[[], Result], path: Path) -> Result | None:
    """What an action gives; None where it is refused in one line."""
    try:
        return action()
    except (aobake.InputError, aobake.OutputError) as error:
        line = str(error)
        if "\n" in line or len(line) > 1000:
            raise BrokenError(f"the refusal is not one readable line: {line[:2000]!r}") from error
        if path.name not in line and "out" not in line:
            raise BrokenError(f"the refusal does not name the file: {line!r}") from error
        return None


def _usable(scene: aobake.Scene) -> None:
    for mesh in scene.meshes:
        if len(mesh.faces) and not (
            mesh.faces.min() >= 0 and mesh.faces.max() < len(mesh.vertices)
        ):
            raise BrokenError("a face points at a vertex that does not exist")


def _bounded(baked: aobake.BakedVertices) -> None:
    for values, mesh in zip(baked.ao, (m for _, m in baked.scene.placed()), strict=True):
        if values.shape != (len(mesh.vertices),) or not np.isfinite(values).all():
            raise BrokenError("not every vertex has a finite value")
        if len(values) and not (values.min() >= 0.0 and values.max() <= 1.0):
            raise BrokenError("a value is outside of 0 to 1")


def _written(baked: aobake.BakedVertices, path: Path, store: StoreSettings) -> None:
    out = path.with_name(f"out{path.suffix}")
    if _allowed(lambda: aobake.save(baked, out, store=store), path) is None:
        return
    try:
        again = aobake.load(out)
    except aobake.InputError as error:
        raise BrokenError(f"what was written with {store.store} cannot be read: {error}") from error
    if again.triangles != baked.scene.triangles:
        raise BrokenError(f"{baked.scene.triangles} triangles became {again.triangles}")

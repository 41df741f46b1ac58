"""True values, as nearly as many rays tell: what they depend on, and how they are kept between studies."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.scene import Scene
from aobake.settings import AtlasSettings, BakeSettings, TraceSettings

__all__ = ["Find", "Kept", "digest", "made_anew"]

FloatArray = NDArray[np.float64]
Find: TypeAlias = Callable[[], FloatArray]
Kept: TypeAlias = Callable[[str, Find], FloatArray]
"""Gives the reference of a digest, from where it is kept or by the function that finds it."""

# What a study varies, and what changes no value that it measures.
VARIED = {"rays", "tolerance", "tolerance_of", "quality", "max_rays", "seed", "threads", "strict"}
VARIED |= {"denoise", "unwrap_timeout", "blend", "bent_space"}


def made_anew(_: str, find: Find) -> FloatArray:
    """What keeps nothing."""
    return find()


def digest(
    scene: Scene,
    settings: BakeSettings,
    extent: Sequence[int],
    *,
    layout: Iterable[NDArray[np.generic]] | None = None,
) -> str:
    """What tells one reference from any other: the asset, the settings that matter, and how it is made.

    extent : numbers that say how much of the asset is looked at, and how closely
    layout : where the asset lies on a texture; None for values at vertices, which no setting of an atlas
        matters to
    """
    told = hashlib.sha256()
    parts = (TraceSettings,) if layout is None else (TraceSettings, AtlasSettings)
    names = {field.name for part in parts for field in dataclasses.fields(part)} - VARIED
    values = {name: getattr(settings, name) for name in sorted(names)}
    told.update(json.dumps([values, list(extent)]).encode())
    for data in _asset(scene):
        told.update(data)
    for array in layout or ():
        told.update(np.ascontiguousarray(array).tobytes())
    return told.hexdigest()


def _asset(scene: Scene) -> Iterable[bytes]:
    """The geometry as it is posed, and the files that also say where there are holes in it."""
    for instance, mesh in scene.placed():
        yield np.ascontiguousarray(instance.transform).tobytes()
        for array in (mesh.vertices, mesh.faces, mesh.normals):
            yield b"-" if array is None else np.ascontiguousarray(array).tobytes()
        sided = mesh.material is not None and scene.materials[mesh.material].double_sided
        yield bytes([mesh.flat_shaded, sided])
    for path in scene.source.files if scene.source else ():
        yield path.read_bytes()

"""What a bake gives, and how it is kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.files import same_file
from aobake.findings import Finding
from aobake.meshes import formats
from aobake.meshes.scene import Scene
from aobake.plan import Plan
from aobake.settings import BakeSettings, StoreSettings

__all__ = ["BakedVertices", "Estimate", "save"]

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """Ambient occlusion at points.

    mean : (P,) float32 in [0, 1]; 1 = open, 0 = fully occluded
    standard_error : (P,) float32, of the mean
    rays : (P,) int32, rays spent
    """

    mean: Float32Array
    standard_error: Float32Array
    rays: NDArray[np.int32]


@dataclass(frozen=True, eq=False, kw_only=True)
class BakedVertices:
    """Ambient occlusion at the vertices of a scene.

    ao : one (V_i,) float32 array per instance, in the scene's order; 1 = open, 0 = fully occluded
    standard_error : the same shapes; 0 where nothing had to be estimated
    rays : rays spent on the whole scene
    seconds : stage -> seconds ("prepare", "build", "compile", "trace")
    findings : what was passed over, mended or is in doubt, counted and located
    warnings : the same, with what the reader had to say, one line each
    """

    scene: Scene
    settings: BakeSettings
    plan: Plan
    ao: list[Float32Array]
    standard_error: list[Float32Array]
    rays: int
    seconds: Mapping[str, float]
    findings: tuple[Finding, ...]
    warnings: tuple[str, ...]


def save(
    baked: BakedVertices,
    path: str | Path,
    *,
    store: StoreSettings | None = None,
    force: bool = False,
) -> tuple[Path, ...]:
    """Write the asset that was baked, with its ambient occlusion and nothing else changed.

    path : a file of a format that can hold it (aobake.meshes.formats.WRITABLE); where it is the format
        that the scene was read from, the source document is patched
    force : allows the files that the scene was read from to be replaced
    Returns the files written, path first. Raises OutputError; a file appears whole or not at all.
    """
    target = Path(path)
    store = store or StoreSettings()
    source = baked.scene.source
    if source is not None and not force:
        for read in source.files:
            if same_file(read, target):
                raise OutputError(
                    f"{target}: this is a file that the asset was read from. "
                    "Give another name, or allow it to be replaced (--force)."
                )
    formats.check_target(baked.scene, target, store)
    return formats.write_vertex_ao(baked.scene, baked.ao, target, store)

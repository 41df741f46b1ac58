"""Pictures of an asset at several budgets, each beside the map of its error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aobake.bake import bake_vertices
from aobake.meshes.scene import Scene
from aobake.render_settings import RenderSettings
from aobake.settings import BakeSettings
from aobake.shading.materials import Baked
from aobake.shading.preview import render

__all__ = ["LevelPictures", "level_pictures"]

Float32Array = NDArray[np.float32]

ERROR_SHOWN = 0.05  # as the strongest colour
BACKGROUND = 1.0
DARKEST = np.array([0.65, 0.05, 0.1])


@dataclass(frozen=True, eq=False, kw_only=True)
class LevelPictures:
    """rays : a point; occlusion, error : (H, W, 3) float32 in [0, 1], as a display takes them."""

    rays: int
    occlusion: Float32Array
    error: Float32Array


def level_pictures(
    scene: Scene, settings: BakeSettings, budgets: Sequence[int], reference: int, size: str
) -> tuple[LevelPictures, ...]:
    """Pictures at each of the budgets.

    reference : rays of the bake that the errors in the maps are measured against
    size : of each picture, such as 320x240
    """
    exact = _baked(scene, settings, reference, 1)
    shown = []
    for rays in budgets:
        found = _baked(scene, settings, rays, 2)
        wrong = [np.abs(a - b) for a, b in zip(found, exact, strict=True)]
        shown.append(
            LevelPictures(
                rays=rays,
                occlusion=_grey(scene, settings, found, size),
                error=_heat(scene, settings, wrong, size),
            )
        )
    return tuple(shown)


def _baked(scene: Scene, settings: BakeSettings, rays: int, seed: int) -> list[Float32Array]:
    fixed = replace(
        settings, rays=rays, seed=seed, tolerance=None, quality=None, method="point", strict=False
    )
    return bake_vertices(scene, fixed).ao


def _rendered(
    scene: Scene, settings: BakeSettings, values: list[Float32Array], size: str
) -> tuple[Float32Array, Float32Array]:
    """(H, W) values as they are seen, and how much of each pixel is covered."""
    look = RenderSettings(channel="ao", camera="frame", size=size, samples=4)
    pixels = render(scene, look, Baked(ao=values), trace=settings).pixels
    return pixels[..., 0], pixels[..., 3:]


def _grey(
    scene: Scene, settings: BakeSettings, values: list[Float32Array], size: str
) -> Float32Array:
    found, cover = _rendered(scene, settings, values, size)
    shade = np.clip(found, 0.0, 1.0)[..., None] + BACKGROUND * (1.0 - cover)
    return np.repeat(shade, 3, axis=2).astype(np.float32)


def _heat(
    scene: Scene, settings: BakeSettings, values: list[Float32Array], size: str
) -> Float32Array:
    """From white, exact, to dark red."""
    found, _ = _rendered(scene, settings, values, size)
    strength = np.sqrt(np.clip(found / ERROR_SHOWN, 0.0, 1.0))[..., None]
    return np.asarray(1.0 - strength * (1.0 - DARKEST), np.float32)

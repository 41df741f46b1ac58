"""Pictures of an asset at several budgets, each beside the map of its error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aobake.bake import bake_vertices
from aobake.meshes.scene import Scene
from aobake.render_settings import RenderSettings
from aobake.settings import BakeSettings
from aobake.shading.materials import Baked
from aobake.shading.preview import render
from aobake.study.measure import Extent

__all__ = ["ERROR_SHOWN", "Picture", "heat", "level_pictures"]

Float32Array = NDArray[np.float32]

ERROR_SHOWN = 0.05  # as the strongest colour
BACKGROUND = 1.0
DARKEST = np.array([0.65, 0.05, 0.1])


@dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """caption : one line; pixels : (H, W, 3) float32 in [0, 1], as a display takes them."""

    caption: str
    pixels: Float32Array


def level_pictures(
    scene: Scene, settings: BakeSettings, extent: Extent
) -> tuple[tuple[Picture, ...], ...]:
    """For each of the budgets the asset, baked to its vertices, and the error.

    extent : which budgets, what their errors are measured against, and how large pictures are
    """
    if not extent.shown:
        return ()
    exact, size = _baked(scene, settings, extent.shown_reference, 1), extent.picture_size
    shown = []
    for rays in extent.shown:
        found = _baked(scene, settings, rays, 2)
        wrong = [np.abs(a - b) for a, b in zip(found, exact, strict=True)]
        shown.append(
            (
                Picture(
                    caption=f"{rays:,} rays",
                    pixels=_grey(*_rendered(scene, settings, found, size)),
                ),
                Picture(
                    caption="its error",
                    pixels=heat(_rendered(scene, settings, wrong, size)[0]),
                ),
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


def _grey(found: Float32Array, cover: Float32Array) -> Float32Array:
    shade = np.clip(found, 0.0, 1.0)[..., None] + BACKGROUND * (1.0 - cover)
    return np.repeat(shade, 3, axis=2).astype(np.float32)


def heat(error: Float32Array) -> Float32Array:
    """(..., 3) colours of errors (...): from white, exact, to dark red, ERROR_SHOWN and more."""
    strength = np.sqrt(np.clip(error / ERROR_SHOWN, 0.0, 1.0))[..., None]
    return np.asarray(1.0 - strength * (1.0 - DARKEST), np.float32)

"""What a texture costs besides its rays: unwrapping, measured on a piece, and work on texels, by their number."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from aobake.atlas.layout import intended
from aobake.atlas.unwrap import unwrap
from aobake.meshes.scene import Mesh, Scene
from aobake.planning.denoising import LEAST_CHART
from aobake.planning.effect import Plan
from aobake.prepare import Prepared
from aobake.settings import BakeSettings
from aobake.stages import timed
from aobake.tracing.estimate import processors

__all__ = ["TextureCost", "texture_cost"]

FILLED = 0.6  # of an image, that charts usually cover
# Unwrapping takes 12 to 56 microseconds a face; a piece of so many faces next to each other told 0.76 to 1.3 times what
# six whole bodies took. Smaller ones have more border, and told up to 1.7 times.
PIECE, WARM_UP = 2000, 200
# Processor seconds on 2.5 GHz: rasterising and filling gaps, and denoising, of each texel. The latter goes chart by
# chart, each with a margin, and rounded up to whole blocks. Told 0.8 to 1.3 times what four bodies took.
SAMPLED_S, FILLED_S, DENOISED_S, CHART_S = 0.5e-6, 0.4e-6, 2.8e-6, 3e-3
MARGIN = 14  # texels of a cut-out that are not the chart's, along each axis
KEPT_CHARTS = 100  # of a layout that is there already


@dataclass(frozen=True, kw_only=True)
class TextureCost:
    """points : samples to trace; stages : stage -> seconds, of all but preparing, building and tracing"""

    points: int
    stages: dict[str, float]


def texture_cost(
    decided: Plan, scene: Scene, prepared: Prepared, settings: BakeSettings
) -> TextureCost:
    """Estimate the pages of a bake to a texture; takes as long as unwrapping a few thousand faces.

    Raises InputError where texture coordinates were asked for that are missing or overlap.
    """
    stages: dict[str, float] = {}
    with timed(stages, "unwrap"):
        layout = intended(scene, prepared, settings)
    meshes = [scene.meshes[number] for number in layout.unwrapped]
    spent, charts = _unwrapping(meshes, settings)
    stages["unwrap"] += spent
    texels = layout.pages * settings.size**2
    samples = texels * settings.supersample**2
    stages["texels"], stages["finish"] = SAMPLED_S * samples, FILLED_S * texels
    count = charts if meshes else KEPT_CHARTS * layout.pages
    small = bool(meshes) and FILLED * texels < LEAST_CHART * count
    if decided.effects["denoise"].on and not (settings.denoise == "auto" and small):
        stages["denoise"] = _denoising(FILLED * texels, count, settings.threads)
    return TextureCost(points=round(FILLED * samples), stages=stages)


def _unwrapping(meshes: list[Mesh], settings: BakeSettings) -> tuple[float, float]:
    """(seconds, charts) of some meshes, told by a piece of the largest one."""
    faces = sum(len(mesh.faces) for mesh in meshes)
    if not faces:
        return 0.0, 0.0
    largest = max(meshes, key=lambda mesh: len(mesh.faces))
    unwrap([_piece(largest, WARM_UP)], settings, settings.threads)  # loads what is compiled
    part, spent = _piece(largest, PIECE), dict[str, float]()
    with timed(spent, "unwrap"):
        (found,) = unwrap([part], settings, settings.threads)
    whole = faces / len(part.faces)
    return spent["unwrap"] * whole, (int(found.chart.max(initial=-1)) + 1) * whole


def _piece(mesh: Mesh, count: int) -> Mesh:
    """The faces of a mesh that are nearest to one amid them; all of a smaller mesh."""
    if len(mesh.faces) <= count:
        return mesh
    with np.errstate(all="ignore"):
        middles = mesh.vertices[mesh.faces].mean(axis=1)
        away = np.square(middles - middles[len(middles) // 2]).sum(axis=1)
    nearest = np.argpartition(away, count)[:count]  # what is not finite comes last
    return replace(mesh, faces=mesh.faces[np.sort(nearest)], attributes={})


def _denoising(texels: float, charts: float, threads: int | None) -> float:
    """Seconds for so many texels in so many charts."""
    side = math.sqrt(texels / max(charts, 1.0)) + MARGIN
    return charts * (CHART_S + DENOISED_S * side**2 / (threads or processors()))

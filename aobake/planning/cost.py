"""What a bake will cost: measured on a few of its points, by the very path that all of them will take."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aobake.meshes.scene import Scene
from aobake.meshes.surfaces import surfaces_of
from aobake.occlusion import compile_for, occlusion_at
from aobake.open_sky import expected_share, hull_rays
from aobake.plan import plan, texture_plan
from aobake.planning.effect import Plan
from aobake.points import SurfacePoints, vertex_points
from aobake.prepare import Prepared, build, in_scene_units, lowest
from aobake.settings import BakeSettings
from aobake.sharing import first_alike, to_trace
from aobake.stages import timed

__all__ = ["Cost", "EffectCost", "estimated"]

PROBE_SECONDS = 0.25  # that the last, and longest, probe may take
FIRST_PROBE, LONGER = 64, 4  # points
RUN = 16  # points next to each other that are probed together: neighbours meet the same triangles
# Memory: a scan of 400,000 faces takes 270 bytes for each more than nothing does, half a vertex included.
TRIANGLE_BYTES, VERTEX_BYTES = 160, 220
# Of bent normals and of a distance at a point: sums in float64, the result in float32. Of a face with holes: where it
# lies in them.
BENT_BYTES, DISTANCE_BYTES, HOLED_BYTES = 36, 12, 36


@dataclass(frozen=True, kw_only=True)
class EffectCost:
    """factor : on the seconds of tracing; seconds : that it adds, or would add; bytes : the same of memory."""

    factor: float
    seconds: float
    bytes: int


@dataclass(frozen=True, kw_only=True)
class Cost:
    """What a bake will take, without reading and writing, once kernels are compiled.

    seconds : in all; stages : stage -> seconds; points : vertices or texels; bytes : of memory
    effects : name -> what it costs, or would cost if it were on
    """

    seconds: float
    stages: Mapping[str, float]
    points: int
    rays: int
    bytes: int
    effects: Mapping[str, EffectCost]


def estimated(
    decided: Plan,
    scene: Scene,
    settings: BakeSettings | None = None,
    *,
    texture: bool = False,
) -> Cost:
    """Estimate what a plan costs on this machine, as it is now; takes about a second of tracing.

    texture : whether it is a plan of texture_plan: texels are traced instead of vertices

    Seconds of tracing are those of some points, in runs of neighbours all over the scene, times the others.
    Raises EngineError where Embree cannot be used, and InputError where a texture's coordinates are at fault.
    """
    settings = in_scene_units(scene, settings or BakeSettings())
    seconds: dict[str, float] = {}
    with timed(seconds, "prepare"):
        (texture_plan if texture else plan)(scene, settings)
        surfaces = surfaces_of(scene, settings)
    with timed(seconds, "build"):
        prepared = build(scene, surfaces, settings)
        points = vertex_points(scene, prepared)
    ground = lowest(scene, prepared, settings)
    compile_for(prepared, points, ground, settings)
    points = points.only(to_trace(points, first_alike(scene, settings, ground)))
    each, rays = _probed(prepared, points, ground, settings)
    wanted = len(points)
    if texture:
        # Here, since it loads the unwrapper.
        from aobake.planning.texture_cost import texture_cost

        page = texture_cost(decided, scene, prepared, settings)
        wanted = page.points
        seconds |= page.stages
    method = decided.effects.get("method")
    if method is not None and method.on:
        traced, hull = wanted * method.cost, 0
    else:
        share, hull = _open(prepared, points, wanted, ground, settings)
        traced = wanted * (1.0 - share)
    seconds["trace"] = each * (traced + hull / max(rays, 1.0))
    size = TRIANGLE_BYTES * sum(len(part.faces) for part in prepared.parts)
    size += VERTEX_BYTES * max(scene.vertices, wanted)
    return Cost(
        seconds=sum(seconds.values()),
        stages=seconds,
        points=wanted if texture else scene.vertices,
        rays=round(rays * traced),
        bytes=size,
        effects=_of_effects(decided, seconds["trace"], _extra_bytes(scene, decided, wanted)),
    )


def _open(
    prepared: Prepared,
    points: SurfacePoints,
    wanted: int,
    ground: float | None,
    settings: BakeSettings,
) -> tuple[float, int]:
    """(share of the points that need no ray, rays that could be traced while they are found)."""
    everything, frame = prepared.placements, prepared.world.frame
    share = expected_share(prepared, everything, frame, points, wanted, ground, settings)
    return share, hull_rays(prepared, everything) if share > 0.0 else 0


def _probed(
    prepared: Prepared, points: SurfacePoints, ground: float | None, settings: BakeSettings
) -> tuple[float, float]:
    """(seconds, rays) of one point, from more and more of them until the clock can tell.

    The first ones are traced without a clock: they pay for direction sets that all others find made.
    """
    if len(points) == 0:
        return 0.0, 0.0
    count = FIRST_PROBE
    occlusion_at(prepared, points.only(_in_runs(len(points), count)), ground, settings)
    while True:
        some = points.only(_in_runs(len(points), count))
        start = time.perf_counter()
        found = occlusion_at(prepared, some, ground, settings)
        spent = time.perf_counter() - start
        if len(some) == len(points) or spent * LONGER > PROBE_SECONDS:
            return spent / len(some), float(found.rays.mean())
        count *= LONGER


def _in_runs(count: int, wanted: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Numbers below `count`, about as many as are wanted, in runs spread evenly."""
    if wanted >= count:
        return np.arange(count)
    starts = np.linspace(0, count - RUN, max(1, wanted // RUN)).astype(np.int64)
    return np.unique(np.maximum(starts[:, None], 0) + np.arange(min(RUN, count)))


def _extra_bytes(scene: Scene, decided: Plan, points: int) -> dict[str, int]:
    """Memory that effects take beside what every bake takes; those that are not named take none."""
    kept = max(scene.vertices, points)
    found = {"bent_normals": BENT_BYTES * kept, "mean_distance": DISTANCE_BYTES * kept}
    if decided.effects["alpha"].on:
        from aobake.meshes.alpha import scene_alpha

        holed = scene_alpha(scene).meshes.values()
        images = {id(alpha.alpha): alpha.alpha.nbytes for alpha in holed}
        found["alpha"] = sum(images.values()) + sum(HOLED_BYTES * len(a.kinds) for a in holed)
    return found


def _of_effects(decided: Plan, traced: float, extra: Mapping[str, int]) -> dict[str, EffectCost]:
    """What each effect adds to the seconds of tracing, or would add, by its factor."""
    found = {}
    for name, effect in decided.effects.items():
        without = traced / effect.cost if effect.on and effect.cost > 0.0 else traced
        found[name] = EffectCost(
            factor=effect.cost, seconds=without * (effect.cost - 1.0), bytes=extra.get(name, 0)
        )
    return found

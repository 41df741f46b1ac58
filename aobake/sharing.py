"""Placements of one mesh that provably have the same ambient occlusion: one is traced, the others copy it.

Turning, moving or evenly scaling a body together with everything that can occlude it changes nothing. So
placements share where each is occluded by itself alone: because that was asked for, or because nothing
else is within the distance that limits occlusion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.extent import boxes
from aobake.meshes.scene import FloatArray, Instance, Scene
from aobake.occluders import alone, occluding
from aobake.overrides import forced
from aobake.points import SurfacePoints
from aobake.settings import TraceSettings
from aobake.tracing.estimate import Estimates

__all__ = ["copied", "first_alike", "to_trace"]

ALIKE = 1e-6  # relative difference of transforms that count as the same


def first_alike(scene: Scene, settings: TraceSettings, ground: float | None) -> NDArray[np.int64]:
    """(I,) for each instance the first one with the same ambient occlusion, which may be itself.

    ground : height of the ground along its axis, in scene units, or None
    """
    first = np.arange(len(scene.instances))
    if forced(settings.effect).get("sharing") is False or len(
        {instance.mesh for instance in scene.instances}
    ) == len(first):
        return first
    by_itself = _by_themselves(scene, settings, ground)
    occludes = occluding(scene, settings)
    known: dict[tuple[int, bool], list[int]] = {}
    for number, instance in enumerate(scene.instances):
        if by_itself[number]:
            others = known.setdefault((instance.mesh, bool(occludes[number])), [])
            same = (n for n in others if _alike(scene.instances[n], instance, settings))
            first[number] = next(same, number)
            if first[number] == number:
                others.append(number)
    return first


def _by_themselves(
    scene: Scene, settings: TraceSettings, ground: float | None
) -> NDArray[np.bool_]:
    """(I,) which instances nothing but themselves can occlude."""
    if alone(settings) and ground is None:
        return np.ones(len(scene.instances), bool)
    if settings.max_distance is None:
        return np.zeros(len(scene.instances), bool)
    found, reach = boxes(scene), settings.max_distance * (1.0 + ALIKE)
    low, high = found[:, 0] - reach, found[:, 1] + reach
    occludes = occluding(scene, settings) & (not alone(settings))
    free = np.asarray(np.isfinite(low).all(axis=1), bool)
    if ground is not None and settings.ground is not None:
        free &= low[:, "xyz".index(settings.ground[1])] >= ground
    for number in np.flatnonzero(free):
        meets = ((found[:, 0] <= high[number]) & (found[:, 1] >= low[number])).all(axis=1)
        meets[number] = False
        free[number] = not (meets & occludes).any()
    return free


def _alike(one: Instance, other: Instance, settings: TraceSettings) -> bool:
    """Whether one transform is the other followed by what changes no occlusion.

    Directions do change under a turn, so bent normals ask for placements that are only moved; and distances
    under a scale.
    """
    first, second = one.transform[:3, :3], other.transform[:3, :3]
    if not (np.isfinite(one.transform).all() and np.isfinite(other.transform).all()):
        return False
    squared, again = first.T @ first, second.T @ second
    size, size_again = float(np.trace(squared)), float(np.trace(again))
    if not size > 0.0 or not size_again > 0.0:
        return False
    if settings.bent_normals:
        return _same(first, second, size**0.5)
    keeps_size = settings.max_distance is not None or settings.mean_distance
    ratio = 1.0 if keeps_size else size_again / size
    return _same(squared * ratio, again, size_again)


def _same(one: FloatArray, other: FloatArray, size: float) -> bool:
    return bool(np.abs(one - other).max() <= ALIKE * size)


def to_trace(points: SurfacePoints, alike: NDArray[np.int64]) -> NDArray[np.int64]:
    """The rows of the points that are traced: those of instances that copy no other one."""
    return np.flatnonzero((alike == np.arange(len(alike)))[points.owners])


def copied(traced: Estimates, points: SurfacePoints, alike: NDArray[np.int64]) -> Estimates:
    """Estimates at all points, from those at the rows of to_trace; copies have cost no rays.

    points : instance by instance, and as many of each that copies as of the one that it copies
    """
    rows = to_trace(points, alike)
    if len(rows) == len(points):
        return traced
    counts = np.bincount(points.owners, minlength=len(alike))
    own = alike == np.arange(len(alike))
    starts = np.cumsum(np.where(own, counts, 0)) - np.where(own, counts, 0)
    within = np.arange(len(points)) - (np.cumsum(counts) - counts)[points.owners]
    found = traced.only(starts[alike[points.owners]] + within)
    rays = np.where(own[points.owners], found.rays, 0).astype(np.int32)
    return replace(found, rays=rays)

"""Ambient occlusion at surface points: as many worlds as float32 needs to resolve what is around them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from aobake.errors import SettingsError
from aobake.findings import FindingKind
from aobake.meshes.scene import Scene
from aobake.meshes.surface import Surface
from aobake.open_sky import EVERYTHING, OpenSky
from aobake.points import FloatArray, SurfacePoints, vertex_points
from aobake.prepare import Prepared
from aobake.settings import TraceSettings
from aobake.tracing.conditioning import detail_beside, regions
from aobake.tracing.estimate import Estimates, Request, compile_kernels, estimate
from aobake.tracing.origins import CONTACT, DOUBTFUL, ENCLOSED, SLIVERS, THIN, UNRESOLVED
from aobake.tracing.world import Placement, Watched, World, build_world

__all__ = ["STATES", "compile_for", "detail_at", "occlusion_at", "watched_points"]

Progress = Callable[[int, int], None]

# Points in less than this share of a scene are watched, some of them, for detail of this share of it: large
# triangles are cut beside them as beside vertices.
SMALL_PART, MOST_WATCHED, WATCHED_DETAIL = 1e3, 64, 1e-7

# What the tracer marks points with, as findings.
STATES: dict[FindingKind, int] = {
    "sliver": SLIVERS,
    "contact": CONTACT,
    "thin": THIN,
    "unresolved": UNRESOLVED,
    "doubtful": DOUBTFUL,
    "enclosed": ENCLOSED,
}


def occlusion_at(
    prepared: Prepared,
    points: SurfacePoints,
    ground: float | None,
    settings: TraceSettings,
    progress: Progress | None = None,
    sky: OpenSky | None = None,
) -> Estimates:
    """Estimates at all points; of each instance by itself, where that is what occludes it.

    sky : what was found out before about points that everything lies below; None: nothing
    Raises SettingsError where each instance is occluded by itself alone, and points are on none.
    """
    sky = sky or OpenSky({})
    if prepared.own is None:
        request = _request(prepared, points, ground, sky.over(EVERYTHING, points))
        return _among(
            prepared, prepared.placements, prepared.world, points, request, settings, progress
        )
    if (points.owners < 0).any():
        raise SettingsError(
            "occluders is 'own', but points that are given alone are on no object; "
            "name those that occlude, or use all."
        )
    result, done = _blank(prepared, points, settings), 0
    for owner in np.unique(points.owners).tolist():
        chosen, placements = np.flatnonzero(points.owners == owner), prepared.own[owner]
        world = build_world(prepared.parts, placements)
        report = _after(done, len(points), progress)
        mine = points.only(chosen)
        request = _request(prepared, mine, ground, sky.over(owner, mine))
        result.put(chosen, _among(prepared, placements, world, mine, request, settings, report))
        done += len(chosen)
    return result


def _among(
    prepared: Prepared,
    placements: Sequence[Placement],
    world: World,
    points: SurfacePoints,
    request: Request,
    settings: TraceSettings,
    progress: Progress | None,
) -> Estimates:
    """Estimates among the placements: in one world for what float32 resolves there, in further ones for the rest."""
    found, unresolved = regions(points.positions, points.detail, world.frame)
    if len(found) == 1:
        return estimate(world, request, settings, progress)
    result, done = _blank(prepared, points, settings), 0
    for center, chosen in found:
        if center is not None:
            world = build_world(prepared.parts, placements, center, prepared.watched)
        report = _after(done, len(points), progress)
        result.put(chosen, estimate(world, request.only(chosen), settings, report))
        done += len(chosen)
    result.states[unresolved] = UNRESOLVED
    return result


def _blank(prepared: Prepared, points: SurfacePoints, settings: TraceSettings) -> Estimates:
    return Estimates.blank(len(points), bent=settings.bent_normals, reach=prepared.reach)


def _after(before: int, count: int, progress: Progress | None) -> Progress | None:
    """What a part of all points reports to."""
    if progress is None:
        return None
    return lambda some, _: progress(before + some, count)


def compile_for(
    prepared: Prepared, points: SurfacePoints, ground: float | None, settings: TraceSettings
) -> None:
    """Compile the kernels that occlusion_at will need, in the calling thread."""
    compile_kernels(prepared.world, _request(prepared, points, ground), settings)


def _request(
    prepared: Prepared,
    points: SurfacePoints,
    ground: float | None,
    opened: NDArray[np.bool_] | None = None,
) -> Request:
    """The points as the tracer wants them."""
    return Request(
        positions=points.positions,
        normals=points.normals,
        geometric=points.geometric,
        numbers=points.numbers,
        ground=ground,
        open=opened,
        reach=prepared.reach,
    )


def watched_points(
    points: SurfacePoints, scene: Scene, surfaces: Sequence[Surface]
) -> Watched | None:
    """Some of the points, where they are all in one small part of the scene: vertices may be far off."""
    size = 0.0
    for instance, mesh in scene.placed():
        if len(surfaces[instance.mesh].faces) and np.isfinite(instance.transform).all():
            used = mesh.vertices[np.unique(surfaces[instance.mesh].faces)]
            stretch = float(np.abs(instance.transform[:3, :3]).sum(axis=1).max())
            size = max(size, stretch * float(np.ptp(used, axis=0).max()))
    if len(points) == 0 or size <= SMALL_PART * float(np.ptp(points.positions, axis=0).max()):
        return None
    step = -(-len(points) // MOST_WATCHED)
    return Watched(points.positions[::step], size * WATCHED_DETAIL)


def detail_at(positions: FloatArray, scene: Scene, prepared: Prepared) -> FloatArray:
    """The detail around points: as they are watched for, or as the nearest vertex has it, else any."""
    if prepared.watched is not None:
        return np.full(len(positions), prepared.watched.detail)
    vertices = vertex_points(scene, prepared)
    found, _ = regions(vertices.positions, vertices.detail, prepared.world.frame)
    if len(found) == 1:
        return np.full(len(positions), np.inf)
    return detail_beside(positions, vertices.positions, vertices.detail)

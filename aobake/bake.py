"""A bake of vertices: scene and settings in, ambient occlusion with its error out. Touches no file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.findings import Finding
from aobake.meshes.normals import unit_rows
from aobake.meshes.scene import Scene
from aobake.meshes.surface import findings
from aobake.meshes.surfaces import surfaces_of
from aobake.occlusion import STATES, compile_for, detail_at, occlusion_at, watched_points
from aobake.open_sky import sky_over
from aobake.plan import plan
from aobake.points import asked_vertices, given_points, vertex_points
from aobake.prepare import (
    Prepared,
    build,
    in_scene_units,
    lowest,
    name_of,
    placed_nowhere,
    refuse,
)
from aobake.results import BakedVertices, Estimate
from aobake.settings import BakeSettings
from aobake.sharing import copied, first_alike, to_trace
from aobake.stages import timed
from aobake.tracing.estimate import Estimates
from aobake.tracing.origins import OPEN
from aobake.tracing.rounds import equal_fixed_rays

__all__ = ["bake_vertices", "visibility"]

Progress = Callable[[str, int, int], None]


def bake_vertices(
    scene: Scene, settings: BakeSettings | None = None, *, progress: Progress | None = None
) -> BakedVertices:
    """Ambient occlusion at every vertex of every instance; all of them occlude each other.

    progress : called in the calling thread with (stage, done, total) while points are traced; whatever
        it raises stops the bake within a fraction of a second, as does a KeyboardInterrupt
    Vertices that no face uses, that are not finite or that have no normal come out as 1, with a warning
    where a face uses them. A scene without triangles gives arrays of 1; one without vertices, empty ones.
    Raises InputError where settings.strict is on and anything was passed over, mended or is in doubt;
    EngineError where Embree cannot be used.
    """
    settings = in_scene_units(scene, settings or BakeSettings())
    seconds: dict[str, float] = {}
    with timed(seconds, "prepare"):
        decided = plan(scene, settings)
        surfaces = surfaces_of(scene, settings)
        if settings.strict:
            refuse(scene, [finding for surface in surfaces for finding in surface.findings])
    with timed(seconds, "build"):
        prepared = build(scene, surfaces, settings)
        points = vertex_points(scene, prepared)
    ground = lowest(scene, prepared, settings)
    with timed(seconds, "compile"):
        if progress is not None:
            progress("compile", 0, 1)
        fitted = decided.effects["method"].on
        kinds = replace(points, geometric=points.normals) if fitted else points
        compile_for(prepared, kinds, ground, settings)
    with timed(seconds, "trace"):
        report = None if progress is None else partial(progress, "trace")
        if fitted:
            # Here, since it loads scipy's solvers: a third of a second that other bakes need not wait.
            from aobake.leastsquares import fitted_vertices

            found = fitted_vertices(scene, prepared, ground, settings, report)
        else:
            alike = first_alike(scene, settings, ground)
            some = points.only(to_trace(points, alike))
            sky = sky_over(prepared, some, len(some), ground, settings)
            traced = occlusion_at(prepared, some, ground, settings, report, sky)
            found = copied(traced, points, alike)
    ao = _per_instance(scene, prepared, found.mean, 1.0)
    error = _per_instance(scene, prepared, found.standard_error, 0.0)
    found_out = _findings(scene, prepared, found)
    if settings.strict:
        refuse(scene, found_out)
    return BakedVertices(
        scene=scene,
        settings=settings,
        plan=decided.with_open_sky(int((found.states == OPEN).sum()), len(found.mean)),
        ao=ao,
        standard_error=error,
        bent_normals=None if found.bent is None else _bent_normals(scene, prepared, found.bent),
        mean_distance=None
        if found.distance is None or prepared.reach is None
        else _per_instance(scene, prepared, found.distance, prepared.reach),
        rays=int(found.rays.sum(dtype=np.int64)),
        fixed_rays=_fixed_rays(found, settings, fitted=fitted),
        seconds=seconds,
        findings=found_out,
        warnings=(
            *scene.warnings,
            *placed_nowhere(scene),
            *prepared.warnings,
            *map(str, found_out),
        ),
    )


def visibility(
    scene: Scene,
    positions: ArrayLike,
    normals: ArrayLike,
    settings: BakeSettings | None = None,
    geometric_normals: ArrayLike | None = None,
) -> Estimate:
    """Ambient occlusion at any points of, or near, a scene's surfaces.

    positions : (P, 3) float, in the scene's space
    normals : (P, 3) float, of any length: the hemisphere that the integral is taken over
    geometric_normals : (P, 3) float: directions below these surfaces are left out, and the rest stands
        for the whole, so that a coarse mesh that is shaded smoothly does not occlude itself; or None
    Returns means in [0, 1], their standard errors, and the rays spent; empty arrays for no points. A
    point or normal that is not finite, or a normal of length 0, gives 1 with 0 rays.
    Raises InputError for arrays of other shapes, EngineError where Embree cannot be used.
    """
    settings = in_scene_units(scene, settings or BakeSettings())
    points, count = given_points(positions, normals, geometric_normals)
    surfaces = surfaces_of(scene, settings)
    prepared = build(scene, surfaces, settings, watched_points(points, scene, surfaces))
    points = replace(points, detail=detail_at(points.positions, scene, prepared))
    ground = lowest(scene, prepared, settings)
    sky = sky_over(prepared, points, len(points), ground, settings)
    found = occlusion_at(prepared, points, ground, settings, None, sky)
    mean, error = np.ones(count, np.float32), np.zeros(count, np.float32)
    rays = np.zeros(count, np.int32)
    chosen = points.numbers
    mean[chosen], error[chosen], rays[chosen] = found.mean, found.standard_error, found.rays
    return Estimate(mean=mean, standard_error=error, rays=rays)


def _fixed_rays(found: Estimates, settings: BakeSettings, *, fitted: bool) -> int | None:
    """Rays that a fixed count would have taken for the same root mean square error; None without a tolerance."""
    if settings.tolerance is None or fitted:
        return None
    traced = found.rays > 0
    each = equal_fixed_rays(found.standard_error[traced], found.rays[traced])
    return None if each is None else round(each * int(traced.sum()))


def _per_instance(
    scene: Scene, prepared: Prepared, found: NDArray[np.float32], otherwise: float
) -> list[NDArray[np.float32]]:
    """Values of one array per instance; vertices that share a place and a normal share them.

    found : (P,) at the points; otherwise : what vertices have that are none
    """
    several, first = [], 0
    for (instance, mesh), stands in zip(scene.placed(), prepared.placed, strict=True):
        values = np.full(len(mesh.vertices), otherwise, np.float32)
        if stands is not None:
            asked = np.flatnonzero(asked_vertices(instance, stands[1]))
            values[asked] = found[first : first + len(asked)]
            values = values[stands[1].same_as]
            first += len(asked)
        several.append(values)
    return several


def _bent_normals(
    scene: Scene, prepared: Prepared, bent: NDArray[np.float32]
) -> list[NDArray[np.float32]]:
    """Directions at the vertices of each instance, turned back into its mesh; normals where none was traced."""
    found, first = [], 0
    for (instance, mesh), stands in zip(scene.placed(), prepared.placed, strict=True):
        own = np.zeros((len(mesh.vertices), 3))
        if stands is not None:
            asked = np.flatnonzero(asked_vertices(instance, stands[1]))
            own[:] = stands[1].normals
            # The inverse of how normals are turned, up to a length.
            own[asked] = unit_rows(bent[first : first + len(asked)] @ instance.transform[:3, :3])
            own = own[stands[1].same_as]
            first += len(asked)
        found.append(own.astype(np.float32))
    return found


def _findings(scene: Scene, prepared: Prepared, found: Estimates) -> tuple[Finding, ...]:
    """What was found about the meshes, then about the points of each instance."""
    lines = [finding for surface in prepared.surfaces for finding in surface.findings]
    first = 0
    for number, stands in enumerate(prepared.placed):
        if stands is None:
            continue
        asked = np.flatnonzero(asked_vertices(*stands))
        states = found.states[first : first + len(asked)]
        first += len(asked)
        for kind, state in STATES.items():
            marks = np.zeros(len(stands[1].asked), bool)
            marks[asked[states == state]] = True
            lines += findings(name_of(scene, number), {kind: marks})
    return tuple(lines)

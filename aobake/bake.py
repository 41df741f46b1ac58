"""A bake: scene and settings in, ambient occlusion with its error out. Touches no file."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.errors import InputError
from aobake.findings import Finding, FindingKind
from aobake.meshes.normals import unit_rows
from aobake.meshes.scene import Instance, Scene
from aobake.meshes.surface import Surface, findings
from aobake.meshes.surfaces import surfaces_of
from aobake.plan import plan
from aobake.points import SurfacePoints, given_points
from aobake.results import BakedVertices, Estimate
from aobake.settings import BakeSettings
from aobake.tracing.backfaces import pass_through_backfaces
from aobake.tracing.conditioning import detail_beside, regions
from aobake.tracing.estimate import Estimates, Request, compile_kernels, estimate
from aobake.tracing.origins import CONTACT, DOUBTFUL, ENCLOSED, SLIVERS, THIN, UNRESOLVED
from aobake.tracing.world import Placement, Triangles, Watched, World, build_world

__all__ = ["bake_vertices", "build", "surfaces_of", "vertex_points", "visibility"]

FloatArray = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

# Points in less than this share of a scene are watched, some of them, for detail of this share of it: large
# triangles are cut beside them as beside vertices.
SMALL_PART, MOST_WATCHED, WATCHED_DETAIL = 1e3, 64, 1e-7
INSTANCED = (
    1.0 / 8.0
)  # detail that float32 resolves on an instance: its transform errs by 8 half-ulps


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scene made ready: a surface per mesh, where instances stand, the built world."""

    surfaces: Sequence[Surface]
    parts: Sequence[Triangles]
    placements: Sequence[Placement]
    placed: Sequence[tuple[Instance, Surface] | None]
    world: World
    watched: Watched | None


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
    settings = settings or BakeSettings()
    seconds: dict[str, float] = {}
    with _timed(seconds, "prepare"):
        decided = plan(scene, settings)
        surfaces = surfaces_of(scene, settings)
        if settings.strict:
            _refuse(scene, [finding for surface in surfaces for finding in surface.findings])
    with _timed(seconds, "build"):
        prepared = build(scene, surfaces, settings)
        points = vertex_points(scene, prepared)
    ground = _lowest(scene, prepared, settings)
    with _timed(seconds, "compile"):
        if progress is not None:
            progress("compile", 0, 1)
        compile_kernels(prepared.world, _request(points, ground), settings)
    with _timed(seconds, "trace"):
        report = None if progress is None else partial(progress, "trace")
        found = _traced(prepared, points, ground, settings, report)
    ao, error = _per_instance(scene, prepared, found)
    found_out = _findings(scene, prepared, found)
    if settings.strict:
        _refuse(scene, found_out)
    return BakedVertices(
        scene=scene,
        settings=settings,
        plan=decided,
        ao=ao,
        standard_error=error,
        rays=int(found.rays.sum(dtype=np.int64)),
        seconds=seconds,
        findings=found_out,
        warnings=(*scene.warnings, *_not_placed(scene), *map(str, found_out)),
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
    settings = settings or BakeSettings()
    points, count = given_points(positions, normals, geometric_normals)
    surfaces = surfaces_of(scene, settings)
    prepared = build(scene, surfaces, settings, _watched(points, scene, surfaces))
    points = replace(points, detail=_detail_at(points.positions, scene, prepared))
    found = _traced(prepared, points, _lowest(scene, prepared, settings), settings, None)
    mean, error = np.ones(count, np.float32), np.zeros(count, np.float32)
    rays = np.zeros(count, np.int32)
    chosen = points.numbers
    mean[chosen], error[chosen], rays[chosen] = found.mean, found.standard_error, found.rays
    return Estimate(mean=mean, standard_error=error, rays=rays)


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start


def _not_placed(scene: Scene) -> list[str]:
    """A line for each instance whose transform puts it nowhere."""
    return [
        f"{_name(scene, number)}: its transform is not finite; it was passed over."
        for number, instance in enumerate(scene.instances)
        if not np.isfinite(instance.transform).all()
    ]


def build(
    scene: Scene,
    surfaces: Sequence[Surface],
    settings: BakeSettings,
    watched: Watched | None = None,
) -> Prepared:
    """Put every instance into one world. Mirrored instances get faces of their own, wound back."""
    parts: dict[tuple[int, bool], int] = {}
    triangles: list[Triangles] = []
    placements: list[Placement] = []
    placed: list[tuple[Instance, Surface] | None] = []
    for instance, mesh in scene.placed():
        transform, surface = instance.transform[:3], surfaces[instance.mesh]
        if not np.isfinite(transform).all():
            placed.append(None)
            continue
        placed.append((instance, surface))
        mirrored = _mirrors(transform[:, :3])
        key = (instance.mesh, mirrored)
        if key not in parts:
            parts[key] = len(triangles)
            faces = surface.faces[:, [0, 2, 1]] if mirrored else surface.faces
            triangles.append(
                Triangles(mesh.vertices, faces, _hit_filter(scene, mesh.material, settings))
            )
        if len(surface.faces):
            placements.append(Placement(parts[key], transform))
    world = build_world(triangles, placements, watched=watched)
    return Prepared(surfaces, triangles, placements, placed, world, watched)


def _hit_filter(scene: Scene, material: int | None, settings: BakeSettings) -> int:
    double_sided = material is not None and scene.materials[material].double_sided
    return pass_through_backfaces() if settings.backfaces == "ignore" and not double_sided else 0


def vertex_points(scene: Scene, prepared: Prepared) -> SurfacePoints:
    """The vertices to trace from, instance by instance; numbered as they stand in the whole scene."""
    asked = [
        np.zeros(0, np.int64) if stands is None else np.flatnonzero(_asked(*stands))
        for stands in prepared.placed
    ]
    ends = np.cumsum([len(chosen) for chosen in asked], dtype=np.int64)
    points = _room_for(int(ends[-1]) if len(ends) else 0)
    uses = np.bincount(
        np.array([i.mesh for i in scene.instances], np.int64), minlength=len(scene.meshes)
    )
    first = 0
    for number, (instance, mesh) in enumerate(scene.placed()):
        stands, chosen = prepared.placed[number], asked[number]
        if stands is not None:
            linear, shift = instance.transform[:3, :3], instance.transform[:3, 3]
            stretch = float(np.abs(linear).sum(axis=1).max())
            stretch *= INSTANCED if uses[instance.mesh] > 1 else 1.0
            rows = slice(ends[number] - len(chosen), ends[number])
            points.positions[rows] = mesh.vertices[chosen] @ linear.T + shift
            points.normals[rows] = _turned_normals(stands[1].normals[chosen], linear)
            points.detail[rows] = stretch * stands[1].detail[chosen]
            points.numbers[rows] = chosen + first
        first += len(mesh.vertices)
    return points


def _room_for(count: int) -> SurfacePoints:
    return SurfacePoints(
        positions=np.empty((count, 3)),
        normals=np.empty((count, 3)),
        geometric=None,
        detail=np.empty(count),
        numbers=np.empty(count, np.int64),
    )


def _asked(instance: Instance, surface: Surface) -> NDArray[np.bool_]:
    """(V,) the vertices to trace from; none where the transform leaves their normals no direction."""
    turned = _turned_normals(surface.normals, instance.transform[:3, :3])
    return surface.asked & turned.any(axis=1)


def _mirrors(linear: FloatArray) -> bool:
    """Whether a (3, 3) map turns right hands into left ones, however small it makes them."""
    size = float(np.abs(linear).max()) or 1.0
    return bool(np.linalg.det(linear / size) < 0.0)


def _turned_normals(normals: FloatArray, linear: FloatArray) -> FloatArray:
    """(N, 3) unit normals after a linear map: by its cofactors, which a flattening one has as well."""
    if np.array_equal(linear, np.eye(3)):
        return normals
    size = float(np.abs(linear).max()) or 1.0
    a, b, c = (linear / size).T
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    sign = -1.0 if _mirrors(linear) else 1.0
    return unit_rows(sign * normals @ cofactors.T)


def _request(points: SurfacePoints, ground: float | None) -> Request:
    """The points as the tracer wants them."""
    return Request(
        positions=points.positions,
        normals=points.normals,
        geometric=points.geometric,
        numbers=points.numbers,
        ground=ground,
    )


def _watched(points: SurfacePoints, scene: Scene, surfaces: Sequence[Surface]) -> Watched | None:
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


def _detail_at(positions: FloatArray, scene: Scene, prepared: Prepared) -> FloatArray:
    """The detail around points: as they are watched for, or as the nearest vertex has it, else any."""
    if prepared.watched is not None:
        return np.full(len(positions), prepared.watched.detail)
    vertices = vertex_points(scene, prepared)
    found, _ = regions(vertices.positions, vertices.detail, prepared.world.frame)
    if len(found) == 1:
        return np.full(len(positions), np.inf)
    return detail_beside(positions, vertices.positions, vertices.detail)


def _traced(
    prepared: Prepared,
    points: SurfacePoints,
    ground: float | None,
    settings: BakeSettings,
    progress: Callable[[int, int], None] | None,
) -> Estimates:
    """Estimates at all points: in one world for what float32 resolves there, in further ones for the rest."""
    found, unresolved = regions(points.positions, points.detail, prepared.world.frame)
    if len(found) == 1:
        return estimate(prepared.world, _request(points, ground), settings, progress)
    result = Estimates.blank(len(points))
    done = 0
    for center, chosen in found:
        world = prepared.world
        if center is not None:
            world = build_world(prepared.parts, prepared.placements, center, prepared.watched)
        before = done

        def report(some: int, _: int, before: int = before) -> None:
            if progress is not None:
                progress(before + some, len(points))

        part = estimate(world, _request(points.only(chosen), ground), settings, report)
        result.mean[chosen], result.standard_error[chosen] = part.mean, part.standard_error
        result.rays[chosen], result.states[chosen] = part.rays, part.states
        done += len(chosen)
    result.states[unresolved] = UNRESOLVED
    return result


def _lowest(scene: Scene, prepared: Prepared, settings: BakeSettings) -> float | None:
    """The height of the lowest surface along the axis of the ground; None where there is no ground."""
    if settings.ground is None:
        return None
    axis = "xyz".index(settings.ground[1])
    lowest = np.inf
    for (_, mesh), stands in zip(scene.placed(), prepared.placed, strict=True):
        if stands is not None and len(stands[1].faces):
            used = mesh.vertices[np.unique(stands[1].faces)]
            row = stands[0].transform[axis]
            lowest = min(lowest, float((used @ row[:3]).min()) + float(row[3]))
    return lowest if np.isfinite(lowest) else None


def _per_instance(
    scene: Scene, prepared: Prepared, found: Estimates
) -> tuple[list[NDArray[np.float32]], list[NDArray[np.float32]]]:
    """Values and errors, one array per instance; vertices that share a place and a normal share them."""
    means, errors = [], []
    first = 0
    for (instance, mesh), stands in zip(scene.placed(), prepared.placed, strict=True):
        mean, error = (
            np.ones(len(mesh.vertices), np.float32),
            np.zeros(len(mesh.vertices), np.float32),
        )
        if stands is not None:
            asked = np.flatnonzero(_asked(instance, stands[1]))
            mean[asked] = found.mean[first : first + len(asked)]
            error[asked] = found.standard_error[first : first + len(asked)]
            mean, error = mean[stands[1].same_as], error[stands[1].same_as]
            first += len(asked)
        means.append(mean)
        errors.append(error)
    return means, errors


def _findings(scene: Scene, prepared: Prepared, found: Estimates) -> tuple[Finding, ...]:
    """What was found about the meshes, then about the points of each instance."""
    kinds: dict[FindingKind, int] = {
        "sliver": SLIVERS,
        "contact": CONTACT,
        "thin": THIN,
        "unresolved": UNRESOLVED,
        "doubtful": DOUBTFUL,
        "enclosed": ENCLOSED,
    }
    lines = [finding for surface in prepared.surfaces for finding in surface.findings]
    first = 0
    for number, stands in enumerate(prepared.placed):
        if stands is None:
            continue
        asked = np.flatnonzero(_asked(*stands))
        states = found.states[first : first + len(asked)]
        first += len(asked)
        for kind, state in kinds.items():
            marks = np.zeros(len(stands[1].asked), bool)
            marks[asked[states == state]] = True
            lines += findings(_name(scene, number), {kind: marks})
    return tuple(lines)


def _name(scene: Scene, number: int) -> str:
    """What a user would call an instance."""
    instance = scene.instances[number]
    mesh = scene.meshes[instance.mesh].name
    if instance.name and instance.name != mesh:
        return f"{instance.name!r}"
    return f"mesh {mesh!r}" if mesh else f"mesh {instance.mesh}"


def _refuse(scene: Scene, found: Sequence[Finding]) -> None:
    """Raise InputError for the first finding: the caller asked for strictness."""
    if found:
        who = f"{scene.source.path}: " if scene.source else ""
        more = f" And {len(found) - 1} more findings." if len(found) > 1 else ""
        raise InputError(f"{who}{found[0]}{more} Mend the asset, or bake it without strict.")

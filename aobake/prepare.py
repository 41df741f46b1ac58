"""A scene made ready for tracing: surfaces with one front each, placed, in one built world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError, SettingsError
from aobake.findings import Finding
from aobake.meshes.alpha import NO_ALPHA, SceneAlpha, scene_alpha
from aobake.meshes.extent import diagonal
from aobake.meshes.holes import occluding_parts
from aobake.meshes.normals import unit_rows
from aobake.meshes.scene import Instance, Mesh, Scene
from aobake.meshes.surface import Surface
from aobake.occluders import alone, occluding
from aobake.overrides import forced
from aobake.settings import TraceSettings
from aobake.tracing.world import Placement, Triangles, Watched, World, build_world

__all__ = [
    "Prepared",
    "build",
    "in_scene_units",
    "lowest",
    "name_of",
    "placed_nowhere",
    "refuse",
    "turned_normals",
    "turning",
]

FloatArray = NDArray[np.float64]
SettingsT = TypeVar("SettingsT", bound=TraceSettings)

FARTHEST = float(np.finfo(np.float32).max)  # a distance that can still be kept


@dataclass(frozen=True, eq=False, kw_only=True)
class Spaces:
    """The spaces of all instances, their matrices below each other.

    linear, turning : (3 I, 3) float64, what is done to positions, before the shift, and to normals
    shift : (I, 3) float64
    """

    linear: FloatArray
    turning: FloatArray
    shift: FloatArray


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scene made ready: a surface per mesh, where instances stand, the built world.

    placements : what occludes; placed : what is baked
    own : where each instance is occluded by itself alone, its own placements; None: all are occluded by all
    reach : how far a ray counts at most in a mean distance, in scene units; None: nobody asks for one
    warnings : what could not be used, one line each
    """

    surfaces: Sequence[Surface]
    parts: Sequence[Triangles]
    placements: Sequence[Placement]
    placed: Sequence[tuple[Instance, Surface] | None]
    world: World
    watched: Watched | None
    own: Sequence[Sequence[Placement]] | None
    reach: float | None
    warnings: tuple[str, ...]

    @cached_property
    def spaces(self) -> Spaces:
        """Where each instance of the scene stands; anything for those that stand nowhere."""
        transforms = [np.eye(4) if found is None else found[0].transform for found in self.placed]
        linear = np.array([transform[:3, :3] for transform in transforms]).reshape(-1, 3)
        return Spaces(
            linear=linear,
            turning=np.array([turning(t[:3, :3]) for t in transforms]).reshape(-1, 3),
            shift=np.array([transform[:3, 3] for transform in transforms]).reshape(-1, 3),
        )


def in_scene_units(scene: Scene, settings: SettingsT) -> SettingsT:
    """The settings with a max_distance that was given in per cent of the scene's diagonal as a length.

    Raises SettingsError where the scene has no size.
    """
    given: object = settings.max_distance
    if not isinstance(given, str):
        return settings
    length = diagonal(scene) * float(given.rstrip("%")) / 100.0
    if not (length > 0.0 and np.isfinite(length)):
        raise SettingsError(f"max_distance is {given!r}, but the scene has no size; give a length.")
    return replace(settings, max_distance=length)


def build(
    scene: Scene,
    surfaces: Sequence[Surface],
    settings: TraceSettings,
    watched: Watched | None = None,
) -> Prepared:
    """Put every instance that occludes into one world. Mirrored ones get faces of their own, wound back.

    Raises SettingsError where occluders or exclude name what is not there; InputError where settings.strict
    is on and an alpha texture cannot be used.
    """
    alpha = _alpha(scene, settings)
    parts: dict[tuple[int, bool], range] = {}
    triangles: list[Triangles] = []
    placed: list[tuple[Instance, Surface] | None] = []
    own: list[list[Placement]] = [[] for _ in scene.instances]
    occludes = occluding(scene, settings)
    for number, (instance, mesh) in enumerate(scene.placed()):
        transform, surface = instance.transform[:3], surfaces[instance.mesh]
        if not np.isfinite(transform).all():
            placed.append(None)
            continue
        placed.append((instance, surface))
        key = (instance.mesh, mirrors(transform[:, :3]))
        if key not in parts:
            found = occluding_parts(
                mesh,
                surface,
                alpha.meshes.get(instance.mesh),
                mirrored=key[1],
                one_sided=settings.backfaces == "ignore" and not _double_sided(scene, mesh),
            )
            parts[key] = range(len(triangles), len(triangles) + len(found))
            triangles += found
        if occludes[number]:
            own[number] = [Placement(part, transform) for part in parts[key]]
    by_themselves = alone(settings)
    placements = [] if by_themselves else [placement for some in own for placement in some]
    world = build_world(triangles, placements, watched=watched)
    return Prepared(
        surfaces,
        triangles,
        placements,
        placed,
        world,
        watched,
        own if by_themselves else None,
        _reach(scene, settings),
        alpha.warnings,
    )


def _reach(scene: Scene, settings: TraceSettings) -> float | None:
    """What stands for the distance of a ray that meets nothing."""
    if not settings.mean_distance:
        return None
    length = diagonal(scene) if settings.max_distance is None else settings.max_distance
    return min(length, FARTHEST)


def _alpha(scene: Scene, settings: TraceSettings) -> SceneAlpha:
    """What the alpha of the scene's materials comes to, if anybody wants to know.

    Raises InputError where settings.strict is on and a part of it is missing or broken.
    """
    if forced(settings.effect).get("alpha") is False:
        return NO_ALPHA
    found = scene_alpha(scene)
    if found.warnings and settings.strict:
        who = f"{scene.source.path}: " if scene.source else ""
        raise InputError(f"{who}{found.warnings[0]} Mend the asset, or bake it without strict.")
    return found


def _double_sided(scene: Scene, mesh: Mesh) -> bool:
    return mesh.material is not None and scene.materials[mesh.material].double_sided


def mirrors(linear: FloatArray) -> bool:
    """Whether a (3, 3) map turns right hands into left ones, however small it makes them."""
    size = float(np.abs(linear).max()) or 1.0
    return bool(np.linalg.det(linear / size) < 0.0)


def turned_normals(normals: FloatArray, linear: FloatArray) -> FloatArray:
    """(N, 3) unit normals after a linear map."""
    if np.array_equal(linear, np.eye(3)):
        return normals
    return unit_rows(normals @ turning(linear).T)


def turning(linear: FloatArray) -> FloatArray:
    """(3, 3) what a linear map does to normals, up to a factor: its cofactors, which a flattening one has too."""
    size = float(np.abs(linear).max()) or 1.0
    a, b, c = (linear / size).T
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    return -cofactors if mirrors(linear) else cofactors


def lowest(scene: Scene, prepared: Prepared, settings: TraceSettings) -> float | None:
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


def name_of(scene: Scene, number: int) -> str:
    """What a user would call an instance."""
    instance = scene.instances[number]
    mesh = scene.meshes[instance.mesh].name
    if instance.name and instance.name != mesh:
        return f"{instance.name!r}"
    return f"mesh {mesh!r}" if mesh else f"mesh {instance.mesh}"


def placed_nowhere(scene: Scene) -> list[str]:
    """A line for each instance whose transform puts it nowhere."""
    return [
        f"{name_of(scene, number)}: its transform is not finite; it was passed over."
        for number, instance in enumerate(scene.instances)
        if not np.isfinite(instance.transform).all()
    ]


def refuse(scene: Scene, found: Sequence[Finding]) -> None:
    """Raise InputError for the first of any findings: the caller asked for strictness."""
    if found:
        who = f"{scene.source.path}: " if scene.source else ""
        more = f" And {len(found) - 1} more findings." if len(found) > 1 else ""
        raise InputError(f"{who}{found[0]}{more} Mend the asset, or bake it without strict.")

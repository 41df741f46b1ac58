"""Surface points: vertices or texels, the same thing from here on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.errors import InputError
from aobake.meshes.normals import unit_rows
from aobake.meshes.scene import Instance, Scene
from aobake.meshes.surface import Surface
from aobake.prepare import Prepared, turned_normals
from aobake.tracing.interpolation import interpolate
from aobake.tracing.rows import any_in_rows

__all__ = ["SurfacePoints", "asked_vertices", "given_points", "points_on_faces", "vertex_points"]

FloatArray = NDArray[np.float64]

# Detail that float32 resolves on an instance: its transform errs by 8 half-ulps.
INSTANCED = 1.0 / 8.0


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfacePoints:
    """Where ambient occlusion is asked for.

    positions : (P, 3) float64, in the scene's space, finite
    normals : (P, 3) float64, unit length; the integral is taken over the hemisphere around them
    geometric : (P, 3) float64, unit length: directions below the surface itself do not count; or None
    detail : (P,) float64, the size of what is to be told apart around each point; infinite: anything
    numbers : (P,) int64, the index that makes a point's directions its own
    owners : (P,) int32, the instance that each point is on; -1: none
    """

    positions: FloatArray
    normals: FloatArray
    geometric: FloatArray | None
    detail: FloatArray
    numbers: NDArray[np.int64]
    owners: NDArray[np.int32]

    def only(self, chosen: NDArray[np.int64]) -> SurfacePoints:
        """Some of the points, by their place in these arrays, which rises; itself where that is all of them."""
        if len(chosen) == len(self):
            return self
        return SurfacePoints(
            positions=self.positions[chosen],
            normals=self.normals[chosen],
            geometric=None if self.geometric is None else self.geometric[chosen],
            detail=self.detail[chosen],
            numbers=self.numbers[chosen],
            owners=self.owners[chosen],
        )

    def __len__(self) -> int:
        return len(self.positions)


def given_points(
    positions: ArrayLike, normals: ArrayLike, geometric_normals: ArrayLike | None
) -> tuple[SurfacePoints, int]:
    """The usable ones of points that a caller gives, numbered as given; and how many were given.

    positions, normals, geometric_normals : (P, 3) float; a point is usable where they are finite and
        the normals not zero
    Raises InputError for arrays of other shapes.
    """
    at = _rows("positions", positions)
    around = _matching("normals", normals, at)
    usable = np.isfinite(at).all(axis=1) & around.any(axis=1)
    above = None
    if geometric_normals is not None:
        above = _matching("geometric_normals", geometric_normals, at)
        usable &= above.any(axis=1)
    chosen = np.flatnonzero(usable)
    points = SurfacePoints(
        positions=at[chosen],
        normals=around[chosen],
        geometric=None if above is None else above[chosen],
        detail=np.full(len(chosen), np.inf),
        numbers=chosen,
        owners=np.full(len(chosen), -1, np.int32),
    )
    return points, len(at)


def vertex_points(scene: Scene, prepared: Prepared) -> SurfacePoints:
    """The vertices to trace from, instance by instance; numbered as they stand in the whole scene."""
    asked = [
        np.zeros(0, np.int64) if stands is None else np.flatnonzero(asked_vertices(*stands))
        for stands in prepared.placed
    ]
    ends = np.cumsum([len(chosen) for chosen in asked], dtype=np.int64)
    points = _room_for(int(ends[-1]) if len(ends) else 0)
    stretches = stretch_of_instances(scene)
    first = 0
    for number, (instance, mesh) in enumerate(scene.placed()):
        stands, chosen = prepared.placed[number], asked[number]
        if stands is not None:
            linear, shift = instance.transform[:3, :3], instance.transform[:3, 3]
            rows = slice(ends[number] - len(chosen), ends[number])
            # take: a third of the time that indexing rows takes
            at = mesh.vertices.take(chosen, axis=0)
            unmoved = np.array_equal(instance.transform, np.eye(4))
            points.positions[rows] = at if unmoved else at @ linear.T + shift
            own = stands[1].normals.take(chosen, axis=0)
            points.normals[rows] = turned_normals(own, linear)
            points.detail[rows] = stretches[number] * stands[1].detail[chosen]
            points.numbers[rows] = chosen + first
            points.owners[rows] = number
        first += len(mesh.vertices)
    return points


def _room_for(count: int) -> SurfacePoints:
    return SurfacePoints(
        positions=np.empty((count, 3)),
        normals=np.empty((count, 3)),
        geometric=None,
        detail=np.empty(count),
        numbers=np.empty(count, np.int64),
        owners=np.empty(count, np.int32),
    )


def asked_vertices(instance: Instance, surface: Surface) -> NDArray[np.bool_]:
    """(V,) the vertices to trace from; none where the transform leaves their normals no direction."""
    turned = turned_normals(surface.normals, instance.transform[:3, :3])
    return surface.asked & any_in_rows(turned)


def points_on_faces(
    scene: Scene,
    prepared: Prepared,
    instances: NDArray[np.int32],
    faces: NDArray[np.int32],
    weights: FloatArray,
    numbers: NDArray[np.int64],
) -> SurfacePoints:
    """Points on the faces of instances, with interpolated normals.

    instances, faces : (P,) int32, an instance that stands somewhere, and a face of its mesh with an area
    weights : (P, 2) float64, of the second and the third corner of the face
    numbers : (P,) int64, the index that makes a point's directions its own
    """
    points = _room_for(len(instances))
    points = replace(
        points, geometric=np.empty((len(instances), 3)), numbers=numbers, owners=instances
    )
    spaces = prepared.spaces
    stretches = stretch_of_instances(scene)
    meshes = np.array([instance.mesh for instance in scene.instances], np.int32)[instances]
    order = np.argsort(meshes, kind="stable")
    ends = np.searchsorted(meshes[order], np.arange(len(scene.meshes) + 1))
    for number in np.unique(meshes).tolist():
        mesh, surface = scene.meshes[number], prepared.surfaces[number]
        interpolate(
            (mesh.faces, mesh.vertices, surface.normals, surface.detail),
            (spaces.linear, spaces.turning, spaces.shift, stretches),
            order[ends[number] : ends[number + 1]],
            instances,
            faces,
            weights,
            (points.positions, points.normals, points.geometric, points.detail),
        )
    return points


def stretch_of_instances(scene: Scene) -> FloatArray:
    """(I,) what the detail of a mesh is multiplied by where each instance stands."""
    mesh = np.array([instance.mesh for instance in scene.instances], np.int64)
    uses = np.bincount(mesh, minlength=len(scene.meshes))
    linear = np.array([instance.transform[:3, :3] for instance in scene.instances])
    with np.errstate(invalid="ignore"):  # of an instance that stands nowhere
        reach = np.abs(linear.reshape(-1, 3, 3)).sum(axis=2).max(axis=1)
    return np.asarray(np.where(uses[mesh] > 1, INSTANCED, 1.0) * reach, np.float64)


def _rows(name: str, values: ArrayLike) -> FloatArray:
    try:
        array = np.ascontiguousarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} are no array of numbers ({error}).") from error
    if array.size == 0:
        return np.zeros((0, 3))
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{name} have the shape {array.shape}; (P, 3) is needed.")
    return array


def _matching(name: str, values: ArrayLike, positions: FloatArray) -> FloatArray:
    vectors = _rows(name, values)
    if len(vectors) != len(positions):
        raise InputError(
            f"there are {len(vectors)} {name} for {len(positions)} positions; one each is needed."
        )
    return unit_rows(vectors)

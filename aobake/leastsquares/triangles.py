"""All triangles that stand in a scene, with the unknown at each corner: what a fit is made over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.scene import FloatArray, Scene
from aobake.points import asked_vertices
from aobake.prepare import Prepared

__all__ = ["FittedTriangles", "fitted_triangles"]


@dataclass(frozen=True, eq=False, kw_only=True)
class FittedTriangles:
    """Triangles of every instance that have an area and a normal at each corner.

    instances, faces : (T,) int32, where each one is from
    corners : (T, 3) int64, their unknowns: vertices that are traced from, as points.vertex_points counts
        them; vertices with one place and one normal share one, the two sides of a hard edge do not
    places : (T, 3, 3) float64, their corners, scaled so that the largest coordinate is 1
    areas : (T,) float64, of the same, all together 1
    unknowns : how many there are
    """

    instances: NDArray[np.int32]
    faces: NDArray[np.int32]
    corners: NDArray[np.int64]
    places: FloatArray
    areas: FloatArray
    unknowns: int

    def __len__(self) -> int:
        return len(self.faces)


def fitted_triangles(scene: Scene, prepared: Prepared) -> FittedTriangles:
    """The triangles of a scene; none where it has none."""
    parts = []
    first = 0
    for number, stands in enumerate(prepared.placed):
        if stands is None:
            continue
        instance, surface = stands
        mesh = scene.meshes[instance.mesh]
        asked = asked_vertices(instance, surface)
        unknown = np.where(asked, first + np.cumsum(asked) - 1, -1)[surface.same_as]
        first += int(asked.sum())
        corners = unknown[mesh.faces].reshape(-1, 3)
        usable = np.flatnonzero((corners >= 0).all(axis=1))
        linear, shift = instance.transform[:3, :3], instance.transform[:3, 3]
        places = (mesh.vertices @ linear.T + shift)[mesh.faces[usable]]
        parts.append((np.full(len(usable), number), usable, corners[usable], places))
    if not parts:
        return FittedTriangles(
            instances=np.zeros(0, np.int32),
            faces=np.zeros(0, np.int32),
            corners=np.zeros((0, 3), np.int64),
            places=np.zeros((0, 3, 3)),
            areas=np.zeros(0),
            unknowns=first,
        )
    instances, faces, corners, places = (np.concatenate(part) for part in zip(*parts, strict=True))
    return _with_area(instances, faces, corners, places, first)


def _with_area(
    instances: NDArray[np.int64],
    faces: NDArray[np.int64],
    corners: NDArray[np.int64],
    places: FloatArray,
    unknowns: int,
) -> FittedTriangles:
    """Those of the triangles that have an area which float64 can tell."""
    places = places - places.mean(axis=(0, 1)) if len(places) else places
    places = places / (np.abs(places).max(initial=0.0) or 1.0)
    sides = places[:, 1:] - places[:, :1]
    areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    chosen = np.flatnonzero(areas > 0.0)
    return FittedTriangles(
        instances=instances[chosen].astype(np.int32),
        faces=faces[chosen].astype(np.int32),
        corners=corners[chosen],
        places=places[chosen],
        areas=areas[chosen] / (areas[chosen].sum() or 1.0),
        unknowns=unknowns,
    )

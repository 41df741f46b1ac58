"""A scene as one mesh in its own space: for new documents of formats that know no instances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.scene import FloatArray, Instance, Mesh, Scene

__all__ = ["Merged", "Part", "merged"]

Row = TypeVar("Row", np.float64, np.int32)
MOST_VERTICES = 2**31 - 1  # indices of PLY files are signed and 32 bits wide


@dataclass(frozen=True, eq=False, kw_only=True)
class Part:
    """One instance of the scene within the merged mesh."""

    name: str
    vertices: int
    faces: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Merged:
    """Every instance of a scene, moved to where it stands.

    vertices : (V, 3) float64     faces : (F, 3) int32     ao : (V,) float32, in the order of the instances
    normals : (V, 3) float64 unit or zero, or None where a mesh gives none
    """

    vertices: FloatArray
    faces: NDArray[np.int32]
    normals: FloatArray | None
    ao: NDArray[np.float32]
    parts: tuple[Part, ...]


def merged(scene: Scene, ao: Sequence[NDArray[np.float32]]) -> Merged:
    """Put all instances of a scene into one mesh.

    ao : one (V_i,) float32 array per instance
    An empty scene gives empty arrays. A mirrored instance has its faces turned, so that its front stays
    its front. Raises OutputError where values and vertices do not match, or there are too many.
    """
    lengths = [len(mesh.vertices) for _, mesh in scene.placed()]
    if [len(values) for values in ao] != lengths:
        raise OutputError(
            "the values do not belong to this scene: one for each vertex of each instance is needed."
        )
    if sum(lengths) > MOST_VERTICES:
        raise OutputError(
            f"{sum(lengths)} vertices do not fit into one mesh of this format. Write GLB instead."
        )
    offsets = np.cumsum([0, *lengths])
    with_normals = all(mesh.normals is not None for _, mesh in scene.placed())
    placed = list(scene.placed())
    return Merged(
        vertices=_joined([_moved(instance, mesh) for instance, mesh in placed]),
        faces=_joined(
            [
                _turned(instance, mesh.faces) + np.int32(offset)
                for (instance, mesh), offset in zip(placed, offsets, strict=False)
            ]
        ).astype(np.int32),
        normals=_joined(
            [_turned_normals(i, mesh.normals) for i, mesh in placed if mesh.normals is not None]
        )
        if with_normals
        else None,
        ao=np.concatenate([np.zeros(0, np.float32), *ao]),
        parts=tuple(
            Part(
                name=instance.name or mesh.name, vertices=len(mesh.vertices), faces=len(mesh.faces)
            )
            for instance, mesh in placed
        ),
    )


def _joined(rows: list[NDArray[Row]]) -> NDArray[Row] | FloatArray:
    return np.concatenate(rows) if rows else np.zeros((0, 3))


def _moved(instance: Instance, mesh: Mesh) -> FloatArray:
    if np.array_equal(instance.transform, np.eye(4)):
        return mesh.vertices  # to the last bit, -0.0 and NaN included
    with np.errstate(invalid="ignore", over="ignore"):
        return mesh.vertices @ instance.transform[:3, :3].T + instance.transform[:3, 3]


def _is_mirrored(instance: Instance) -> bool:
    return bool(np.linalg.det(instance.transform[:3, :3]) < 0)


def _turned(instance: Instance, faces: NDArray[np.int32]) -> NDArray[np.int32]:
    return faces[:, ::-1] if _is_mirrored(instance) else faces


def _turned_normals(instance: Instance, normals: FloatArray) -> FloatArray:
    """Normals are turned by the matrix of cofactors: the inverse transpose, and finite for a flat scale."""
    a, b, c = instance.transform[:3, :3]
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
    with np.errstate(all="ignore"):
        turned = normals @ cofactors.T * (-1.0 if _is_mirrored(instance) else 1.0)
        lengths = np.linalg.norm(turned, axis=1, keepdims=True)
        unit = np.where(lengths > 0, turned / lengths, 0.0)
    return np.where(np.isfinite(unit), unit, 0.0)

"""Grids of points as smooth surfaces, and curves as rows of points: what the shapes are made of."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from aobake.meshes.scene import FloatArray, IntArray

__all__ = ["Patch", "grid", "joined", "rounded_path"]


@dataclass(frozen=True, eq=False)
class Patch:
    """Triangles with normals; vertices and normals (V, 3) float64, faces (F, 3) int32."""

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Patch:
        """The same patch somewhere else."""
        return Patch(self.vertices + np.array([x, y, z]), self.faces, self.normals)


def joined(*patches: Patch) -> Patch:
    """Several patches as one, with the edges between them as sharp as they were."""
    starts = np.cumsum([0] + [len(patch.vertices) for patch in patches[:-1]])
    return Patch(
        np.concatenate([patch.vertices for patch in patches]),
        np.concatenate(
            [patch.faces + start for patch, start in zip(patches, starts, strict=True)]
        ).astype(np.int32),
        np.concatenate([patch.normals for patch in patches]),
    )


def grid(points: FloatArray, *, closed: bool = False) -> Patch:
    """A smooth patch through a grid of points.

    points : (R, C, 3) float64; seen from the front, columns run to the right and rows run upwards
    closed : the last column lies on the first one, and the surface is smooth across it
    A row whose points all coincide becomes the tip of a fan. Normals are weighted by area, so that
    the large faces beside a narrow rounding stay flat to the eye.
    """
    rows, columns, _ = points.shape
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    quads = np.stack([a, b, c, d], -1).reshape(-1, 4)
    vertices = points.reshape(-1, 3)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    twice_area = np.linalg.norm(_crosses(vertices, faces), axis=1)
    faces = faces[twice_area > 1e-9 * max(float(twice_area.max()), 1e-300)]
    faces = faces[np.argsort(faces[:, 0], kind="stable")]
    normals = np.zeros_like(vertices)
    crosses = _crosses(vertices, faces)
    for k in range(3):
        np.add.at(normals, faces[:, k], crosses)
    sums = normals.reshape(rows, columns, 3)
    if closed:
        sums[:, 0] = sums[:, -1] = sums[:, 0] + sums[:, -1]
    for row in (0, -1):
        if np.ptp(points[row], axis=0).max() < 1e-9:
            sums[row] = sums[row].sum(axis=0)
    return _used(vertices, faces, normals)


def rounded_path(corners: FloatArray, radius: float, step: float, segments: int = 2) -> FloatArray:
    """A polyline with rounded corners and short pieces.

    corners : (N, 2) float64, of which the first and the last stay as they are
    radius : of the roundings, halved where a side is too short; step : longest piece of a side
    """
    points = [corners[0]]
    for before, corner, after in zip(corners, corners[1:], corners[2:], strict=False):
        points.extend(_rounding(before, corner, after, radius, segments))
    points.append(corners[-1])
    pieces = [points[:1]]
    for start, end in pairwise(points):
        count = max(1, int(np.ceil(np.linalg.norm(end - start) / step - 1e-9)))
        pieces.append(list(start + np.outer(np.arange(1, count + 1) / count, end - start)))
    return np.array([point for piece in pieces for point in piece])


def _rounding(
    before: FloatArray, corner: FloatArray, after: FloatArray, radius: float, segments: int
) -> list[FloatArray]:
    to_before, to_after = before - corner, after - corner
    shorter = min(np.linalg.norm(to_before), np.linalg.norm(to_after))
    cut = min(radius, 0.45 * float(shorter))
    start = corner + cut * to_before / np.linalg.norm(to_before)
    end = corner + cut * to_after / np.linalg.norm(to_after)
    t = np.linspace(0.0, 1.0, segments + 1)[:, None]
    return list((1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end)  # a parabola


def _crosses(vertices: FloatArray, faces: IntArray) -> FloatArray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _used(vertices: FloatArray, faces: IntArray, normals: FloatArray) -> Patch:
    """Without the vertices that no face needs."""
    used, packed = np.unique(faces, return_inverse=True)
    lengths = np.linalg.norm(normals[used], axis=1, keepdims=True)
    return Patch(
        vertices[used], packed.reshape(faces.shape).astype(np.int32), normals[used] / lengths
    )

"""Tangent frames as MikkTSpace defines them, and the normals that normal maps mean by them.

Source: M. Mikkelsen, Simulation of wrinkled surfaces revisited, 2008, and the reference implementation
mikktspace.c, 2011. Normal maps are baked against exactly these frames, so that any others would show. Its
default threshold of 180 degrees parts faces of a group whose tangents are exact opposites, as around the
pole of a sphere; here such a group, which has no direction as a whole, gets any one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.tangent_kernels import ANY, PRESERVING, UNUSABLE, sew, share_tangents
from aobake.meshes.coincident import first_equal_row
from aobake.meshes.normals import unit_rows
from aobake.meshes.scene import FloatArray, IntArray
from aobake.prepare import mirrors

__all__ = ["in_tangent_space", "normal_mapped", "placed_tangents", "tangents_at_corners"]

HORIZON = 0.01  # least cosine between a mapped normal and the surface's own


def tangents_at_corners(positions: FloatArray, normals: FloatArray, uv: FloatArray) -> FloatArray:
    """(F, 3, 4) unit tangents, in the direction of growing u, and the sign w of the bitangent.

    positions, normals, uv : (F, 3, 3), (F, 3, 3) of unit length, (F, 3, 2), at the corners of each face;
        v runs down, and the bitangent w cross(normal, tangent) runs up the image, as glTF has it
    A corner whose texture coordinates tell no direction gets any one across its normal, with w = 1. No
    faces give an empty array.
    """
    frames = np.zeros((len(positions), 3, 4))
    if len(positions):
        _fill(positions, normals, uv, frames)
        frames[..., 3] *= -1.0  # MikkTSpace takes v to run up
    lost = ~frames[..., :3].any(axis=2)
    frames[lost, :3] = _any_across(normals[lost])
    frames[lost, 3] = 1.0
    return frames


def placed_tangents(
    frames: FloatArray, faces: IntArray, weights: FloatArray, linear: FloatArray
) -> FloatArray:
    """(N, 4) tangents of any length, and the bitangent's sign, at points of a mesh where it stands.

    frames : (F, 3, 4) at corners; faces, weights : (N,) and (N, 2), of the second and third corner
    linear : (3, 3) what is done to directions of the mesh
    """
    shares = np.stack([1.0 - weights.sum(axis=1), weights[:, 0], weights[:, 1]], axis=1)
    tangents: FloatArray = np.einsum("tc,tcx->tx", shares, frames[faces])
    tangents[:, :3] = tangents[:, :3] @ linear.T
    if mirrors(linear):
        tangents[:, 3] *= -1.0
    return tangents


def normal_mapped(
    stored: NDArray[np.float32],
    scale: float,
    tangents: FloatArray,
    normals: FloatArray,
    geometric: FloatArray,
) -> FloatArray:
    """(N, 3) unit normals that a normal map turns others to; none is turned below the surface.

    stored : (N, 3) the map's values in [0, 1], as they are in the image
    scale : of their first two components
    tangents : (N, 4) direction of any length, and the bitangent's sign, interpolated
    normals, geometric : (N, 3) unit length; those that are shaded with, and those of the surface itself
    Source: glTF 2.0, 3.9.3, and its appendix B on bitangents.
    """
    x, y, z = np.moveaxis(2.0 * stored.astype(np.float64) - 1.0, 1, 0)[..., None]
    along, up = _axes(tangents, normals)
    turned = unit_rows(scale * (x * along + y * up) + z * normals)
    turned = np.where(turned.any(axis=1, keepdims=True), turned, normals)
    height = _dot(turned, geometric)
    level = unit_rows(turned - height * geometric)
    raised = HORIZON * geometric + np.sqrt(1.0 - HORIZON**2) * level
    return np.where(height < HORIZON, unit_rows(raised), turned)


def in_tangent_space(
    directions: FloatArray, tangents: FloatArray, normals: FloatArray
) -> FloatArray:
    """(N, 3) directions along the tangent, the bitangent and the normal: what a normal map holds of them.

    directions : (N, 3); tangents : (N, 4) as for normal_mapped; normals : (N, 3) unit length
    """
    along, up = _axes(tangents, normals)
    parts = [_dot(directions, axis) for axis in (along, up, normals)]
    return np.concatenate(parts, axis=1)


def _axes(tangents: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(N, 3) unit tangents and bitangents, across unit normals."""
    along = unit_rows(tangents[:, :3] - _dot(tangents[:, :3], normals) * normals)
    return along, np.cross(normals, along) * np.where(tangents[:, 3:] < 0.0, -1.0, 1.0)


def _fill(positions: FloatArray, normals: FloatArray, uv: FloatArray, frames: FloatArray) -> None:
    count = len(positions)
    vertex = first_equal_row(np.concatenate([positions, normals, uv], axis=2).reshape(-1, 8))
    vertex = vertex.reshape(-1, 3)
    along, state = _directions(positions, uv)
    share_tangents(
        np.concatenate([positions, normals], axis=2),
        along,
        state,
        vertex,
        _neighbours(vertex, state),
        np.empty(2 * count + 2, np.int64),
        np.empty(count, np.int64),
        frames,
    )
    _lend(vertex, state, frames)


def _directions(positions: FloatArray, uv: FloatArray) -> tuple[FloatArray, NDArray[np.uint8]]:
    """(F, 3) unit directions of growing u, and (F,) what each face can contribute.

    Source: Mikkelsen 2008, equation 18; mikktspace.c, InitTriInfo.
    """
    ahead, back = positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]
    s, t = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]
    along = t[:, 1:] * ahead - s[:, 1:] * back
    across = s[:, :1] * back - t[:, :1] * ahead
    flat = (area == 0.0) | ~along.any(axis=1) | ~across.any(axis=1)
    a, b, c = positions[:, 0], positions[:, 1], positions[:, 2]
    unusable = (a == b).all(axis=1) | (b == c).all(axis=1) | (c == a).all(axis=1)
    unusable |= ~np.isfinite(along).all(axis=1)
    state = (PRESERVING * (area > 0.0) + ANY * flat).astype(np.uint8)
    state[unusable] = UNUSABLE
    return unit_rows(np.where(area > 0.0, 1.0, -1.0)[:, None] * along), state


def _neighbours(vertex: NDArray[np.int32], state: NDArray[np.uint8]) -> NDArray[np.int32]:
    """(3 F,) int32, the half-edge on the other side of each that runs against it; -1: none does."""
    ends = np.stack([vertex, np.roll(vertex, -1, axis=1)], axis=2).reshape(-1, 2)
    edge = first_equal_row(np.sort(ends, axis=1).astype(np.uint32))
    order = np.argsort(edge, kind="stable")
    order = order[state[order // 3] != UNUSABLE]
    across = np.full(len(edge), -1, np.int32)
    sew(order, edge, ends[:, 0] < ends[:, 1], across)
    return across


def _lend(vertex: NDArray[np.int32], state: NDArray[np.uint8], frames: FloatArray) -> None:
    """Give the corners of faces that took no part the frame of the first corner that agrees with them."""
    flat = frames.reshape(-1, 4)
    unusable = np.repeat(state == UNUSABLE, 3)
    sound = np.flatnonzero(~unusable)
    first = np.full(vertex.size, -1, np.int64)
    first[vertex.reshape(-1)[sound[::-1]]] = sound[::-1]
    lender = first[vertex.reshape(-1)]
    borrowing = np.flatnonzero(unusable & (lender >= 0))
    flat[borrowing] = flat[lender[borrowing]]


def _any_across(normals: FloatArray) -> FloatArray:
    """(N, 3) unit vectors across unit normals."""
    axis = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    return unit_rows(np.cross(normals, axis))


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray((a * b).sum(axis=1, keepdims=True))

"""Rays one by one: the directions of a point made anew, a slow tracer in float64, bare packets, origins."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.tracing import embree
from aobake.tracing.compiled import aligned, kernel
from aobake.tracing.contacts import note_triangle
from aobake.tracing.foreign import call_packet
from aobake.tracing.origins import place_origins, scratch
from aobake.tracing.sampling import direction_sets
from aobake.tracing.world import Placement, Triangles, World, build_world
from tests import scenes
from tests.scenes import FloatArray

BITS = 2**64 - 1


def mixed_bits(seed: int, index: int) -> int:
    """SplitMix64 of a seed and an index, in whole numbers of any size."""
    z = (seed * 0xD1342543DE82EF95 + index) & BITS
    for _ in range(2):
        z = (z + 0x9E3779B97F4A7C15) & BITS
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & BITS
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & BITS
        z ^= z >> 31
    return z


def directions_of(seed: int, index: int, normal: ArrayLike, rays: int) -> FloatArray:
    """(rays, 3) the directions in which a point is looked from, in float64: a set, turned about the normal."""
    bits = mixed_bits(seed, index)
    chosen = direction_sets(rays)
    local = (
        chosen[bits & (len(chosen) - 1)].transpose(0, 2, 1).reshape(-1, 3)[:rays].astype(np.float64)
    )
    x, y, z = scenes.unit(normal)
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    tangent = np.array([1.0 + sign * x * x * a, sign * x * y * a, -sign * x])
    bitangent = np.array([x * y * a, sign + y * y * a, -y])
    angle = (bits >> 11) * (2.0 * math.pi / 2.0**53)
    c, s = math.cos(angle), math.sin(angle)
    frame = np.stack([c * tangent + s * bitangent, c * bitangent - s * tangent, (x, y, z)])
    return np.asarray(local @ frame)


def sums_of(values: FloatArray) -> FloatArray:
    """(P, 5) what kernels.trace adds up for points whose rays have these values, (P, rays), and all count."""
    count, rays = values.shape
    packets = values[:, : rays // 8 * 8].reshape(count, -1, 8)
    apart = (packets[:, :, :, None] - packets[:, :, None, :]) ** 2
    return np.column_stack(
        [
            values.sum(axis=1),
            (np.diff(values, axis=1) ** 2).sum(axis=1),
            np.full(count, rays),
            0.5 * apart.sum(axis=(1, 2, 3)),
            np.full(count, rays // 8),
        ]
    )


def brute_force(
    origins: FloatArray, directions: FloatArray, mesh: scenes.Triangles, near_edge: float = 1e-5
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(N,) whether each ray meets the mesh, and whether it is too close to an edge or to its start to tell.

    Source: T. Moeller, B. Trumbore, Fast, minimum storage ray/triangle intersection, 1997, in float64.
    """
    hit, close = np.zeros(len(origins), bool), np.zeros(len(origins), bool)
    for a, b, c in mesh.vertices[mesh.faces]:
        p = np.cross(directions, c - a)
        determinant = p @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", origins - a, p) / determinant
            q = np.cross(origins - a, b - a)
            v = np.einsum("ij,ij->i", directions, q) / determinant
            t = q @ (c - a) / determinant
        least = np.minimum(np.minimum(u, v), 1.0 - u - v)
        hit |= (least >= 0.0) & (t > 0.0)
        close |= (np.abs(least) < near_edge) & (t > -near_edge)
        close |= (np.abs(t) < near_edge) & (least > -near_edge)
        close |= ~np.isfinite(t)
    return hit, close


@kernel
def _ask_packets(function, scene, packet, masks, origins, directions, hits):  # type: ignore[no-untyped-def]
    words = packet.view(np.int32)
    for first in range(0, len(origins), 8):
        for k in range(8):
            ray = min(first + k, len(origins) - 1)
            for i in range(3):
                packet[8 * i + k] = origins[ray, i]
                packet[8 * (4 + i) + k] = directions[ray, i]
            packet[24 + k], packet[56 + k], packet[64 + k] = 0.0, 0.0, np.inf
            words[72 + k], words[80 + k], words[88 + k] = -1, 0, 0
            masks[k] = -1
        call_packet(function, masks.ctypes.data, scene, packet.ctypes.data, 0)
        for k in range(min(8, len(origins) - first)):
            hits[first + k] = packet[64 + k] < 0.0


def occluded(
    tree: embree.Tree, origins: NDArray[np.float32], directions: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """(N,) whether each ray meets something, asked in packets of eight as the kernel does."""
    hits = np.zeros(len(origins), bool)
    packet, masks = aligned(96, np.float32), aligned(8, np.int32)
    function = embree.functions().occluded8
    _ask_packets(function, tree.address, packet, masks, origins, directions, hits)
    return hits


def world_of(*meshes: scenes.Triangles) -> World:
    """A built world of meshes that stand where they are."""
    parts = [Triangles(mesh.vertices, mesh.faces.astype(np.uint32)) for mesh in meshes]
    return build_world(parts, [Placement(number, np.eye(3, 4)) for number in range(len(parts))])


@dataclass(frozen=True, eq=False)
class Placed:
    """origins : (P, 3) float64, in the scene's space; states : (P,) uint8 of origins.py"""

    origins: FloatArray
    states: NDArray[np.uint8]


def placed(world: World, points: ArrayLike, normals: ArrayLike) -> Placed:
    """Where the rays of some points start."""
    positions = world.frame.apply(np.asarray(points, np.float64).reshape(-1, 3))
    around = np.ascontiguousarray(np.asarray(normals, np.float64).reshape(-1, 3))
    origins, states = np.empty(positions.shape, np.float32), np.zeros(len(positions), np.uint8)
    functions = (embree.functions().point_query, note_triangle())
    place_origins(
        functions, world.tree.address, world.arrays, positions, around, scratch(), origins, states
    )
    return Placed(origins / world.frame.scale + world.frame.center, states)

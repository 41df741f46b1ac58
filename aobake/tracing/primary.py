"""Rays that a picture asks for, eight at a time: the nearest triangle along each, or whether there is any.

One kernel does both, since Embree's two functions take the same packet: the one to call is an argument.

cast takes 50 % of the processor seconds of a picture of 1280 x 720 with four samples and one light (69,168
triangles); how much of that is Embree's own, and packets of sixteen, are not measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.tracing import embree
from aobake.tracing.compiled import aligned, kernel
from aobake.tracing.foreign import call_packet
from aobake.tracing.kernels import (
    DIRECTION,
    FAR,
    GEOMETRY_ID,
    INSTANCE_ID,
    NEAR,
    ORIGIN,
    RAY_HIT_FLOATS,
    ready,
)

__all__ = ["Hits", "nearest_hits", "reach"]

Float32Array = NDArray[np.float32]
PRIMITIVE_ID, U, V = 17, 15, 16  # rows of RTCHit8


@dataclass(frozen=True, eq=False)
class Hits:
    """The nearest triangle along each ray.

    thing : (N,) int32, the instance, or the geometry where that stands by itself; -1 for a miss
    face : (N,) int32, the triangle of that geometry
    distance : (N,) float32, in lengths of the ray's direction; infinite for a miss
    weights : (3, N) float32, of the three corners
    """

    thing: NDArray[np.int32]
    face: NDArray[np.int32]
    distance: Float32Array
    weights: Float32Array

    def only(self, rows: NDArray[np.int64]) -> Hits:
        """Some of the hits, by their place in these arrays."""
        return Hits(
            self.thing[rows],
            self.face[rows],
            self.distance[rows],
            np.take(self.weights, rows, axis=1),
        )


def nearest_hits(
    tree: embree.Tree, origins: Float32Array, directions: Float32Array, near: Float32Array
) -> Hits:
    """What rays meet first, beyond `near` (N,) along each.

    origins, directions : (3, N) float32, in the tree's space; N = 0 gives empty arrays
    """
    count = origins.shape[1]
    distance = np.full(count, np.inf, np.float32)
    thing, face = np.full(count, -1, np.int32), np.zeros(count, np.int32)
    weights = np.zeros((3, count), np.float32)
    function = embree.functions().intersect8
    _cast(function, tree, (origins, directions, near), (distance, thing, face, weights))
    return Hits(thing, face, distance, weights)


def reach(
    tree: embree.Tree, origins: Float32Array, directions: Float32Array, far: Float32Array
) -> NDArray[np.bool_]:
    """(N,) whether rays get as far as `far` (N,) along each, which may be infinite.

    origins, directions : (3, N) float32, in the tree's space; N = 0 gives an empty array
    """
    distance = np.array(far, np.float32)
    nothing = np.empty(0, np.int32), np.empty(0, np.int32), np.empty((3, 0), np.float32)
    near = np.zeros(origins.shape[1], np.float32)
    function = embree.functions().occluded8
    _cast(function, tree, (origins, directions, near), (distance, *nothing))
    return distance >= 0.0


def _cast(
    function: int,
    tree: embree.Tree,
    rays: tuple[Float32Array, Float32Array, Float32Array],
    out: tuple[Float32Array, NDArray[np.int32], NDArray[np.int32], Float32Array],
) -> None:
    packet = aligned(RAY_HIT_FLOATS, np.float32)
    scratch = packet, packet.view(np.int32), aligned(8, np.int32)
    given = tuple(np.ascontiguousarray(array, np.float32) for array in rays)
    cast(function, tree.address, given, scratch, out)


@kernel
def cast(function, scene, rays, scratch, out):
    """Send rays through Embree in packets of eight neighbours.

    function : address of rtcIntersect8 or of rtcOccluded8
    scene : address of the tree
    rays : origins (3, N), directions (3, N), near ends (N,), all float32
    scratch : a packet, its words, a mask
    out : distances (N,) float32, which hold the far ends before, and -inf behind an occluded ray; things
        (N,), faces (N,) int32 and weights (3, N) float32, as in Hits, or none of these
    """
    origins, directions, near = rays
    packet, words, valid = scratch
    distance, thing, face, weights = out
    ready(packet, words, 8, 0)
    for first in range(0, len(near), 8):
        count = min(8, len(near) - first)
        for k in range(8):
            ray = first + min(k, count - 1)
            valid[k] = -1 if k < count else 0
            for i in range(3):
                packet[8 * (ORIGIN + i) + k] = origins[i, ray]
                packet[8 * (DIRECTION + i) + k] = directions[i, ray]
            packet[8 * NEAR + k] = near[ray]
            packet[8 * FAR + k] = distance[ray]
            words[8 * GEOMETRY_ID + k] = -1
            words[8 * INSTANCE_ID + k] = -1
        call_packet(function, valid.ctypes.data, scene, packet.ctypes.data, 0)
        for k in range(count):
            ray = first + k
            distance[ray] = packet[8 * FAR + k]
            if len(thing) > 0 and words[8 * GEOMETRY_ID + k] != -1:
                placed = words[8 * INSTANCE_ID + k] != -1
                thing[ray] = words[8 * (INSTANCE_ID if placed else GEOMETRY_ID) + k]
                face[ray] = words[8 * PRIMITIVE_ID + k]
                u, v = packet[8 * U + k], packet[8 * V + k]
                weights[0, ray], weights[1, ray], weights[2, ray] = 1.0 - u - v, u, v

"""Embree with nothing around it: packets that are ready before the clock starts, and the calls alone.

The same rays of the same points in the same order as a bake sends, in as many threads. What a bake takes
beyond this is what a bake costs.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

import aobake
from aobake.meshes.surfaces import surfaces_of
from aobake.points import vertex_points
from aobake.prepare import build
from aobake.tracing import embree, kernels, origins
from aobake.tracing.compiled import aligned, kernel
from aobake.tracing.contacts import note_triangle
from aobake.tracing.estimate import processors
from aobake.tracing.foreign import call_packet
from aobake.tracing.sampling import direction_sets

__all__ = ["Bare"]

PACKETS = 1 << 15  # ready-made at a time and thread: 12 MiB


@kernel
def make_packets(origin, normal, numbers, sets, frame, packets):
    """Fill packets (N, 96) with all rays of some points, as kernels.trace makes them."""
    n = 0
    for point in range(len(origin)):
        bits = kernels.mix(0, numbers[point])
        kernels.turned_frame(normal[point], bits, frame)
        chosen = sets[np.int64(bits & np.uint64(len(sets) - 1))]
        for number in range(len(chosen)):
            kernels.ready(packets[n], packets[n].view(np.int32), 8, 0)
            kernels.set_out(packets[n], origin[point], 8, 0)
            kernels.aim(packets[n], chosen[number], frame, np.float32(np.inf), 8, 0)
            n += 1


@kernel
def trace_packets(function, scene, valid, packets):
    """Nothing but the calls."""
    for n in range(len(packets)):
        call_packet(function, valid.ctypes.data, scene, packets[n].ctypes.data, 0)


class Bare:
    """Ready-made packets for the vertices of a scene, traced by threads.

    most_rays : for more than these, blocks of points are left out, evenly over the mesh
    """

    def __init__(
        self,
        scene: aobake.Scene,
        rays: int,
        threads: int | None = None,
        most_rays: int = 1 << 62,
    ) -> None:
        settings = aobake.BakeSettings(rays=rays)
        self.prepared = build(scene, surfaces_of(scene, settings), settings)
        self.sets, self.threads = direction_sets(rays), threads or processors()
        points = vertex_points(scene, self.prepared)
        self.vertices = len(points)
        self.block = max(1, PACKETS // self.sets.shape[1])
        if len(points) * rays > most_rays:
            points = points.only(self._some(len(points), most_rays // rays))
        self.rays = len(points) * rays
        world = self.prepared.world
        self.origins = np.empty(points.positions.shape, np.float32)
        start = time.perf_counter()
        origins.place_origins(
            (embree.functions().point_query, note_triangle()),
            world.tree.address,
            world.arrays,
            world.frame.apply(points.positions),
            points.normals,
            origins.scratch(),
            self.origins,
            np.zeros(len(points), np.uint8),
        )
        self.origins_s = time.perf_counter() - start
        self.normals, self.numbers = points.normals.astype(np.float32), points.numbers
        self.memory = [
            aligned(PACKETS * 96, np.float32).reshape(-1, 96) for _ in range(self.threads)
        ]
        self.valid = aligned(8, np.int32)
        self.valid[:] = -1

    def _some(self, points: int, wanted: int) -> NDArray[np.int64]:
        """Whole blocks of neighbouring points: single ones would come to a cold cache."""
        starts = np.linspace(0, points - self.block, max(1, wanted // self.block)).astype(np.int64)
        return np.unique((starts[:, None] + np.arange(self.block)).reshape(-1))

    def seconds(self, clock: Callable[[], float] = time.perf_counter) -> float:
        """Seconds inside the calls, all points once."""
        total = 0.0
        with ThreadPoolExecutor(self.threads) as pool:
            for first in range(0, len(self.origins), self.block * self.threads):
                starts = [first + k * self.block for k in range(self.threads)]
                filled = list(pool.map(self._fill, self.memory, starts))
                start = clock()
                list(pool.map(self._trace, filled))
                total += clock() - start
        return total

    def rate(self) -> float:
        """Rays a second."""
        return self.rays / self.seconds()

    def _fill(self, memory: NDArray[np.float32], first: int) -> NDArray[np.float32]:
        part = slice(first, first + self.block)
        packets = memory[: len(self.origins[part]) * self.sets.shape[1]]
        frame = np.zeros((3, 3), np.float32)
        make_packets(
            self.origins[part], self.normals[part], self.numbers[part], self.sets, frame, packets
        )
        return packets

    def _trace(self, packets: NDArray[np.float32]) -> None:
        functions = embree.functions()
        trace_packets(functions.occluded8, self.prepared.world.tree.address, self.valid, packets)

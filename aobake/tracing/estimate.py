"""Estimates and their errors: blocks of points over threads, rounds of rays until a tolerance is met.

The error of a well-spread direction set comes from the rays next to the boundary of the visible region;
the others hit or miss whichever way the set is turned. Along a Hilbert curve over the hemisphere the
squared differences D of successive values count those boundary rays, so

    standard error = sqrt(SPREAD D + UNSEEN^2) / n

Measured against 32,768 rays on a bumpy sphere, two characters and a cave, at 16 to 4,096 rays: the
squared error of n times the mean is 0.3 where all rays agree, then grows by 0.09 for each unit of D up
to D = 150. For independent samples SPREAD would be 1/2 (J. von
Neumann et al., The mean square successive difference, Annals of Mathematical Statistics 12, 1941; its
use for systematic samples: K. Wolter, JASA 79, 1984). UNSEEN stands for what is too small to be met by
any ray: a point where all rays agree is not exact. The binomial formula sqrt(A (1 - A) / n) would be
four times too wide at 256 rays.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.settings import BakeSettings
from aobake.tracing import embree
from aobake.tracing.contacts import note_triangle
from aobake.tracing.kernels import LINEAR, SMOOTH, trace
from aobake.tracing.kernels import scratch as kernel_scratch
from aobake.tracing.origins import ENCLOSED, place_origins
from aobake.tracing.origins import scratch as origins_scratch
from aobake.tracing.sampling import direction_sets
from aobake.tracing.world import World

__all__ = ["Estimates", "Request", "compile_kernels", "estimate"]

FloatArray = NDArray[np.float64]
Progress = Callable[[int, int], None]

SPREAD = 0.09
UNSEEN = 0.55
FIRST_ROUND = 64  # rays of the first round towards a tolerance
SMALLEST_ROUND = 16
BLOCK_RAYS = (
    1 << 18
)  # about 40 ms of one thread: often enough to stop promptly, seldom enough to cost nothing
LEAST_BLOCK_RAYS = 1 << 14
MOST_POINTS = 4096
POLL_SECONDS = 0.1


@dataclass(frozen=True, eq=False, kw_only=True)
class Request:
    """Points to estimate at. See points.SurfacePoints, whose arrays these are.

    ground : height of the ground along its axis, in the scene's space; None: there is none
    """

    positions: FloatArray
    normals: FloatArray
    geometric: FloatArray | None
    numbers: NDArray[np.int64]
    ground: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimates:
    """mean, standard_error : (P,) float32; rays : (P,) int32; states : (P,) uint8 of origins.py."""

    mean: NDArray[np.float32]
    standard_error: NDArray[np.float32]
    rays: NDArray[np.int32]
    states: NDArray[np.uint8]

    @classmethod
    def blank(cls, count: int) -> Estimates:
        """For `count` points, all open and nothing spent yet."""
        return cls(
            mean=np.ones(count, np.float32),
            standard_error=np.zeros(count, np.float32),
            rays=np.zeros(count, np.int32),
            states=np.zeros(count, np.uint8),
        )


def compile_kernels(world: World, request: Request, settings: BakeSettings) -> None:
    """Compile what these settings need, or load it from disk, in the calling thread.

    There an interrupt ends it; threads that compile at once would wait for each other.
    """
    nowhere = slice(0, 0)
    _block(world, request, settings, nowhere, Estimates.blank(0))
    no_origins, no_points = np.zeros((0, 3), np.float32), np.zeros(0, np.int64)
    _trace(world, request, settings, nowhere, no_origins, no_points, rays=1, number=0)


def estimate(
    world: World, request: Request, settings: BakeSettings, progress: Progress | None = None
) -> Estimates:
    """Ambient occlusion at each point, the same bytes for any number of threads.

    progress : called in the calling thread with (points done, points in all); what it raises stops the
        work, as does a KeyboardInterrupt, within a fraction of a second
    """
    count = len(request.positions)
    result = Estimates.blank(count)
    _block(
        world, request, settings, slice(0, 0), result
    )  # compiles here, where it can be interrupted
    stop = threading.Event()

    def work(block: slice) -> int:
        if not stop.is_set():
            _block(world, request, settings, block, result)
        return int(block.stop - block.start)

    threads = settings.threads or processors()
    rays = settings.rays if settings.tolerance is None else settings.max_rays
    blocks = list(_blocks(count, rays, threads))
    with ThreadPoolExecutor(threads, "aobake") as pool:
        try:
            _watch([pool.submit(work, block) for block in blocks], count, progress)
        finally:
            stop.set()
    return result


def _blocks(count: int, rays: int, threads: int) -> Iterator[slice]:
    """Blocks of points, smaller towards the end, so that no thread waits long for the last one.

    Source: guided self-scheduling, C. Polychronopoulos, D. Kuck, IEEE Transactions on Computers 36, 1987.
    """
    most, least = max(1, BLOCK_RAYS // rays), max(1, LEAST_BLOCK_RAYS // rays)
    first = 0
    while first < count:
        size = min(most, MOST_POINTS, max(least, (count - first) // (4 * threads)))
        yield slice(first, min(first + size, count))
        first += size


def processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _watch(pending: list[Future[int]], total: int, progress: Progress | None) -> None:
    """Wait for all blocks, waking up often enough to notice an interrupt and to report."""
    done, waiting = 0, set(pending)
    while waiting:
        finished, waiting = wait(waiting, POLL_SECONDS, FIRST_COMPLETED)
        done += sum(future.result() for future in finished)
        if progress is not None:
            progress(done, total)


def _block(
    world: World, request: Request, settings: BakeSettings, block: slice, result: Estimates
) -> None:
    """Fill one block of the result: origins, then rounds of rays."""
    functions = embree.functions()
    positions = world.frame.apply(request.positions[block])
    normals = np.ascontiguousarray(request.normals[block])
    origins = np.empty(positions.shape, np.float32)
    states = np.zeros(len(positions), np.uint8)
    place_origins(
        (functions.point_query, note_triangle()),
        world.tree.address,
        world.arrays,
        positions,
        normals,
        origins_scratch(),
        origins,
        states,
    )
    result.states[block] = states
    seen = np.flatnonzero(states != ENCLOSED)
    mean, error, rays = _rounds(world, request, settings, block, origins, seen)
    for values, filled in (
        (result.mean, mean),
        (result.standard_error, error),
        (result.rays, rays),
    ):
        values[block] = 0
        values[block][seen] = filled


def _rounds(
    world: World,
    request: Request,
    settings: BakeSettings,
    block: slice,
    origins: NDArray[np.float32],
    points: NDArray[np.int64],
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """(mean, standard error, rays) of the chosen points of a block.

    Sets of n rays are combined with weights n^1.5, the inverse of their variance: weights that do not
    look at the values, so that the mean stays unbiased.
    """
    count = len(points)
    total, weight = np.zeros(count), np.zeros(count)
    variance, rays = np.zeros(count), np.zeros(count, np.int64)
    wanted = np.full(
        count, settings.rays if settings.tolerance is None else min(FIRST_ROUND, settings.max_rays)
    )
    number = 0
    while (wanted > 0).any():
        for size in np.unique(wanted[wanted > 0]).tolist():
            chosen = np.flatnonzero(wanted == size)
            sums = _trace(world, request, settings, block, origins, points[chosen], size, number)
            counted = np.maximum(sums[:, 2], 1.0)
            w = float(size) ** 1.5
            total[chosen] += w * np.where(sums[:, 2] > 0, sums[:, 0] / counted, 1.0)
            variance[chosen] += w * w * (SPREAD * sums[:, 1] + UNSEEN**2) / counted**2
            weight[chosen] += w
            rays[chosen] += sums[:, 2].astype(np.int64)
        number += 1
        if settings.tolerance is None:
            break
        wanted = _next_round(
            np.sqrt(variance) / weight, rays, settings.tolerance, settings.max_rays
        )
    return total / np.maximum(weight, 1.0), np.sqrt(variance) / np.maximum(weight, 1.0), rays


def _next_round(
    error: FloatArray, rays: NDArray[np.int64], tolerance: float, most: int
) -> NDArray[np.int64]:
    """Rays of the next round for each point, a power of two that should do; 0 where nothing is left to do.

    The error of one set falls as n^-0.75, so a set that reaches the tolerance by itself has
    n (error / tolerance)^(4/3) rays.
    """
    left = most - rays
    needed = np.maximum(rays, 1) * (error / tolerance) ** (4.0 / 3.0)
    size = 2.0 ** np.ceil(np.log2(np.maximum(needed, SMALLEST_ROUND)))
    size = np.minimum(size, 2.0 ** np.floor(np.log2(np.maximum(left, 1))))
    return np.where((error > tolerance) & (left >= SMALLEST_ROUND), size, 0).astype(np.int64)


def _trace(
    world: World,
    request: Request,
    settings: BakeSettings,
    block: slice,
    origins: NDArray[np.float32],
    points: NDArray[np.int64],
    rays: int,
    number: int,
) -> FloatArray:
    """(P, 3) sums of one round over the given points of a block; see kernels.trace."""
    functions, scale = embree.functions(), world.frame.scale
    at = origins[points]
    sums = np.empty((len(points), 3))
    geometric = None
    if request.geometric is not None:
        geometric = request.geometric[block][points].astype(np.float32)
    ground = None
    if settings.ground is not None and request.ground is not None:
        axis = "xyz".index(settings.ground[1])
        level = (request.ground - world.frame.center[axis]) * scale
        ground = (axis, np.maximum(at[:, axis] - np.float32(level), np.float32(0.0)))
    falloff = {"none": None, "linear": LINEAR, "smooth": SMOOTH}[settings.falloff]
    far = np.inf if settings.max_distance is None else settings.max_distance * scale
    trace(
        (functions.occluded8, functions.intersect8),
        world.tree.address,
        at,
        request.normals[block][points].astype(np.float32),
        geometric,
        request.numbers[block][points],
        np.uint64((settings.seed + 0x9E3779B97F4A7C15 * number) % 2**64),
        direction_sets(rays),
        rays,
        np.float32(far),
        ground,
        falloff,
        kernel_scratch(),
        sums,
    )
    return sums

"""Estimates and their errors: blocks of points over threads, a fixed number of rays or rounds of them.

The value at a point depends on its number and the seed, not on blocks and threads. With a tolerance the
sets of directions grow in rounds where that is still needed (rounds.py).
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aobake.settings import FIRST_ROUND, TraceSettings
from aobake.tracing import embree
from aobake.tracing.contacts import note_triangle
from aobake.tracing.gathered import Gathered
from aobake.tracing.kernels import LINEAR, SMOOTH, SUMS, trace
from aobake.tracing.kernels import scratch as kernel_scratch
from aobake.tracing.lobes import lobed
from aobake.tracing.order import along, path
from aobake.tracing.origins import ENCLOSED, OPEN, PLAIN, place_origins
from aobake.tracing.origins import scratch as origins_scratch
from aobake.tracing.rounds import Tally, grown
from aobake.tracing.sampling import added_directions, direction_sets
from aobake.tracing.world import World

__all__ = ["Estimates", "Request", "compile_kernels", "estimate", "processors"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Progress = Callable[[int, int], None]

BLOCK_RAYS = (
    1 << 18
)  # about 40 ms of one thread: often enough to stop promptly, seldom enough to cost nothing
LEAST_BLOCK_RAYS = 1 << 14
MOST_POINTS = 4096
POLL_SECONDS = 0.1
STEP = 1 << 32  # beyond all numbers of rays, for two of them in one number


@dataclass(frozen=True, eq=False, kw_only=True)
class Request:
    """Points to estimate at. See points.SurfacePoints, whose arrays these are.

    ground : height of the ground along its axis, in the scene's space; None: there is none
    open : (P,) bool, points that everything lies below, which need no ray unless something touches them
        face to face; None: nothing is known of any
    sets : directions to trace instead of sampling.direction_sets(rays), as many and in the same form, but
        2^k sets of any number: for comparing ways to choose them; None: those
    reach : how far a ray counts at most in a mean distance, in scene units; None: nobody asks for one
    """

    positions: FloatArray
    normals: FloatArray
    geometric: FloatArray | None
    numbers: NDArray[np.int64]
    ground: float | None = None
    open: NDArray[np.bool_] | None = None
    sets: NDArray[np.float32] | None = None
    reach: float | None = None

    def only(self, chosen: IntArray) -> Request:
        """Some of the points, by their place in these arrays."""
        return replace(
            self,
            positions=self.positions[chosen],
            normals=self.normals[chosen],
            geometric=None if self.geometric is None else self.geometric[chosen],
            numbers=self.numbers[chosen],
            open=None if self.open is None else self.open[chosen],
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimates:
    """mean, standard_error : (P,) float32; rays : (P,) int32; states : (P,) uint8 of origins.py.

    bent : (P, 3) float32, unit length, the mean open direction, the normal where nothing is open; or None
    distance : (P,) float32, how far rays get in the mean, in scene units; or None
    """

    mean: NDArray[np.float32]
    standard_error: NDArray[np.float32]
    rays: NDArray[np.int32]
    states: NDArray[np.uint8]
    bent: NDArray[np.float32] | None = None
    distance: NDArray[np.float32] | None = None

    @classmethod
    def blank(cls, count: int, *, bent: bool = False, reach: float | None = None) -> Estimates:
        """For `count` points, all open and nothing spent yet. reach : of their distances, if there are any"""
        return cls(
            mean=np.ones(count, np.float32),
            standard_error=np.zeros(count, np.float32),
            rays=np.zeros(count, np.int32),
            states=np.zeros(count, np.uint8),
            bent=np.zeros((count, 3), np.float32) if bent else None,
            distance=None if reach is None else np.full(count, reach, np.float32),
        )

    def only(self, chosen: IntArray) -> Estimates:
        """Some of them, by their place in these arrays."""
        return Estimates(
            mean=self.mean[chosen],
            standard_error=self.standard_error[chosen],
            rays=self.rays[chosen],
            states=self.states[chosen],
            bent=None if self.bent is None else self.bent[chosen],
            distance=None if self.distance is None else self.distance[chosen],
        )

    def put(self, chosen: IntArray, part: Estimates) -> None:
        """Take in estimates of some of the points, by their place in these arrays."""
        self.mean[chosen], self.standard_error[chosen] = part.mean, part.standard_error
        self.rays[chosen], self.states[chosen] = part.rays, part.states
        if self.bent is not None and part.bent is not None:
            self.bent[chosen] = part.bent
        if self.distance is not None and part.distance is not None:
            self.distance[chosen] = part.distance


@dataclass(frozen=True, eq=False)
class Work:
    """What there is to trace, and what has come of it so far.

    origins : (P, 3) float32, in the tree's space
    order : (P,) the order that points are traced in; None: as they stand
    """

    world: World
    request: Request
    settings: TraceSettings
    origins: NDArray[np.float32]
    states: NDArray[np.uint8]
    tally: Tally
    gathered: Gathered
    order: IntArray | None

    @classmethod
    def planned(cls, world: World, request: Request, settings: TraceSettings) -> Work:
        """Nothing done yet."""
        count = len(request.positions)
        origins = np.empty((count, 3), np.float32)
        states = np.zeros(count, np.uint8)
        reach = None if request.reach is None else request.reach * world.frame.scale
        return cls(
            world,
            request,
            settings,
            origins,
            states,
            Tally.blank(count, grows=settings.tolerance is not None),
            Gathered.blank(count, bent=settings.bent_normals, reach=reach),
            path(request.positions),
        )


def compile_kernels(world: World, request: Request, settings: TraceSettings) -> None:
    """Compile what these settings need, or load it from disk, in the calling thread.

    There an interrupt ends it; threads that compile at once would wait for each other. The kernel that
    finds origins comes last: another process may be compiling it (ahead.py).
    """
    none = np.zeros(0, np.int64)
    nothing = Work.planned(world, request.only(none), settings)
    _trace(nothing, none, direction_sets(1), 1)
    _place(nothing, none)


def estimate(
    world: World, request: Request, settings: TraceSettings, progress: Progress | None = None
) -> Estimates:
    """Ambient occlusion at each point, the same bytes for any number of threads.

    progress : called in the calling thread with (points done, points in all); what it raises stops the
        work, as does a KeyboardInterrupt, within a fraction of a second
    """
    compile_kernels(world, request, settings)
    work = Work.planned(world, request, settings)
    stop = threading.Event()
    with ThreadPoolExecutor(settings.threads or processors(), "aobake") as pool:
        try:
            _first_pass(work, partial(_over_blocks, pool, stop), progress)
            if settings.tolerance is not None:
                _rounds(work, partial(_over_blocks, pool, stop), progress)
        finally:
            stop.set()
    return _estimates(work)


def _first_pass(work: Work, over_blocks: Callable[..., None], progress: Progress | None) -> None:
    """Origins of all points, and their rays: all of them, or those of the first round."""
    fixed = work.settings.tolerance is None
    rays = work.settings.rays if fixed else FIRST_ROUND
    sets = direction_sets(rays) if fixed else added_directions(0, rays)
    sets = lobed(sets, work.settings.distribution, work.settings.spread)
    if work.request.sets is not None:
        sets = work.request.sets

    def begin(chosen: IntArray) -> None:
        _place(work, chosen)
        _trace(work, chosen[_wants_rays(work.states[chosen])], sets, rays)

    count = len(work.origins)
    report = None
    if progress is not None:
        report = (lambda done: progress(done, count)) if fixed else (lambda _: progress(0, count))
    over_blocks(begin, along(work.order, np.arange(count)), rays, report)


def _rounds(work: Work, over_blocks: Callable[..., None], progress: Progress | None) -> None:
    """Let the sets of points grow until none has to."""
    settings, tally, count = work.settings, work.tally, len(work.origins)
    settled = 0
    seen = np.flatnonzero(_wants_rays(work.states))
    while True:
        sizes, goals = tally.rays[seen], grown(tally, seen, settings)
        growing = np.flatnonzero(goals > sizes)
        settled = max(settled, count - len(growing))
        if progress is not None:
            progress(settled, count)
        if len(growing) == 0:
            return
        report = None if progress is None else partial(_still, progress, settled, count)
        steps = sizes[growing] * STEP + goals[growing]
        for step in np.unique(steps).tolist():
            size, goal = divmod(step, STEP)
            added = lobed(added_directions(size, goal), settings.distribution, settings.spread)
            grow = partial(_trace, work, sets=added, rays=goal - size)
            over_blocks(grow, along(work.order, seen[growing[steps == step]]), goal - size, report)


def _still(progress: Progress, settled: int, count: int, _: int) -> None:
    """Say what has been settled: a round settles points at its end."""
    progress(settled, count)


def _over_blocks(
    pool: ThreadPoolExecutor,
    stop: threading.Event,
    function: Callable[[IntArray], None],
    points: IntArray,
    rays: int,
    progress: Callable[[int], None] | None,
) -> None:
    """Call a function for all points, in blocks, in the threads of the pool."""

    def run(block: IntArray) -> int:
        if not stop.is_set():
            function(block)
        return len(block)

    threads = pool._max_workers  # noqa: SLF001 - as many as it was made with
    blocks = [points[block] for block in _blocks(len(points), rays, threads)]
    _watch([pool.submit(run, block) for block in blocks], progress)


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


def _watch(pending: Sequence[Future[int]], progress: Callable[[int], None] | None) -> None:
    """Wait for all blocks, waking up often enough to notice an interrupt and to report."""
    done, waiting = 0, set(pending)
    while waiting:
        finished, waiting = wait(waiting, POLL_SECONDS, FIRST_COMPLETED)
        done += sum(future.result() for future in finished)
        if progress is not None:
            progress(done)


def _place(work: Work, chosen: IntArray) -> None:
    """Find the origins of a block of points."""
    functions, world = embree.functions(), work.world
    origins = np.empty((len(chosen), 3), np.float32)
    states = np.zeros(len(chosen), np.uint8)
    place_origins(
        (functions.point_query, note_triangle()),
        world.tree.address,
        world.arrays,
        world.frame.apply(work.request.positions[chosen]),
        np.ascontiguousarray(work.request.normals[chosen]),
        origins_scratch(),
        origins,
        states,
    )
    if work.request.open is not None:
        states[work.request.open[chosen] & (states == PLAIN)] = OPEN
    work.origins[chosen], work.states[chosen] = origins, states


def _wants_rays(states: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Which points are not settled by what was found about them."""
    return np.asarray((states != ENCLOSED) & (states != OPEN))


def _trace(work: Work, chosen: IntArray, sets: NDArray[np.float32], rays: int) -> None:
    """Trace the same number of rays from each of the chosen points, and add them to the tally."""
    functions, settings, request = embree.functions(), work.settings, work.request
    at, scale = work.origins[chosen], work.world.frame.scale
    sums = np.empty((len(chosen), SUMS))
    gathered = work.gathered.part(len(chosen))
    geometric = None
    if request.geometric is not None:
        geometric = request.geometric[chosen].astype(np.float32)
    falloff = {"none": None, "linear": LINEAR, "smooth": SMOOTH}[settings.falloff]
    far = np.inf if settings.max_distance is None else settings.max_distance * scale
    trace(
        (functions.occluded8, functions.intersect8),
        work.world.tree.address,
        at,
        request.normals[chosen].astype(np.float32),
        geometric,
        request.numbers[chosen],
        np.uint64(settings.seed),
        sets,
        rays,
        np.float32(far),
        _ground(work, at),
        falloff,
        kernel_scratch(),
        sums,
        *gathered.for_kernel(),
    )
    work.tally.add(chosen, sums, rays)
    work.gathered.add(chosen, gathered)


def _ground(work: Work, at: NDArray[np.float32]) -> tuple[int, NDArray[np.float32]] | None:
    """The axis of the ground, and how high origins are above it; None where there is none."""
    axis_name, level = work.settings.ground, work.request.ground
    if axis_name is None or level is None:
        return None
    axis = "xyz".index(axis_name[1])
    height = (level - work.world.frame.center[axis]) * work.world.frame.scale
    return axis, np.maximum(at[:, axis] - np.float32(height), np.float32(0.0))


def _estimates(work: Work) -> Estimates:
    """Means and errors of what was counted; 0 without an error where a point is enclosed, 1 where it is open."""
    mean, error = work.tally.mean(), work.tally.standard_error()
    enclosed = work.states == ENCLOSED
    mean[enclosed] = 0.0
    error[enclosed] = 0.0
    distance = work.gathered.mean_distance(work.tally.counted)
    if distance is not None:
        distance[enclosed] = 0.0
        distance /= work.world.frame.scale
    return Estimates(
        mean=mean.astype(np.float32),
        standard_error=error.astype(np.float32),
        rays=work.tally.counted.astype(np.int32),
        states=work.states,
        bent=work.gathered.bent(_wants_rays(work.states), work.request.normals),
        distance=None if distance is None else distance.astype(np.float32),
    )

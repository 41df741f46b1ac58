"""Estimates and their errors: blocks of points over threads, a fixed number of rays or rounds of them.

The value at a point depends on its number and the seed, not on blocks and threads. With a tolerance points get
sets of directions in rounds, as many and as large as they need (rounds.py); then how many rays those are depends on
their neighbours as well, and so do standard errors (neighbours.py).
"""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aobake.settings import TraceSettings
from aobake.tracing import embree
from aobake.tracing.blocks import over_blocks
from aobake.tracing.contacts import note_triangle
from aobake.tracing.embree import Packets
from aobake.tracing.gathered import Gathered
from aobake.tracing.kernels import LINEAR, SMOOTH, SUMS, trace
from aobake.tracing.kernels import scratch as kernel_scratch
from aobake.tracing.lobes import lobed
from aobake.tracing.neighbours import Neighbours
from aobake.tracing.order import along, path
from aobake.tracing.origins import ENCLOSED, OPEN, PLAIN, place_origins
from aobake.tracing.origins import scratch as origins_scratch
from aobake.tracing.planning_kernels import compile_planning
from aobake.tracing.rounds import PILOT, STRIDE, missing
from aobake.tracing.sampling import direction_sets
from aobake.tracing.sized_sets import SizedSets
from aobake.tracing.tally import Tally
from aobake.tracing.world import World

__all__ = ["Estimates", "Request", "compile_kernels", "estimate", "processors"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Progress = Callable[[int, int], None]

COUNTED = 2  # the column of the rays that count, of what trace adds up
USUAL = 5  # rounds towards a tolerance
ODD = 0x9E3779B97F4A7C15  # between the seeds of a point's sets
SEEDS = 1 << 64


@dataclass(frozen=True, eq=False, kw_only=True)
class Request:
    """Points to estimate at. See points.SurfacePoints, whose arrays these are.

    ground : height of the ground along its axis, in the scene's space; None: there is none
    open : (P,) bool, points that everything lies below, which need no ray unless something touches them
        face to face; None: nothing is known of any
    sets : directions to trace instead of sampling.direction_sets(rays), as many and in the same form, but
        2^k sets of any number: for comparing ways to choose them, without a tolerance; None: those
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
            Tally.blank(count),
            Gathered.blank(count, bent=settings.bent_normals, reach=reach),
            path(request.positions),
        )

    def leading(self) -> NDArray[np.bool_]:
        """(P,) the points that go first towards a tolerance."""
        found = np.zeros(len(self.states), bool)
        found[along(self.order, np.arange(len(found)))[::STRIDE]] = True
        return found

    def neighbours(self) -> Neighbours:
        """The points that have rays, once the states of all are known."""
        seen = along(self.order, np.flatnonzero(_wants_rays(self.states)))
        return Neighbours.along(seen, self.request.normals[seen])

    def sets(self, sizes: Iterable[int]) -> SizedSets:
        """Directions for so many rays of a point, rising."""
        return SizedSets.of({rays: self._sets(rays) for rays in sizes})

    def packets(self, rays: float) -> Packets:
        """How packets are asked for where points have so many rays in the mean."""
        plain = self.settings.falloff == "none" and self.request.reach is None
        return embree.packets(coherent=plain and self.world.keeps_together(rays))

    def _sets(self, rays: int) -> NDArray[np.float32]:
        if self.request.sets is not None:
            return self.request.sets
        return lobed(direction_sets(rays), self.settings.distribution, self.settings.spread)


def compile_kernels(world: World, request: Request, settings: TraceSettings) -> None:
    """Compile what these settings need, or load it from disk, in the calling thread.

    There an interrupt ends it; threads that compile at once would wait for each other. The kernel that
    finds origins comes last: another process may be compiling it (ahead.py).
    """
    none = np.zeros(0, np.int64)
    nothing = Work.planned(world, request.only(none), settings)
    _trace(nothing, nothing.packets(1), none, nothing.sets([1]), none)
    if settings.tolerance is not None:
        compile_planning()
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
    near, stop = None, threading.Event()
    with ThreadPoolExecutor(settings.threads or processors(), "aobake") as pool:
        try:
            _first_pass(work, partial(over_blocks, pool, stop), progress)
            if settings.tolerance is not None:
                near = work.neighbours()
                _rounds(work, near, partial(over_blocks, pool, stop), progress)
        finally:
            stop.set()
    return _estimates(work, near)


def _first_pass(work: Work, over_blocks: Callable[..., None], progress: Progress | None) -> None:
    """Origins of all points, and their rays: all of them, or towards a tolerance a few of those that lead."""
    count, fixed = len(work.origins), work.settings.tolerance is None
    rays = work.settings.rays if fixed else PILOT
    sets, packets = work.sets([rays]), work.packets(rays)
    first = np.ones(count, bool) if fixed else work.leading()

    def begin(block: IntArray) -> None:
        _place(work, block)
        chosen = block[first[block] & _wants_rays(work.states[block])]
        each = np.full(len(chosen), rays)
        work.tally.add(chosen, _trace(work, packets, chosen, sets, each), each)

    report = None
    if progress is not None:
        report = (lambda done: progress(done, count)) if fixed else (lambda _: progress(0, count))
    over_blocks(begin, along(work.order, np.arange(count)), rays, report)


def _rounds(
    work: Work, near: Neighbours, over_blocks: Callable[..., None], progress: Progress | None
) -> None:
    """Further sets, at first for the points that lead, by them for the others, and then until nobody needs one."""
    count, leading = len(work.origins), work.leading()[near.points]
    settled = 0
    for number in itertools.count(1):
        tally = work.tally.only(near.points)
        sizes = missing(tally, near, work.settings, max(number - USUAL, 0))
        settled = max(settled, count - int(np.count_nonzero(sizes)))
        if progress is not None:
            progress(settled, count)
        if number > 2 and not sizes.any():
            return
        if number <= 2:
            sizes[leading if number == 2 else ~leading] = 0
        report = None if progress is None else partial(_still, progress, settled, count)
        _next_sets(work, near.points, sizes, number, partial(over_blocks, progress=report))


def _next_sets(
    work: Work, points: IntArray, sizes: IntArray, number: int, over_blocks: Callable[..., None]
) -> None:
    """Trace a set of each of the points, of its size; none where that is 0.

    number : of the set, among those of a point
    """
    going = np.flatnonzero(sizes)
    wanted = np.zeros(len(work.origins), np.int64)
    wanted[points] = sizes
    if len(going) == 0:
        return
    mean = int(sizes.sum()) / len(going)
    sets, packets = work.sets(np.unique(sizes[going]).tolist()), work.packets(mean)

    def go_on(block: IntArray) -> None:
        each = wanted[block]
        work.tally.add(block, _trace(work, packets, block, sets, each, number), each)

    over_blocks(go_on, points[going], max(1, round(mean)))


def _still(progress: Progress, settled: int, count: int, _: int) -> None:
    """Say what has been settled: a round settles points at its end."""
    progress(settled, count)


def processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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


def _trace(
    work: Work, packets: Packets, chosen: IntArray, sets: SizedSets, rays: IntArray, number: int = 0
) -> FloatArray:
    """(len(chosen), SUMS) what kernels.trace adds up over the rays from each of the chosen points.

    packets : of embree.packets; rays : (len(chosen),) how many, each the size of some of the sets
    number : of the set, among those of a point
    """
    settings, request = work.settings, work.request
    at, scale = work.origins[chosen], work.world.frame.scale
    sums = np.empty((len(chosen), SUMS))
    gathered = work.gathered.part(len(chosen))
    geometric = None
    if request.geometric is not None:
        geometric = request.geometric[chosen].astype(np.float32)
    falloff = {"none": None, "linear": LINEAR, "smooth": SMOOTH}[settings.falloff]
    far = np.inf if settings.max_distance is None else settings.max_distance * scale
    trace(
        packets,
        work.world.tree.address,
        at,
        request.normals[chosen].astype(np.float32),
        geometric,
        request.numbers[chosen],
        np.uint64((settings.seed + number * ODD) % SEEDS),
        sets,
        sets.of_each(rays),
        np.float32(far),
        _ground(work, at),
        falloff,
        kernel_scratch(),
        sums,
        *gathered.for_kernel(),
    )
    work.gathered.add(chosen, gathered, np.sqrt(sums[:, COUNTED]))
    return sums


def _ground(work: Work, at: NDArray[np.float32]) -> tuple[int, NDArray[np.float32]] | None:
    """The axis of the ground, and how high origins are above it; None where there is none."""
    axis_name, level = work.settings.ground, work.request.ground
    if axis_name is None or level is None:
        return None
    axis = "xyz".index(axis_name[1])
    height = (level - work.world.frame.center[axis]) * work.world.frame.scale
    return axis, np.maximum(at[:, axis] - np.float32(height), np.float32(0.0))


def _estimates(work: Work, near: Neighbours | None) -> Estimates:
    """Means and errors of what was counted; 0 without an error where a point is enclosed, 1 where it is open."""
    mean, error = work.tally.mean(), np.zeros(len(work.origins))
    enclosed = work.states == ENCLOSED
    mean[enclosed] = 0.0
    traced = np.flatnonzero(work.tally.rays) if near is None else near.points
    tally = work.tally.only(traced)
    behind = tally.behind() if near is None else near.behind(tally)
    error[traced] = np.sqrt(tally.variance(behind))
    distance = work.gathered.mean_distance(work.tally.scaled)
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

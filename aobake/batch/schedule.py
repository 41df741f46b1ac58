"""Which tasks begin next, and with how many threads each.

The longest comes first. A task is given one thread, but more where it would outlast the rest of the batch
otherwise: as few as bring it down to its fair share, the work that is left over all threads. Where it has
to wait for threads or memory, they are kept for it, and only what is over by then may pass it; so none
waits for ever. Reservations as in: D. Lifka, The ANL/IBM SP scheduling system, 1995 (EASY).

Nothing here runs or reads anything: costs, capacity and time are given.
"""

from __future__ import annotations

import bisect
import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

from aobake.batch.tasks import Capacity
from aobake.jobs import Job

__all__ = ["Cost", "Schedule", "estimated", "speed_up"]

ALONE = 0.1  # of a bake that no second thread makes faster: 5 % of a vertex bake, a quarter of some textures
SLACK = 1.0 + ALONE  # over its fair share a task may be before two threads pay: they cost that much
LATE = 0.25  # of the time that it has taken, a task that is late is expected to go on
MOST_TRIED = 32  # numbers of tasks to begin together

START_S = 0.01  # of every asset
BYTE_S = {"vertex": 1e-7, "texture": 5e-6}  # to read and write it; to unwrap it as well
RAYS_PER_S = 6e6  # of one thread
VERTEX_BYTES = 60  # that a vertex takes in a typical file, with its share of the faces
PROCESS_BYTES = 250 << 20  # that a worker holds before it has read anything
HELD_PER_BYTE = 20  # of a file: its arrays, the tree over its faces, the copy to write
HELD_PER_TEXEL = 120


@dataclass(frozen=True, kw_only=True)
class Cost:
    """What a task will take: seconds with one thread, and bytes of memory."""

    number: int
    seconds: float
    memory: int


@dataclass(frozen=True)
class Running:
    """A task that has begun at a moment, to end at another one, as far as can be told."""

    cost: Cost
    threads: int
    begun: float
    due: float

    def end(self, now: float) -> float:
        """The moment to expect; the later it is, the less is its estimate to be trusted."""
        return self.due if self.due > now else now + LATE * (now - self.begun)


@dataclass(frozen=True)
class Room:
    """What is left for more tasks."""

    threads: int
    memory: int
    workers: int

    def after(self, one: Running) -> Room:
        """What there is once a task is over."""
        return Room(self.threads + one.threads, self.memory + one.cost.memory, self.workers + 1)

    def holds(self, threads: int, memory: int) -> bool:
        """Whether a task fits in."""
        return self.threads >= threads and self.memory >= memory and self.workers >= 1


def speed_up(threads: int) -> float:
    """How much faster a task is with several threads. Source: G. Amdahl, 1967."""
    return 1.0 / (ALONE + (1.0 - ALONE) / threads)


def estimated(
    number: int, job: Job, size: int, *, seconds: float | None = None, peak: int | None = None
) -> Cost:
    """The cost of a job: as an earlier run found it, else guessed.

    size : of the asset, in bytes; seconds, peak : of an earlier run, None or 0: not known
    """
    bake = job.chosen.bake
    texels = bake.size**2 * bake.supersample**2 if job.command == "texture" else 0
    points = texels or size / VERTEX_BYTES
    guess = START_S + size * BYTE_S[job.command] + points * bake.rays / RAYS_PER_S
    held = PROCESS_BYTES + size * HELD_PER_BYTE + texels * HELD_PER_TEXEL
    return Cost(number=number, seconds=seconds or guess, memory=peak or held)


class Schedule:
    """The tasks that wait and those that run."""

    def __init__(self) -> None:
        """Of no tasks yet."""
        self._pending: list[Cost] = []  # the longest last
        self._running: dict[int, Running] = {}
        self._work = 0.0  # seconds of all pending

    @property
    def pending(self) -> int:
        """How many tasks wait."""
        return len(self._pending)

    @property
    def running(self) -> int:
        """How many tasks run."""
        return len(self._running)

    def add(self, cost: Cost) -> None:
        """A task more that waits; also one that has ended and is to be tried again."""
        bisect.insort(self._pending, cost, key=_order)
        self._work += cost.seconds

    def ended(self, number: int) -> None:
        """A task runs no more."""
        del self._running[number]

    def next(self, capacity: Capacity, now: float) -> list[tuple[int, int]]:
        """The tasks that begin now, with the threads of each; they count as running from here on.

        Never more threads, memory or workers than there are; but one task runs however much it takes.
        now : in seconds, of any clock
        """
        begun = [] if self._running else self._all_at_once(capacity, now)
        while self._pending and (chosen := self._choice(capacity, now)) is not None:
            begun.append(self._begin(*chosen, now))
        return begun

    def _begin(self, place: int, threads: int, now: float) -> tuple[int, int]:
        cost = self._pending.pop(place)
        self._work -= cost.seconds
        due = now + cost.seconds / speed_up(threads)
        self._running[cost.number] = Running(cost, threads, now, due)
        return cost.number, threads

    def _all_at_once(self, capacity: Capacity, now: float) -> list[tuple[int, int]]:
        """Begin some of the longest together on an empty machine, where there are too few for its threads."""
        most = min(capacity.threads, capacity.most_threads)
        few = min(capacity.threads, capacity.workers, len(self._pending))
        first = self._pending[-few:] if few > 0 else []
        if sum(cost.memory for cost in first) > capacity.memory:
            return []
        if not first or first[-1].seconds <= SLACK * self._work / capacity.threads:
            return []  # one thread each is enough
        given = _together(first, self._work, capacity.threads, most)
        return [self._begin(len(self._pending) - 1, threads, now) for threads in reversed(given)]

    def _choice(self, capacity: Capacity, now: float) -> tuple[int, int] | None:
        """The place in the queue of the next task to begin, and its threads; None: none does."""
        room = self._room(capacity)
        if room.threads < 1 or room.workers < 1:
            return None
        first, last = self._pending[-1], len(self._pending) - 1
        wanted = self._wanted(first, room, capacity, now)
        if not self._running or room.holds(wanted, first.memory):
            return last, min(wanted, room.threads)
        when = self._vacant(room, wanted, first.memory, now)
        if room.holds(1, first.memory):
            soon = now + first.seconds / speed_up(room.threads)
            if soon <= when + first.seconds / speed_up(wanted):
                return last, min(room.threads, wanted)
        return self._over_by(when - now, room)

    def _room(self, capacity: Capacity) -> Room:
        running = self._running.values()
        return Room(
            capacity.threads - sum(one.threads for one in running),
            capacity.memory - sum(one.cost.memory for one in running),
            capacity.workers - len(running),
        )

    def _wanted(self, first: Cost, room: Room, capacity: Capacity, now: float) -> int:
        """The threads that the longest task should have."""
        most = min(capacity.threads, capacity.most_threads)
        ahead = sum((one.end(now) - now) * one.threads for one in self._running.values())
        share = SLACK * (self._work + ahead) / capacity.threads
        enough = (k for k in range(1, most) if first.seconds / speed_up(k) <= share)
        return min(
            most, max(next(enough, most), room.threads // min(room.workers, len(self._pending)))
        )

    def _vacant(self, room: Room, threads: int, memory: int, now: float) -> float:
        """The moment at which there will be so much room."""
        for one in sorted(self._running.values(), key=lambda one: one.end(now)):
            room = room.after(one)
            if room.holds(threads, memory):
                return one.end(now)
        return max(one.end(now) for one in self._running.values())

    def _over_by(self, seconds: float, room: Room) -> tuple[int, int] | None:
        """The longest task that fits in and is over by then, with one thread."""
        end = bisect.bisect_right(self._pending, seconds, key=lambda cost: cost.seconds)
        fitting = (k for k in reversed(range(end)) if room.holds(1, self._pending[k].memory))
        place = next(fitting, None)
        return None if place is None else (place, 1)


def _together(longest: Sequence[Cost], work: float, threads: int, most: int) -> list[int]:
    """The threads of those tasks that are to begin together, the last ones: so many that all is over soonest.

    longest : candidates, no more than threads; work : seconds of all tasks, with these
    The rest is taken to fill all threads afterwards, but the longest of it as fast as it can be at best.
    """
    best, soonest = [most], math.inf
    for count in range(1, len(longest) + 1, 1 + len(longest) // MOST_TRIED):
        given, seconds = _side_by_side(longest[-count:], threads, most)
        rest = work - sum(cost.seconds for cost in longest[-count:])
        taken = sum(k * s for k, s in zip(given, seconds, strict=True))
        last = longest[-count - 1].seconds / speed_up(most) if count < len(longest) else 0.0
        end = max(max(seconds) + last, (taken + rest) / threads)
        if end < soonest:
            best, soonest = given, end
    return best


def _side_by_side(costs: Sequence[Cost], threads: int, most: int) -> tuple[list[int], list[float]]:
    """The threads of tasks that begin together, and the seconds that each takes.

    Each thread goes to the task that would be over last without it; there are no fewer of them than tasks.
    """
    given = [1] * len(costs)
    ends = [(-cost.seconds, place) for place, cost in enumerate(costs)]
    heapq.heapify(ends)
    for _ in range(threads - len(costs)):
        place = ends[0][1]
        if given[place] == most:
            break
        given[place] += 1
        heapq.heapreplace(ends, (-costs[place].seconds / speed_up(given[place]), place))
    return given, [cost.seconds / speed_up(k) for cost, k in zip(costs, given, strict=True)]


def _order(cost: Cost) -> tuple[float, int]:
    return cost.seconds, -cost.number

"""The schedule against the least time that any schedule could take, by simulation; and what it must never do."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aobake.batch.schedule import Cost, Schedule, estimated, speed_up
from aobake.batch.tasks import Capacity
from aobake.config import Configured
from aobake.jobs import Job
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

AMPLE = 1 << 50
seconds = st.lists(st.floats(0.01, 100.0), min_size=1, max_size=40)
mixes = seconds | seconds.map(lambda some: [one**3 / 1e4 for one in some])  # a few giants


def machine(threads: int, *, memory: int = AMPLE, workers: int | None = None) -> Capacity:
    return Capacity(
        threads=threads, most_threads=threads, memory=memory, workers=workers or threads
    )


@dataclass
class Simulation:
    """A batch run on paper: task n takes actual[n] seconds with one thread, whatever was expected of it."""

    capacity: Capacity
    costs: Sequence[Cost]
    actual: Sequence[float]
    order: list[int] = field(default_factory=list)

    def run(self) -> float:
        """The seconds until all is done; checks at each moment that nothing is promised that is not there."""
        schedule, now, ends = Schedule(), 0.0, list[tuple[float, int, int]]()
        for cost in self.costs:
            schedule.add(cost)
        while schedule.pending or schedule.running:
            for number, threads in schedule.next(self.capacity, now):
                self.order.append(number)
                took = self.actual[number] / speed_up(threads)
                heapq.heappush(ends, (now + took, number, threads))
            self.check(ends)
            now = ends[0][0]
            while ends and ends[0][0] <= now * (1.0 + 1e-12):
                schedule.ended(heapq.heappop(ends)[1])
        return now

    def check(self, ends: Sequence[tuple[float, int, int]]) -> None:
        assert ends, "nothing runs, and something waits"
        memory = sum(self.costs[number].memory for _, number, _ in ends)
        assert sum(threads for _, _, threads in ends) <= self.capacity.threads
        assert len(ends) <= self.capacity.workers
        assert memory <= self.capacity.memory or len(ends) == 1


def simulated(
    work: Sequence[float], capacity: Capacity, memory: Sequence[int] | None = None
) -> Simulation:
    memory = memory or [0] * len(work)
    costs = [
        Cost(number=number, seconds=one, memory=held)
        for number, (one, held) in enumerate(zip(work, memory, strict=True))
    ]
    return Simulation(capacity, costs, work)


def least_seconds(work: Sequence[float], threads: int) -> float:
    """A bound below which no schedule can be over.

    To be over by then, each task needs some number of threads, and takes at least so much of all thread time.
    Source: J. Turek, J. Wolf, P. Yu, Approximate algorithms for scheduling parallelizable tasks, 1992.
    """

    def thread_time(one: float, end: float) -> float:
        fits = (k for k in range(1, threads + 1) if one / speed_up(k) <= end)
        k = next(fits, None)
        return math.inf if k is None else k * one / speed_up(k)

    least, most = 0.0, sum(work)
    for _ in range(40):
        middle = (least + most) / 2
        if sum(thread_time(one, middle) for one in work) <= threads * middle:
            most = middle
        else:
            least = middle
    return least


@settings(max_examples=100, deadline=None)
@given(mixes)
def test_on_two_threads_a_batch_is_near_the_least_time(work: list[float]) -> None:
    """Within 1.2, also of the bound that takes threads to cost nothing."""
    took = simulated(work, machine(2)).run()
    assert took <= 1.2 * max(sum(work) / 2, max(work) / speed_up(2))


@settings(max_examples=100, deadline=None)
@given(mixes, st.sampled_from([(3, 1.4), (4, 1.4), (8, 1.75), (16, 1.75)]))
def test_on_many_threads_a_batch_is_not_far_from_it(
    work: list[float], machine_of: tuple[int, float]
) -> None:
    """On average 1.03 to 1.07; the worst that a search found, 1.25 and 1.55, are few tasks that fit badly."""
    threads, worst = machine_of
    took = simulated(work, machine(threads)).run()
    assert took <= worst * least_seconds(work, threads)


@settings(max_examples=100, deadline=None)
@given(mixes, st.sampled_from([1, 2, 8]), st.sampled_from([1, 2, 8]), st.randoms())
def test_never_is_more_promised_than_there_is(
    work: list[float], threads: int, workers: int, random: object
) -> None:
    """With memory that holds few of the tasks, or not even one; and with estimates that are all wrong."""
    memory = [(7 * number) % 11 for number in range(len(work))]
    capacity = machine(threads, memory=9, workers=workers)
    simulation = simulated(work, capacity, memory)
    wrong = replace(simulation, actual=[100.0 / one for one in work])
    for one in (simulation, wrong):
        one.order.clear()
        one.run()
        assert sorted(one.order) == list(range(len(work)))


def test_small_tasks_run_side_by_side_and_the_longest_begins() -> None:
    schedule = Schedule()
    for number, one in enumerate([1.0, 3.0, 2.0, 1.0, 1.0, 1.0]):
        schedule.add(Cost(number=number, seconds=one, memory=0))
    assert schedule.next(machine(2), 0.0) == [(1, 1), (2, 1)]


def test_a_giant_has_all_threads() -> None:
    schedule = Schedule()
    for number in range(8):
        schedule.add(Cost(number=number, seconds=100.0 if number == 5 else 0.1, memory=0))
    assert schedule.next(machine(4), 0.0) == [(5, 4)]


def test_two_giants_among_crumbs_share_the_threads() -> None:
    schedule = Schedule()
    for number in range(8):
        schedule.add(Cost(number=number, seconds=100.0 if number in {3, 5} else 0.1, memory=0))
    assert schedule.next(machine(4), 0.0) == [(3, 2), (5, 2)]


def test_the_last_task_has_all_threads_that_are_left() -> None:
    schedule = Schedule()
    schedule.add(Cost(number=0, seconds=1.0, memory=0))
    assert schedule.next(machine(8), 0.0) == [(0, 8)]


def test_a_single_process_is_given_all_threads() -> None:
    work = simulated([1.0] * 10, machine(4, workers=1))
    assert work.run() == pytest.approx(10.0 / speed_up(4))


def test_a_task_that_waits_for_memory_is_not_passed_for_ever() -> None:
    """Small tasks would keep its memory from it; what is over in time may pass, and does."""
    work, memory = [5.0, 4.0, *[0.5] * 40], [6, 8, *[1] * 40]
    simulation = simulated(work, machine(2, memory=10), memory)
    simulation.run()
    assert simulation.order[0] == 0
    assert 5 <= simulation.order.index(1) <= 12


def test_a_task_that_takes_far_longer_than_expected_does_not_hold_up_the_rest() -> None:
    costs = [Cost(number=n, seconds=s, memory=0) for n, s in enumerate([2.0, *[1.9] * 20])]
    took = Simulation(machine(2), costs, [1000.0, *[1.9] * 20]).run()
    assert took == pytest.approx(1000.0)


def test_an_attempt_more_takes_its_turn() -> None:
    schedule, cost = Schedule(), Cost(number=3, seconds=1.0, memory=0)
    schedule.add(cost)
    schedule.next(machine(1), 0.0)
    schedule.ended(3)
    schedule.add(cost)
    assert (schedule.pending, schedule.running) == (1, 0)
    assert schedule.next(machine(1), 1.0) == [(3, 1)]


def job(command: str, **changed: object) -> Job:
    bake = BakeSettings(**changed)  # type: ignore[arg-type]
    chosen = Configured(bake=bake, store=StoreSettings(), image=ImageSettings())
    return Job(command=command, input=Path("a.glb"), output=Path("b.glb"), chosen=chosen)  # type: ignore[arg-type]


def test_costs_grow_with_what_is_to_be_done() -> None:
    small = estimated(0, job("vertex"), 10_000)
    assert estimated(0, job("vertex"), 20_000).seconds > small.seconds
    assert estimated(0, job("vertex"), 20_000).memory > small.memory
    assert estimated(0, job("vertex", rays=1024), 10_000).seconds > small.seconds
    assert estimated(0, job("texture", size=512), 10_000).seconds > small.seconds
    assert estimated(0, job("texture", size=1024), 10_000).memory > small.memory


def test_what_an_earlier_run_found_counts() -> None:
    known = estimated(4, job("vertex"), 10_000, seconds=12.5, peak=123)
    assert known == Cost(number=4, seconds=12.5, memory=123)

"""How far a batch is: a state that events change, and what can be told from it. Nothing here is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

from aobake.batch.tasks import Outcome, Task

__all__ = ["SILENT", "Progress", "Running", "Watcher", "ended", "planned", "refused", "started"]


class Watcher(Protocol):
    """Who is told what a batch does, as it does it."""

    def planned(self, total: int, skipped: int, cost: float) -> None:
        """Once: all jobs, those of them whose results stand, and what the others will cost together.

        cost : seconds of one thread, as far as they can be guessed
        """

    def refused(self, source: str, reason: str) -> None:
        """A job fails without being run."""

    def started(self, task: Task, cost: float) -> None:
        """A task begins, or begins again; cost : its share of the cost that was planned."""

    def ended(self, outcome: Outcome, *, again: bool = False) -> None:
        """A task ended; again : it will be tried once more."""

    def stopping(self, running: int, grace: float) -> None:
        """The batch was asked to stop: so many tasks still run, and have so many seconds to end."""

    def tick(self) -> None:
        """Time passes: called several times a second."""


@dataclass(frozen=True)
class Silent:
    """A watcher who does nothing."""

    def planned(self, total: int, skipped: int, cost: float) -> None:
        """Nothing."""

    def refused(self, source: str, reason: str) -> None:
        """Nothing."""

    def started(self, task: Task, cost: float) -> None:
        """Nothing."""

    def ended(self, outcome: Outcome, *, again: bool = False) -> None:
        """Nothing."""

    def stopping(self, running: int, grace: float) -> None:
        """Nothing."""

    def tick(self) -> None:
        """Nothing."""


SILENT: Watcher = Silent()


@dataclass(frozen=True, kw_only=True)
class Running:
    """A task that runs; since : when it began, by the clock of the events."""

    name: str
    since: float
    cost: float
    threads: int


@dataclass(frozen=True, kw_only=True)
class Progress:
    """A batch at one moment, by a clock that counts seconds.

    began : when the jobs were planned
    skipped, done, failed, stopped : jobs, of `total`; retried : attempts that came to nothing
    cost : of all that was to be run; cost_done : of what has ended
    running : number of a task -> it, the one that has run longest first
    """

    began: float = 0.0
    total: int = 0
    skipped: int = 0
    done: int = 0
    failed: int = 0
    stopped: int = 0
    retried: int = 0
    cost: float = 0.0
    cost_done: float = 0.0
    running: Mapping[int, Running] = field(default_factory=dict)

    @property
    def settled(self) -> int:
        """Jobs that need nothing more."""
        return self.skipped + self.done + self.failed + self.stopped

    def rate(self, now: float) -> float | None:
        """Assets that ended for each second so far; None before the first."""
        ended_so_far = self.done + self.failed
        return ended_so_far / (now - self.began) if ended_so_far and now > self.began else None

    def remaining_s(self, now: float) -> float | None:
        """Seconds that are left if costs go on as they went; None where nothing can be told yet.

        A running task counts by its time so far, but never as more than nine tenths done.
        """
        if self.settled == self.total:
            return 0.0
        under_way = sum(
            min(0.9 * task.cost, (now - task.since) * task.threads)
            for task in self.running.values()
        )
        paid = self.cost_done + under_way
        if paid <= 0.0 or now <= self.began or self.cost_done == 0.0:
            return None
        return max(0.0, self.cost - paid) * (now - self.began) / paid


def planned(now: float, *, total: int, skipped: int, cost: float) -> Progress:
    """A batch that begins now."""
    return Progress(began=now, total=total, skipped=skipped, cost=cost)


def refused(progress: Progress) -> Progress:
    """A job failed without being run."""
    return replace(progress, failed=progress.failed + 1)


def started(progress: Progress, task: Task, cost: float, now: float) -> Progress:
    """A task began."""
    new = Running(name=_named(task), since=now, cost=cost, threads=task.threads)
    return replace(progress, running={**progress.running, task.number: new})


def ended(progress: Progress, outcome: Outcome, *, again: bool = False) -> Progress:
    """A task ended. One that is tried again costs as much once more."""
    running = dict(progress.running)
    task = running.pop(outcome.number, None)
    cost = 0.0 if task is None else task.cost
    after = replace(progress, running=running)
    if again:
        return replace(after, retried=after.retried + 1)
    after = replace(after, cost_done=after.cost_done + cost)
    if outcome.status == "done":
        return replace(after, done=after.done + 1)
    if outcome.status == "stopped":
        return replace(after, stopped=after.stopped + 1)
    return replace(after, failed=after.failed + 1)


def _named(task: Task) -> str:
    """The asset of a task, below the folder of the batch where it is known to lie there."""
    path = task.job.input
    if task.source is not None and path.is_relative_to(task.source):
        path = path.relative_to(task.source)
    return path.as_posix()

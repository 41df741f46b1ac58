"""Huge texture bakes cut into tiles that several workers trace: an executor around another one.

A bake is laid out by one worker, traced by several, each its share of the rows, and put together by one.
Each step is a task like any other: watched, limited, and run again elsewhere where its worker is lost.
The result is the same, byte by byte.
"""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from aobake.batch.closing import Closing
from aobake.batch.parts import Part, Step, first_part
from aobake.batch.tasks import Capacity, Executor, Outcome, Task
from aobake.errors import AobakeError

__all__ = ["AUTO_SIZE", "TiledExecutor"]

AUTO_SIZE = 4096  # texels a side from which laying out twice costs little beside the tracing


@dataclass(eq=False)
class _Cut:
    """A task in tiles.

    first : its layout; step, threads : of the parts that were begun last, and that each of them has
    under_way : their numbers
    ended : what came of parts so far; failed : the first of those that were not done
    """

    task: Task
    first: Part
    begun: float
    step: Step = "layout"
    threads: int = 0
    under_way: set[int] = field(default_factory=set)
    ended: list[Outcome] = field(default_factory=list)
    failed: Outcome | None = None

    @property
    def more_threads(self) -> int:
        """Threads that its parts take now beyond those of the task."""
        return max(0, len(self.under_way) * self.threads - self.task.threads)


class TiledExecutor(Closing):
    """Hands tasks on to another executor, textures in parts where that has several workers."""

    def __init__(self, inner: Executor, tiles: Literal["auto", "on", "off"] = "auto") -> None:
        """Start nothing yet.

        tiles : what is cut: textures of AUTO_SIZE and more, all textures, or none
        """
        self._inner = inner
        self._tiles = tiles
        self._numbers = itertools.count(-1, -1)  # those of tasks are not negative
        self._cuts: dict[int, _Cut] = {}  # by the numbers of parts under way

    @property
    def capacity(self) -> Capacity:
        """That of the inner executor, without the threads that parts take beyond those of their tasks."""
        given = self._inner.capacity
        more = sum(cut.more_threads for cut in self._under_way())
        return replace(given, threads=max(0, given.threads - more))

    def start(self, task: Task) -> None:
        """Take a task; returns at once."""
        workers = self._inner.capacity.workers
        output = _output(task)
        if output is None or not self._worth_cutting(task, workers):
            self._inner.start(task)
            return
        cut = _Cut(task=task, first=first_part(output, workers), begun=time.monotonic())
        self._begin(cut, [cut.first], task.threads)

    def finished(self, timeout: float) -> Sequence[Outcome]:
        """Outcomes of whole tasks since the last call; waits up to `timeout` seconds for the first."""
        until = time.monotonic() + timeout
        while True:
            ended = [
                whole
                for outcome in self._inner.finished(max(0.0, until - time.monotonic()))
                for whole in self._after(outcome, goes_on=True)
            ]
            if ended or time.monotonic() >= until:
                return ended

    def stop(self, grace: float) -> Sequence[Outcome]:
        """Let running parts end for `grace` seconds; a task whose last part was not among them is "stopped"."""
        return [
            whole
            for outcome in self._inner.stop(grace)
            for whole in self._after(outcome, goes_on=False)
        ]

    def close(self) -> None:
        """End all workers, and remove what parts have handed on."""
        self._inner.close()
        for cut in self._under_way():
            _clear(cut)
        self._cuts.clear()

    def _under_way(self) -> list[_Cut]:
        return list({id(cut): cut for cut in self._cuts.values()}.values())

    def _worth_cutting(self, task: Task, workers: int) -> bool:
        if task.job.command != "texture" or workers < 2:
            return False
        return self._tiles == "on" or (
            self._tiles == "auto" and task.job.chosen.bake.size >= AUTO_SIZE
        )

    def _begin(self, cut: _Cut, parts: Sequence[Part], threads: int) -> None:
        limit, spent = cut.task.timeout, time.monotonic() - cut.begun
        cut.step, cut.threads = parts[0].step, threads
        for part in parts:
            number = next(self._numbers)
            cut.under_way.add(number)
            self._cuts[number] = cut
            self._inner.start(
                replace(
                    cut.task,
                    number=number,
                    threads=threads,
                    part=part,
                    timeout=None if limit is None else max(1.0, limit - spent),
                )
            )

    def _after(self, outcome: Outcome, *, goes_on: bool) -> Sequence[Outcome]:
        """What an outcome means for whole tasks; the next step of one begins where it goes on."""
        cut = self._cuts.pop(outcome.number, None)
        if cut is None:
            return [outcome]
        cut.under_way.remove(outcome.number)
        cut.ended.append(outcome)
        if outcome.status != "done" and cut.failed is None:
            cut.failed = outcome
        if cut.under_way:
            return []
        if cut.failed is None and cut.step != "join" and goes_on:
            self._next_step(cut)
            return []
        _clear(cut)
        return [_whole(cut, outcome)]

    def _next_step(self, cut: _Cut) -> None:
        if cut.step == "layout":
            tiles = [
                replace(cut.first, step="trace", number=number) for number in range(cut.first.count)
            ]
            self._begin(cut, tiles, self._inner.capacity.most_threads)
        else:
            self._begin(cut, [replace(cut.first, step="join")], cut.task.threads)


def _output(task: Task) -> str | None:
    """The output of a task, relative to the folder of all outputs; None where there is no such folder."""
    output = task.job.output
    if task.target is not None and output.is_relative_to(task.target):
        return output.relative_to(task.target).as_posix()
    return None if task.remote is None or output.is_absolute() else output.as_posix()


def _whole(cut: _Cut, last: Outcome) -> Outcome:
    """The outcome of a task whose parts have ended."""
    told = cut.failed or last
    if told.status == "done" and cut.step != "join":
        why = f"{cut.task.job.input}: the batch was stopped before all its tiles were done."
        told = replace(told, status="stopped", reason=why)
    return replace(
        told,
        number=cut.task.number,
        seconds=time.monotonic() - cut.begun,
        peak_bytes=max(part.peak_bytes for part in cut.ended),
        worker=", ".join(dict.fromkeys(part.worker for part in cut.ended if part.worker)),
    )


def _clear(cut: _Cut) -> None:
    """Remove what parts have handed on. What cannot be removed stays: the next batch tries again."""
    remote, target = cut.task.remote, cut.task.target
    with contextlib.suppress(AobakeError, OSError):
        if target is None and remote is not None:
            from aobake.batch.remote import RemoteFolder

            there = RemoteFolder(remote.target, remote.options)
            for name in cut.first.files:
                there.remove(name)
        elif target is not None:
            for name in cut.first.files:
                (target / name).unlink(missing_ok=True)

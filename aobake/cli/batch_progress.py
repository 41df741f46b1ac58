"""What `aobake batch` shows while it works: a live display on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePath

from aobake.batch import progress
from aobake.batch.progress import Progress, Running, Watcher
from aobake.batch.tasks import Outcome, Task
from aobake.cli import terminal

__all__ = ["lines_of", "standing", "watching"]

Tell = Callable[[str], None]

MOST_SHOWN = 8  # running assets
LONGEST_NAME = 56
BETWEEN_LINES_S = 10.0
MOST_ALIKE = 3  # failures of one kind that are told of one by one


@contextlib.contextmanager
def watching(*, quiet: bool, clock: Callable[[], float] = time.monotonic) -> Iterator[Watcher]:
    """A watcher of a batch that shows what it is told, on stderr.

    quiet : nothing but failures, which are always told, a line each, as they happen; of those that differ in
    nothing but the asset the first three, and at the end how many more there were
    """
    with contextlib.nullcontext() if quiet else terminal.live_lines() as draw:
        between_s = BETWEEN_LINES_S if draw is None and not quiet else None
        watcher = _Watching(clock, draw=draw, between_s=between_s)
        yield watcher
        watcher.close()


def lines_of(state: Progress, now: float) -> list[str]:
    """The lines of the display: how far it is, then the running assets with their seconds."""
    running = list(state.running.values())
    lines = [standing(state, now), *(_row(task, now) for task in running[:MOST_SHOWN])]
    more = len(running) - MOST_SHOWN
    return [*lines, f"  and {more} more"] if more > 0 else lines


def standing(state: Progress, now: float) -> str:
    """How far a batch is, in one line."""
    parts = [f"{state.settled:,} of {state.total:,} assets"]
    if state.skipped:
        parts.append(f"{state.skipped:,} unchanged")
    if state.failed:
        parts.append(f"{state.failed:,} failed")
    if state.retried:
        parts.append(f"{state.retried:,} tried again")
    rate, left = state.rate(now), state.remaining_s(now)
    if rate is not None:
        parts.append(f"{rate:.1f} a second" if rate >= 1.0 else f"{60.0 * rate:.1f} a minute")
    if left is not None and state.settled < state.total:
        parts.append(f"about {_duration(left)} left")
    return ", ".join(parts)


@dataclass
class _Watching:
    """Keeps the state of a batch, and shows it: drawn at each turn, or in a line after so many seconds."""

    clock: Callable[[], float]
    draw: terminal.Draw | None
    between_s: float | None
    state: Progress = field(default_factory=Progress)
    said: str = ""
    said_at: float = 0.0
    failures: Counter[tuple[Tell, str]] = field(default_factory=Counter)
    assets: dict[int, str] = field(default_factory=dict)

    def planned(self, total: int, skipped: int, cost: float) -> None:
        self.said_at = self.clock()
        self.state = progress.planned(self.said_at, total=total, skipped=skipped, cost=cost)

    def refused(self, source: str, reason: str) -> None:
        self.state = progress.refused(self.state)
        self._tell(source, reason or source, terminal.error)

    def started(self, task: Task, cost: float) -> None:
        self.state = progress.started(self.state, task, cost, self.clock())
        self.assets[task.number] = task.job.input.name

    def ended(self, outcome: Outcome, *, again: bool = False) -> None:
        self.state = progress.ended(self.state, outcome, again=again)
        asset = self.assets.pop(outcome.number, "")
        if again:
            self._tell(asset, f"{outcome.reason} It is tried again.", terminal.warning)
        elif outcome.status not in {"done", "stopped"}:
            self._tell(asset, outcome.reason, terminal.error)

    def stopping(self, running: int, grace: float) -> None:
        told = self.draw is not None or self.between_s is not None
        if told and running and grace:
            assets, them = (
                ("1 asset has", "it") if running == 1 else (f"{running:,} assets have", "them")
            )
            terminal.note(f"stopping; {assets} {grace:g} s to end. Ctrl-C again ends {them} now.")

    def tick(self) -> None:
        now = self.clock()
        if self.draw is not None:
            self.draw(self.state.settled / max(1, self.state.total), lines_of(self.state, now))
        elif self.between_s is not None and now - self.said_at >= self.between_s:
            self._say(now)

    def close(self) -> None:
        """Say how many failures were not told of, and where it ended if lines are said and it came to an end."""
        for (tell, finding), count in self.failures.items():
            if count > MOST_ALIKE:
                tell(f"and {count - MOST_ALIKE:,} more, which the report names: {finding}")
        ran = self.state.settled > self.state.skipped and self.state.settled == self.state.total
        if self.between_s is not None and ran and not self.state.stopped:
            self._say(self.clock())

    def _tell(self, asset: str, reason: str, tell: Tell) -> None:
        """Tell of a failure, unless enough like it were told of."""
        kind = tell, _finding(reason, asset)
        self.failures[kind] += 1
        if self.failures[kind] <= MOST_ALIKE:
            tell(reason)

    def _say(self, now: float) -> None:
        line = standing(self.state, now)
        if line != self.said:
            terminal.note(line)
        self.said, self.said_at = line, now


def _finding(reason: str, asset: str) -> str:
    """A reason without the file that it begins with; the whole of one that does not begin with the asset."""
    file, colon, finding = reason.partition(": ")
    return finding if colon and asset and PurePath(file).name == PurePath(asset).name else reason


def _row(task: Running, now: float) -> str:
    name = task.name if len(task.name) <= LONGEST_NAME else "…" + task.name[1 - LONGEST_NAME :]
    threads = f", {task.threads} threads" if task.threads > 1 else ""
    return f"  {name}  {_duration(now - task.since)}{threads}"


def _duration(seconds: float) -> str:
    """Seconds as people say them."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"

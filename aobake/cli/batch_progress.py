"""What `aobake batch` shows while it works: a live display on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from aobake.batch import progress
from aobake.batch.progress import Progress, Running, Watcher
from aobake.batch.tasks import Outcome, Task
from aobake.cli import terminal

__all__ = ["lines_of", "standing", "watching"]

MOST_SHOWN = 8  # running assets
LONGEST_NAME = 56
BETWEEN_LINES_S = 10.0


@contextlib.contextmanager
def watching(*, quiet: bool, clock: Callable[[], float] = time.monotonic) -> Iterator[Watcher]:
    """A watcher of a batch that shows what it is told, on stderr.

    quiet : nothing but failures, which are always told, a line each, as they happen
    """
    if quiet:
        yield _Watching(clock, draw=None, between_s=None)
        return
    with terminal.live_lines() as draw:
        between_s = BETWEEN_LINES_S if draw is None else None
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

    def planned(self, total: int, skipped: int, cost: float) -> None:
        self.said_at = self.clock()
        self.state = progress.planned(self.said_at, total=total, skipped=skipped, cost=cost)

    def refused(self, source: str, reason: str) -> None:
        self.state = progress.refused(self.state)
        terminal.error(reason or source)

    def started(self, task: Task, cost: float) -> None:
        self.state = progress.started(self.state, task, cost, self.clock())

    def ended(self, outcome: Outcome, *, again: bool = False) -> None:
        self.state = progress.ended(self.state, outcome, again=again)
        if again:
            terminal.warn([f"{outcome.reason} It is tried again."], "")
        elif outcome.status not in {"done", "stopped"}:
            terminal.error(outcome.reason)

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
        """Say where it ended, where lines are said and it came to an end."""
        ran = self.state.settled > self.state.skipped and self.state.settled == self.state.total
        if self.between_s is not None and ran and not self.state.stopped:
            self._say(self.clock())

    def _say(self, now: float) -> None:
        line = standing(self.state, now)
        if line != self.said:
            terminal.note(line)
        self.said, self.said_at = line, now


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

"""Who does what among the worker processes of this machine, and what becomes of those that break.

All of it belongs to one thread, which hears of everything through one queue: tasks to start, what workers
say and that they died, and the wish to stop. So there are no locks, and nothing is asked again and again;
only where memory is limited, what is held is looked at.
"""

from __future__ import annotations

import contextlib
import math
import queue
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

from aobake.batch.child import Child, Heard
from aobake.batch.scratch import remove_abandoned
from aobake.batch.tasks import Outcome, Status, Task
from aobake.batch.worker import Ready
from aobake.errors import EngineError

__all__ = ["Event", "Stop", "Supervisor"]

LOOK_S = 0.05  # between two looks at what a process holds: it can take 0.2 GB more meanwhile
LINGER_BYTES = (
    1 << 30
)  # a process that still holds more than this after its task makes room for another one
END_S = 5.0  # in which a process that was killed has to be gone


@dataclass(frozen=True)
class Stop:
    """The wish that all tasks are over at a moment of time.monotonic, and that none is begun any more."""

    until: float


Event = Task | Stop | Heard | None
"""What a supervisor hears; None: it is to end, and all workers with it."""


@dataclass(eq=False)
class Member:
    """A worker and what it is at.

    task, since : what it does, and the moment at which it began; None where it is idle. To start a process and
        to compile kernels is not counted as time
    until, then : the moment at which its task is ended, and what has become of it in that case
    ended : the same, once it was ended
    """

    child: Child
    task: Task | None = None
    since: float = 0.0
    until: float = math.inf
    then: Status = "timeout"
    ended: Status | None = None
    peak: int = 0

    def begin(self, now: float) -> None:
        """Count the time of its task from now."""
        self.since = now
        if self.task and self.task.timeout and now + self.task.timeout < self.until:
            self.until, self.then = now + self.task.timeout, "timeout"

    def end(self, status: Status, now: float) -> None:
        """End it, because of what its task does or for want of time."""
        self.ended, self.until = status, now + END_S
        self.child.kill()


class Supervisor:
    """Workers and the tasks that wait for them. It is made and used by the one thread that runs it."""

    def __init__(
        self,
        command: Sequence[str],
        most: int,
        events: queue.SimpleQueue[Event],
        outcomes: queue.SimpleQueue[Outcome | Exception],
    ) -> None:
        """Start no worker yet. command : starts one; most : at the same time"""
        self._command, self._most = command, most
        self._events, self._outcomes = events, outcomes
        self._members: dict[Child, Member] = {}
        self._waiting: deque[Task] = deque()

    def run(self) -> None:
        """Go on until it hears None. What goes wrong with itself is put among the outcomes, and ends it."""
        try:
            remove_abandoned()
            while self._hear():
                self._look()
                self._hand_out()
        except Exception as error:  # noqa: BLE001 - a thread that just ends would be waited for for ever
            self._outcomes.put(error)
        finally:
            for member in list(self._members.values()):
                member.child.kill()
            for member in list(self._members.values()):
                self._dismiss(member)

    def _hear(self) -> bool:
        """Take in one event, or none where it is time to look first. False: it is the last."""
        try:
            event = self._events.get(timeout=self._patience())
        except queue.Empty:
            return True
        match event:
            case Task():
                self._waiting.append(event)
            case Stop(until):
                self._stop(until)
            case Heard(child, answer) if child in self._members:
                self._answered(self._members[child], answer)
        return event is not None

    def _patience(self) -> float | None:
        """Seconds until the next look is due; None: no look is."""
        busy = [member for member in self._members.values() if member.task]
        wait = min((member.until for member in busy), default=math.inf) - time.monotonic()
        if any(member.task and member.task.memory for member in busy):
            wait = min(wait, LOOK_S)
        return None if wait == math.inf else max(0.0, min(wait, 3600.0))

    def _answered(self, member: Member, answer: Ready | Outcome | None) -> None:
        match answer:
            case Ready():
                member.begin(time.monotonic())
            case Outcome():
                self._outcomes.put(replace(answer, peak_bytes=max(answer.peak_bytes, member.peak)))
                member.task = None
                spent = answer.status == "memory" or member.child.bytes_held > LINGER_BYTES
                if spent or member.ended:
                    self._dismiss(member)
            case None:
                self._lost(member)

    def _look(self) -> None:
        """End workers whose task takes too much memory or time."""
        now = time.monotonic()
        for member in list(self._members.values()):
            if member.task is None:
                continue
            if member.task.memory and not member.ended:
                held = member.child.bytes_held
                member.peak = max(member.peak, held)
                if held > member.task.memory:
                    member.end("memory", now)
            if now >= member.until:
                if member.ended:  # killed, and still there
                    self._lost(member)
                else:
                    member.end(member.then, now)

    def _hand_out(self) -> None:
        while self._waiting:
            member = next((one for one in self._members.values() if one.task is None), None)
            if member is None and len(self._members) < self._most:
                member = self._new()
            if member is None:
                return
            self._give(member, self._waiting.popleft())

    def _new(self) -> Member | None:
        """A worker more; None where the system refuses now, but others are at work. Raises EngineError."""
        try:
            child = Child(self._command, self._events.put)
        except EngineError:
            if not self._members:
                raise
            return None
        self._members[child] = Member(child)
        return self._members[child]

    def _give(self, member: Member, task: Task) -> None:
        member.task, member.since = task, time.monotonic()
        member.until, member.peak = math.inf, 0
        member.child.give(task)

    def _stop(self, until: float) -> None:
        for task in self._waiting:
            self._outcomes.put(
                _outcome(task, "stopped", "it was not begun before the batch was stopped")
            )
        self._waiting.clear()
        for member in self._members.values():
            if member.task and not member.ended and until < member.until:
                member.until, member.then = until, "stopped"

    def _lost(self, member: Member) -> None:
        """A worker is gone, or cannot be helped any more: say what became of its task."""
        self._dismiss(member)
        task, child = member.task, member.child
        if task is None:
            return
        status = member.ended or ("memory" if child.lacked_memory() else "crashed")
        told = _outcome(task, status, _reason(task, status, child))
        took = time.monotonic() - member.since
        self._outcomes.put(replace(told, seconds=took, peak_bytes=member.peak, worker=child.name))

    def _dismiss(self, member: Member) -> None:
        """End a worker, and remove the files that it had not finished writing."""
        del self._members[member.child]
        member.child.close()
        if member.task and member.child.part:
            for left in member.task.job.output.parent.glob(f"{member.child.part}*.part"):
                with contextlib.suppress(OSError):
                    left.unlink()


def _outcome(task: Task, status: Status, reason: str) -> Outcome:
    line = " ".join(f"{task.job.input}: {reason}.".splitlines())
    return Outcome(number=task.number, status=status, reason=line)


def _reason(task: Task, status: Status, child: Child) -> str:
    match status:
        case "memory" if task.memory:
            return f"it took more than the {task.memory / 1e9:.3g} GB of memory that it may"
        case "memory":
            return "there was not enough memory for it"
        case "timeout":
            return f"it took longer than the {task.timeout:g} s that it may"
        case "stopped":
            return "it was still running when the batch was stopped"
    return f"its process crashed ({child.died_of()})"

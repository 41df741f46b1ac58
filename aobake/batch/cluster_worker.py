"""What a worker of a cluster does for a batch: each task in a process of its own, so that none harms the worker.

These functions are called by name in the worker's process. Nothing else is ever sent there but tasks.
"""

from __future__ import annotations

import os
import socket
import threading
from dataclasses import replace
from pathlib import Path

from aobake import __version__
from aobake.batch.processes import LocalExecutor
from aobake.batch.tasks import Outcome, Task

__all__ = ["about", "end", "perform", "retire", "unseen"]

LOOK_S = 0.5  # between two looks at whether the batch was ended


class _Staff:
    """The executors of this worker that have nothing to do, with a warm process each; and batches that were ended."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.idle: list[LocalExecutor] = []
        self.ended: set[str] = set()

    def taken(self) -> LocalExecutor:
        """An executor of one process, a warm one if there is any."""
        with self.lock:
            if self.idle:
                return self.idle.pop()
        return LocalExecutor(processes=1)

    def given_back(self, executor: LocalExecutor) -> None:
        """Keep an executor for the next task."""
        with self.lock:
            self.idle.append(executor)


_STAFF = _Staff()


def perform(task: Task, batch: str, version: str) -> Outcome:
    """Do a task in a process of its own.

    batch : who asks, so that `end` can end all that it asked for
    version : of aobake that is asked for
    """
    host = socket.gethostname()
    if version != __version__:
        why = f"{host} has aobake {__version__}, and {version} is asked for."
        return Outcome(number=task.number, status="failed", reason=f"{task.job.input}: {why}")
    executor = _STAFF.taken()
    executor.start(task)
    while not (outcomes := executor.finished(LOOK_S)):
        if batch in _STAFF.ended:
            outcomes = executor.stop(0.0)
            break
    if outcomes[0].status == "stopped":
        executor.close()
    else:
        _STAFF.given_back(executor)
    return replace(outcomes[0], worker=f"{host}, {outcomes[0].worker}")


def end(batch: str) -> None:
    """End all that runs here for a batch, and all that comes later."""
    _STAFF.ended.add(batch)


def retire() -> None:
    """End all processes that have nothing to do."""
    with _STAFF.lock:
        idle, _STAFF.idle = _STAFF.idle, []
    for executor in idle:
        executor.close()


def about() -> str:
    """The version of aobake that this worker has."""
    return __version__


def unseen(source: str, probe: str, content: str) -> str:
    """The folder that this worker does not see or cannot write into; '' where both are fine.

    source : a folder; probe : a file with this content in another one; '' for either: there is none
    """
    if source and not os.access(source, os.R_OK | os.X_OK):
        return source
    file = Path(probe)
    try:
        seen = file.read_text(encoding="ascii") == content and os.access(file.parent, os.W_OK)
    except (OSError, ValueError):
        seen = False
    return "" if seen or not probe else str(file.parent)

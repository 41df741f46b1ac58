"""The local executor: tasks in processes of this machine, which may break without harm to others."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Sequence

from aobake.batch.child import WORKER
from aobake.batch.closing import Closing
from aobake.batch.limits import memory_to_give
from aobake.batch.supervisor import Event, Stop, Supervisor
from aobake.batch.tasks import Capacity, Outcome, Task
from aobake.environment import processors

__all__ = ["LocalExecutor"]

TYPICAL_BYTES = 512 << 20  # of a process and a small asset, for how many processes there may be


class LocalExecutor(Closing):
    """Runs tasks in worker processes on this machine. It is to be closed, or used as a context."""

    def __init__(
        self,
        *,
        processes: int | None = None,
        threads: int | None = None,
        memory: int | None = None,
        command: Sequence[str] = WORKER,
    ) -> None:
        """Start no process yet.

        processes : at most; None: one for each thread, if memory allows
        threads : of all tasks together; None: one per processor
        memory : bytes of all tasks together; None: what is free now
        command : what starts a worker: a program that calls aobake.batch.worker.serve
        """
        threads = threads or processors()
        memory = memory or memory_to_give()
        workers = processes or max(1, min(threads, memory // TYPICAL_BYTES))
        self._capacity = Capacity(
            threads=threads, most_threads=threads, memory=memory, workers=workers
        )
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._outcomes: queue.SimpleQueue[Outcome | Exception] = queue.SimpleQueue()
        self._under_way = 0
        supervisor = Supervisor(command, workers, self._events, self._outcomes)
        # A thread that lives as long as this: Linux ends a worker with the thread that started it.
        self._thread = threading.Thread(target=supervisor.run, name="aobake-executor", daemon=True)
        self._thread.start()

    @property
    def capacity(self) -> Capacity:
        """Threads, memory and processes, as they were given or found at the start."""
        return self._capacity

    def start(self, task: Task) -> None:
        """Take a task; returns at once. Where no process is free, the task waits for one."""
        self._under_way += 1
        self._events.put(task)

    def finished(self, timeout: float) -> Sequence[Outcome]:
        """Outcomes since the last call; waits up to `timeout` seconds for the first.

        Raises EngineError where the system starts no process.
        """
        outcomes: list[Outcome] = []
        with contextlib.suppress(queue.Empty):
            found = self._outcomes.get(timeout=timeout)
            while True:
                if isinstance(found, Exception):
                    raise found
                outcomes.append(found)
                self._under_way -= 1
                found = self._outcomes.get_nowait()
        return outcomes

    def stop(self, grace: float) -> Sequence[Outcome]:
        """Let running tasks end for `grace` seconds, end the others ("stopped"); their outcomes."""
        self._events.put(Stop(time.monotonic() + grace))
        outcomes: list[Outcome] = []
        while self._under_way and self._thread.is_alive():
            outcomes += self.finished(1.0)
        return outcomes

    def close(self) -> None:
        """End all processes, and remove what they had not finished writing."""
        self._events.put(None)
        self._thread.join()

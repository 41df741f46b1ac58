"""A cluster of real processes on this machine, and tasks for it."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from aobake.batch.tasks import Executor, Outcome, Remote, Task
from aobake.config import Configured
from aobake.jobs import Command, Job
from aobake.settings import BakeSettings, ImageSettings, StoreSettings
from tests.scenes import icosphere, joined, obj_text, patch

__all__ = ["LIMIT_S", "Farm", "all_of", "far", "farm", "floor_and_ball", "task_of", "tree", "until"]

LIMIT_S = 100.0  # nothing here takes a tenth of it on an idle machine


@dataclass
class Farm:
    """A scheduler and its workers, each a process. address : of the scheduler"""

    folder: Path
    address: str = ""
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def begin(self, *arguments: str) -> subprocess.Popen[bytes]:
        """Start one of dask's commands; what it says is kept in a file."""
        said = (self.folder / f"said{len(self.processes)}.txt").open("wb")
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
        )
        said.close()
        self.processes.append(process)
        return process

    def worker(self, threads: int = 1) -> subprocess.Popen[bytes]:
        """Start a worker, which is not there yet when this returns."""
        return self.begin(
            "worker", self.address, "--no-nanny", "--no-dashboard", "--nthreads", str(threads)
        )

    def said(self) -> str:
        """Everything that was said."""
        return "\n".join(
            path.read_text(errors="replace") for path in sorted(self.folder.glob("said*.txt"))
        )


@contextlib.contextmanager
def farm(folder: Path, workers: int) -> Iterator[Farm]:
    """A scheduler with workers of one thread each, which may still be on their way."""
    made = Farm(folder)
    try:
        file = folder / "scheduler.json"
        made.begin(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show",
            "--scheduler-file", str(file),
        )  # fmt: skip
        until(lambda: file.exists() and file.read_text().endswith("}"), made)
        made.address = json.loads(file.read_text())["address"]
        for _ in range(workers):
            made.worker()
        yield made
    finally:
        for process in reversed(made.processes):
            process.kill()
            process.wait()


def until(true: Callable[[], object], what: object = None) -> None:
    """Wait for something to become true."""
    end = time.monotonic() + LIMIT_S
    while not true():
        told = what.said() if isinstance(what, Farm) else what
        assert time.monotonic() < end, told
        time.sleep(0.05)


def all_of(executor: Executor, tasks: Sequence[Task], *, begun: bool = False) -> dict[int, Outcome]:
    """Start tasks, unless they were begun, and wait for all of them; number -> outcome."""
    for task in () if begun else tasks:
        executor.start(task)
    outcomes: dict[int, Outcome] = {}
    end = time.monotonic() + LIMIT_S
    while len(outcomes) < len(tasks):
        assert time.monotonic() < end, outcomes
        outcomes |= {outcome.number: outcome for outcome in executor.finished(1.0)}
    return outcomes


def floor_and_ball(path: Path, fine: int = 2) -> None:
    """A ball over a floor, as an OBJ file. fine : how often the faces of the ball are cut into four"""
    mesh = joined(
        patch((-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2), 4, 4),
        icosphere(fine, 0.8, (0.0, 1.0, 0.0)),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(obj_text(mesh), encoding="ascii")


def task_of(
    source: Path,
    target: Path,
    name: str,
    number: int = 0,
    *,
    output: str = "",
    command: Command = "vertex",
    bake: BakeSettings | None = None,
    timeout: float | None = None,
    memory: int | None = None,
) -> Task:
    """A task with one thread. name : of the asset in the source; output : in the target, None: the same"""
    chosen = Configured(
        bake=bake or BakeSettings(rays=16), store=StoreSettings(), image=ImageSettings()
    )
    job = Job(command=command, input=source / name, output=target / (output or name), chosen=chosen)
    return Task(
        number=number,
        job=job,
        threads=1,
        source=source,
        target=target,
        timeout=timeout,
        memory=memory,
    )


def far(task: Task, source: str, target: str) -> Task:
    """The same task with its files in remote folders."""
    assert task.source is not None
    assert task.target is not None
    job = replace(
        task.job,
        input=task.job.input.relative_to(task.source),
        output=task.job.output.relative_to(task.target),
    )
    return replace(
        task, job=job, source=None, target=None, remote=Remote(source=source, target=target)
    )


def tree(folder: Path) -> dict[str, bytes]:
    """All files below a folder."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }

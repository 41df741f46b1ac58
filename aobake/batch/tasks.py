"""What passes between the parts of a batch: what is planned, what is handed to a worker, what comes back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from aobake.batch.parts import Part
from aobake.batch.settings import Pictures
from aobake.jobs import Job

__all__ = [
    "Capacity",
    "Entry",
    "Executor",
    "Outcome",
    "Pictures",
    "Planned",
    "Remote",
    "Status",
    "Task",
]

Status = Literal["done", "failed", "crashed", "memory", "timeout", "stopped"]
"""How a task ended: done; failed with an error of its own; crashed with its process; over its memory;
over its time; or stopped because the batch was."""


@dataclass(frozen=True, kw_only=True)
class Remote:
    """Where files are that are not on this machine: fsspec URLs of the two folders, without a slash at the end."""

    source: str
    target: str
    options: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A job of a batch.

    source, target : the asset and its output, relative to their two folders, with forward slashes
    job : the same with the paths to use; where the folders are remote, its paths are relative
    size : of the asset, in bytes
    refused : why it cannot be done, in one line; '' where it can. It is reported as failed, never run, and
        has no target: ''
    """

    source: str
    target: str
    job: Job
    size: int
    refused: str = ""


@dataclass(frozen=True, kw_only=True)
class Task:
    """A job as it is handed to a worker.

    number : of the job in this batch
    threads : that it may use; the result does not depend on it
    memory : bytes that its process may hold, or None
    timeout : seconds that it may take, or None
    attempt : 1 for the first
    source, target : the two folders on the machine of the worker, which names in the outcome are relative to;
        None: such names are paths
    remote : where the files are, if not on the machine of the worker; paths of the job are relative then
    part : the step of a bake in tiles that this is; None: the whole of it
    """

    number: int
    job: Job
    threads: int
    pictures: Pictures = "none"
    memory: int | None = None
    timeout: float | None = None
    attempt: int = 1
    source: Path | None = None
    target: Path | None = None
    remote: Remote | None = None
    part: Part | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a task.

    reason : why it did not end as done, in one line that begins with the file; '' where it did
    report : the report of the job as report.Report.to_json() has it, as a dict; None unless done
    inputs : every file that the job read, the asset first, relative to the source folder where it lies in
        it (forward slashes), absolute else; with its sha256, '' for what it refers to and is not there
    outputs : every file that it wrote, the one asked for first, relative to the target folder
    seconds : from being started to the end; peak_bytes : the most memory that its process held, 0: unknown
    pictures : name ("before", "after") -> PNG; "viewer" -> an HTML page
    worker : who did it, for people: a process number or an address
    """

    number: int
    status: Status
    reason: str = ""
    report: Mapping[str, object] | None = None
    inputs: tuple[tuple[str, str], ...] = ()
    outputs: tuple[tuple[str, str], ...] = ()
    seconds: float = 0.0
    peak_bytes: int = 0
    pictures: Mapping[str, bytes] = field(default_factory=dict)
    worker: str = ""


@dataclass(frozen=True, kw_only=True)
class Capacity:
    """What an executor has to give at once: threads over all its workers, bytes of memory, and workers.

    most_threads : that one task can be given
    """

    threads: int
    most_threads: int
    memory: int
    workers: int


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One job as reports show it, whether it was run now or stands from before.

    state : baked now; unchanged since an earlier run; moved from another name and reused; or one of the
        ways to fail (Status)
    input_bytes, output_bytes : of all files read and written; seconds, peak_bytes : of the run that baked it
    attempts : in this run; 0 where it was not run
    report : of the job, as a dict with the keys of docs/report.md; None where it failed
    """

    source: str
    target: str
    command: str
    state: Literal[
        "baked", "unchanged", "moved", "failed", "crashed", "memory", "timeout", "stopped"
    ]
    reason: str
    seconds: float
    peak_bytes: int
    attempts: int
    input_bytes: int
    output_bytes: int
    outputs: tuple[str, ...]
    settings: Mapping[str, object]
    settings_files: tuple[str, ...]
    report: Mapping[str, object] | None


class Executor(Protocol):
    """Runs tasks, each in a process that may break without harm to others: on this machine or a cluster."""

    @property
    def capacity(self) -> Capacity:
        """What it has to give now; a cluster's may change."""

    def start(self, task: Task) -> None:
        """Take a task; returns at once. The caller does not start more than the capacity allows."""

    def finished(self, timeout: float) -> Sequence[Outcome]:
        """Outcomes since the last call; waits up to `timeout` seconds for the first."""

    def stop(self, grace: float) -> Sequence[Outcome]:
        """Let running tasks end for `grace` seconds, end the others ("stopped"); their outcomes."""

    def close(self) -> None:
        """End all workers. Nothing that they were writing stays half-written."""

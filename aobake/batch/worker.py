"""A worker: a process that does one task after another, until its parent ends it or is gone.

Tasks come in, and answers go out, as pickles through the two pipes that it is born with as standard
input and output. Both are put aside first, so that whatever a library prints goes to standard error and
cannot break an answer. It is kept for many tasks: to import what a bake needs takes a second.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import pickle
import queue
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from aobake import files
from aobake.batch import limits, parts
from aobake.batch.compiling import compile_for
from aobake.batch.tasks import Outcome, Status, Task
from aobake.errors import AobakeError
from aobake.jobs import Done, Job, run_job

__all__ = ["Ready", "serve", "work"]


@dataclass(frozen=True)
class Ready:
    """What a worker says when it begins a task. part : how the names of its unfinished files begin."""

    part: str


def work(task: Task) -> Outcome:
    """Do a task in this process.

    What goes wrong is told by the outcome, and not raised: "failed" or "memory".
    """
    start = time.perf_counter()
    limits.forget_peak()
    try:
        with limits.allocations_limited(task.memory, task.threads):
            outcome = _baked(task)
    except AobakeError as error:
        outcome = _not_done(task, "memory" if _for_want_of_memory(error) else "failed", str(error))
    except MemoryError:
        outcome = _not_done(task, "memory", f"{task.job.input}: there is not enough memory for it.")
    except Exception as error:  # noqa: BLE001 - whatever it is, it concerns this asset alone
        outcome = _not_done(task, "failed", f"{task.job.input}: {_bug(error)}")
    return replace(
        outcome,
        seconds=time.perf_counter() - start,
        peak_bytes=limits.peak_bytes(),
        worker=f"process {os.getpid()}",
    )


def serve(do: Callable[[Task], Outcome] = work) -> None:
    """Do tasks as they come in, one after another; does not return, but ends with the parent process."""
    tasks, answers = _pipes()
    _end_with_parent()
    waiting: queue.SimpleQueue[Task] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(tasks, waiting), daemon=True).start()
    _load()
    while True:
        task = waiting.get()
        if task.timeout is not None:
            compile_for(task)
        _say(answers, Ready(files.PART))
        answer = do(task)
        _tidy_up()
        _say(answers, answer)


def _baked(task: Task) -> Outcome:
    if task.remote is not None:
        from aobake.batch.parcels import delivered

        return delivered(task, work)
    asked = task.job.chosen.bake
    chosen = replace(task.job.chosen, bake=replace(asked, threads=task.threads))
    job = replace(task.job, chosen=chosen)
    files.make_folder(job.output.parent, needed_by=str(job.output))
    if task.part is None or task.target is None:
        return _outcome(task, run_job(job))
    if task.part.step == "join":
        return _outcome(task, run_job(job, instead=parts.join_bake(task.part, task.target)))
    parts.make_part(task.part, job, task.target)
    return Outcome(number=task.number, status="done")


def _outcome(task: Task, done: Done) -> Outcome:
    pictures, trouble = _pictures(task, done)
    told = json.loads(done.report.to_json())
    # How the batch went about it is no part of what was asked.
    told["settings"]["threads"] = task.job.chosen.bake.threads
    told["warnings"] += trouble
    return Outcome(
        number=task.number,
        status="done",
        report=told,
        inputs=(
            *((_named(f.path, task.source), f.sha256) for f in done.report.inputs),
            *((_named(path, task.source), "") for path in _absent(task.job)),
        ),
        outputs=tuple((_named(f.path, task.target), f.sha256) for f in done.report.outputs),
        pictures=pictures,
    )


def _absent(job: Job) -> Iterator[str]:
    """The paths of files that the asset refers to and may read, but that are not there."""
    from aobake.meshes.formats.references import references

    folder = os.path.abspath(job.input.parent)  # noqa: PTH100 - resolve() would follow links
    limit = os.path.abspath(job.reading.root or folder)  # noqa: PTH100
    for name in references(job.input):
        path = os.path.normpath(os.path.join(folder, name))  # noqa: PTH118 - as it is
        if Path(path).is_relative_to(limit) and not os.path.exists(path):  # noqa: PTH110 - never raises
            yield path


def _pictures(task: Task, done: Done) -> tuple[Mapping[str, bytes], Sequence[str]]:
    """The pictures of a task, and what to say where there are none."""
    from aobake.batch.pictures import pictures_of

    try:
        return pictures_of(done, task.pictures)
    except Exception as error:  # noqa: BLE001 - the asset is baked and written: nothing else matters
        return {}, [f"no pictures were made: {_bug(error)}"]


def _not_done(task: Task, status: Status, reason: str) -> Outcome:
    return Outcome(number=task.number, status=status, reason=" ".join(reason.splitlines()))


def _named(path: str, folder: Path | None) -> str:
    if folder is not None and Path(path).is_relative_to(folder):
        return Path(path).relative_to(folder).as_posix()
    return path


def _for_want_of_memory(error: BaseException) -> bool:
    causes: list[BaseException] = []
    while (cause := (causes or [error])[-1].__cause__) is not None:
        causes.append(cause)
    return any(isinstance(cause, MemoryError) for cause in causes)


def _bug(error: Exception) -> str:
    """An error that nobody foresaw, with the place where it was raised."""
    frames: Sequence[traceback.FrameSummary] = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    return f"this should not happen: {type(error).__name__}: {error}{place}. Please report it."


def _load() -> None:
    """Import what every bake needs."""
    from aobake import bake, results  # noqa: F401 - for the tasks to come
    from aobake.tracing.compiled import compile_alone

    compile_alone()
    _tidy_up()


def _tidy_up() -> None:
    """Let go of all that a task held, for which the next one would have to answer.

    What is alive after it are modules, kernels and caches. They stay, and are exempted from the next search:
    it takes 13 ms else, longer than a small bake.
    """
    gc.collect()
    gc.freeze()


def _pipes() -> tuple[BinaryIO, BinaryIO]:
    """The two pipes to the parent, which are standard input and output no more."""
    tasks, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return tasks, answers


def _say(answers: BinaryIO, answer: Ready | Outcome) -> None:
    pickle.dump(answer, answers, pickle.HIGHEST_PROTOCOL)
    answers.flush()


def _listen(tasks: BinaryIO, waiting: queue.SimpleQueue[Task]) -> None:
    """Pass on tasks; end this process when no more can come, for then its parent is gone."""
    with contextlib.suppress(EOFError, OSError, pickle.UnpicklingError):
        while True:
            waiting.put(pickle.load(tasks))  # noqa: S301 - from our parent
    os.kill(os.getpid(), signal.SIGTERM)


def _end_with_parent() -> None:
    """Have Linux end this process with its parent, also while C code holds the lock that _listen needs."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG

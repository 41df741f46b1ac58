"""A worker whose jobs do what the name of their asset says: crash.glb crashes. Run by tests, in processes of its own.

All else is as in real workers. Assets without such a name are done at once.
"""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from aobake import files
from aobake.batch import worker
from aobake.batch.tasks import Outcome, Task
from aobake.errors import InputError
from aobake.jobs import Job


def crash(_: Job) -> None:
    ctypes.string_at(0)


def give_up(_: Job) -> NoReturn:
    os.write(2, b"the licence server is on fire\n")
    os._exit(3)


def lack(_: Job) -> NoReturn:
    os.write(2, b"terminate called after throwing an instance of 'std::bad_alloc'\n")
    os.abort()


def refuse(job: Job) -> NoReturn:
    raise InputError(f"{job.input}: this is not an asset.")


def starve(job: Job) -> NoReturn:
    why = MemoryError()
    raise InputError(f"{job.input}: it does not fit into memory.") from why


def err(_: Job) -> NoReturn:
    raise KeyError("first line\nsecond line")


def hang(job: Job) -> NoReturn:
    job.output.with_suffix(".begun").touch()
    threading.Event().wait()
    raise AssertionError


def clutch(job: Job) -> None:
    """Hang in C code that never lets Python run, in the middle of writing."""
    (job.output.parent / f"{files.PART}half.part").write_bytes(b"half")
    (Path(tempfile.gettempdir()) / "fetched").touch()
    told = f"{os.getpid()}\n{tempfile.gettempdir()}"
    files.write_files({job.output.with_suffix(".begun"): told.encode()})
    ctypes.PyDLL(None).sleep(1000)


def await_word(job: Job) -> NoReturn:
    """End when another file lies beside the output."""
    job.output.with_suffix(".begun").touch()
    while not job.output.with_suffix(".word").exists():
        time.sleep(0.01)
    raise InputError(f"{job.input}: it ended by itself.")


def hog(_: Job) -> None:
    """Take memory bit by bit, which only its parent can notice."""
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (resource.RLIM_INFINITY,) * 2)
    held: list[NDArray[np.float64]] = []
    while len(held) < 400:
        held.append(np.ones(1 << 20))
        time.sleep(0.005)


def gulp(_: Job) -> None:
    """Ask for a lot of memory at once, and never touch it."""
    np.empty(1 << 32, np.uint8)


def chatter(job: Job) -> NoReturn:
    print("hello " * 100_000)  # noqa: T201 - jobs may
    os.write(1, b"from C\n" * 10_000)
    raise InputError(f"{job.input}: it has said all.")


DEEDS = {
    deed.__name__: deed
    for deed in (
        crash, give_up, lack, refuse, starve, err, hang, clutch, await_word, hog, gulp, chatter
    )
}  # fmt: skip


def compile_slowly(task: Task) -> None:
    """Where the asset is called so, take until another file lies beside the output."""
    job = task.job
    if job.input.stem == "compile_slowly":
        job.output.with_suffix(".begun").touch()
        while not job.output.with_suffix(".word").exists():
            time.sleep(0.01)


def do(task: Task) -> Outcome:
    deed = DEEDS.get(task.job.input.stem)
    if deed is None:
        return Outcome(number=task.number, status="done", worker=str(os.getpid()))
    worker.run_job = deed  # type: ignore[attr-defined, assignment]
    return worker.work(task)


if __name__ == "__main__":
    worker._load = lambda: None
    worker.compile_for = compile_slowly  # type: ignore[attr-defined]
    worker.serve(do)

"""Tasks in processes that break in every way: each fails alone, with its reason, and leaves nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from aobake.batch.processes import LocalExecutor
from aobake.batch.tasks import Outcome, Status, Task
from aobake.config import Configured
from aobake.errors import EngineError
from aobake.jobs import Job
from aobake.settings import BakeSettings, ImageSettings, StoreSettings
from tests.support import ROOT

ODD = (sys.executable, str(Path(__file__).with_name("odd_worker.py")))
ENOUGH_S = 60.0  # to wait for what takes far less, on however busy a machine
CHOSEN = Configured(bake=BakeSettings(), store=StoreSettings(), image=ImageSettings())

posix = pytest.mark.skipif(sys.platform == "win32", reason="signals are those of POSIX")
linux = pytest.mark.skipif(
    sys.platform != "linux", reason="Linux alone limits allocations like this"
)


@pytest.fixture(scope="module")
def executor() -> Iterator[LocalExecutor]:
    with LocalExecutor(processes=2, threads=2, command=ODD) as two:
        yield two


def task(
    number: int,
    name: str,
    folder: Path,
    *,
    memory: int | None = None,
    timeout: float | None = None,
) -> Task:
    job = Job(command="vertex", input=Path(name), output=folder / name, chosen=CHOSEN)
    return Task(number=number, job=job, threads=1, memory=memory, timeout=timeout)


def outcomes_of(executor: LocalExecutor, tasks: Sequence[Task]) -> list[Outcome]:
    """The outcomes of tasks, in the order of their numbers."""
    for one in tasks:
        executor.start(one)
    found: list[Outcome] = []
    wait_for(lambda: len(found.__iadd__(executor.finished(0.1))) >= len(tasks))
    return sorted(found, key=lambda outcome: outcome.number)


def wait_for(happened: Callable[[], bool]) -> None:
    end = time.monotonic() + ENOUGH_S
    while not happened():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.01)


def is_alive(process: int) -> bool:
    stat = Path(f"/proc/{process}/stat")  # a zombie is dead, and waits to be taken notice of
    try:
        os.kill(process, 0)
        return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@posix
@pytest.mark.parametrize(
    ("name", "status", "words"),
    [
        ("crash.glb", "crashed", "crash.glb: its process crashed (segmentation fault, in "),
        ("give_up.glb", "crashed", '(exit status 3, saying "the licence server is on fire")'),
        ("lack.glb", "memory", "lack.glb: there was not enough memory for it."),
        ("refuse.glb", "failed", "refuse.glb: this is not an asset."),
        ("starve.glb", "memory", "starve.glb: it does not fit into memory."),
        ("err.glb", "failed", "err.glb: this should not happen: KeyError: 'first line"),
        ("chatter.glb", "failed", "chatter.glb: it has said all."),
    ],
)
def test_what_breaks_is_told_and_the_next_task_is_done(
    executor: LocalExecutor, tmp_path: Path, name: str, status: Status, words: str
) -> None:
    broken, sound = outcomes_of(executor, [task(0, name, tmp_path), task(1, "sound", tmp_path)])
    assert broken.status == status
    assert words in broken.reason
    assert "\n" not in broken.reason
    assert sound.status == "done"
    (again,) = outcomes_of(executor, [task(2, "sound", tmp_path)])
    assert again.status == "done"


def test_every_task_has_one_outcome_and_processes_are_kept(
    executor: LocalExecutor, tmp_path: Path
) -> None:
    found = outcomes_of(executor, [task(n, f"a{n}", tmp_path) for n in range(200)])
    assert [outcome.number for outcome in found] == list(range(200))
    assert {outcome.status for outcome in found} == {"done"}
    assert 1 <= len({outcome.worker for outcome in found}) <= 2


def test_what_takes_too_long_is_ended_and_leaves_nothing(
    executor: LocalExecutor, tmp_path: Path
) -> None:
    """In C code that nothing in its process can interrupt; what others have not finished writing stays."""
    neighbour = tmp_path / ".aobake-00000000-other.part"
    neighbour.touch()
    (late,) = outcomes_of(executor, [task(0, "clutch.glb", tmp_path, timeout=0.2)])
    assert late.status == "timeout"
    assert late.reason == "clutch.glb: it took longer than the 0.2 s that it may."
    if (told := tmp_path / "clutch.begun").exists():  # it had begun to write when its time was up
        process, temporary = told.read_text().splitlines()
        assert not is_alive(int(process))
        assert not Path(temporary).exists()
    assert list(tmp_path.glob("*.part")) == [neighbour]


def test_the_time_of_a_task_counts_from_when_its_kernels_are_compiled(
    executor: LocalExecutor, tmp_path: Path
) -> None:
    executor.start(task(0, "compile_slowly.glb", tmp_path, timeout=0.2))
    wait_for((tmp_path / "compile_slowly.begun").exists)
    assert executor.finished(0.6) == []
    (tmp_path / "compile_slowly.word").touch()
    found: list[Outcome] = []
    wait_for(lambda: bool(found.__iadd__(executor.finished(0.1))))


@pytest.mark.parametrize("name", ["hog.glb", pytest.param("gulp.glb", marks=linux)])
def test_what_takes_too_much_memory_is_ended(
    executor: LocalExecutor, tmp_path: Path, name: str
) -> None:
    limit = 400_000_000
    found = outcomes_of(
        executor, [task(0, name, tmp_path, memory=limit), task(1, "sound", tmp_path)]
    )
    assert [outcome.status for outcome in found] == ["memory", "done"]
    assert found[0].reason.startswith(f"{name}: ")
    if name == "hog.glb":
        assert "it took more than the 0.4 GB of memory that it may" in found[0].reason
        assert limit < found[0].peak_bytes < 2 * limit + 2_000_000_000


@posix
def test_a_name_of_several_lines_is_told_in_one(executor: LocalExecutor, tmp_path: Path) -> None:
    (broken,) = outcomes_of(executor, [task(0, "a\nb/crash.glb", tmp_path)])
    assert broken.reason.startswith("a b/crash.glb: its process crashed")
    assert "\n" not in broken.reason


def test_a_stop_lets_running_tasks_end(executor: LocalExecutor, tmp_path: Path) -> None:
    executor.start(task(0, "await_word.glb", tmp_path))
    wait_for((tmp_path / "await_word.begun").exists)
    threading.Timer(0.2, (tmp_path / "await_word.word").touch).start()
    (ended,) = executor.stop(ENOUGH_S)
    assert ended.reason == "await_word.glb: it ended by itself."


def test_a_stop_ends_what_does_not_end_and_begins_nothing(
    executor: LocalExecutor, tmp_path: Path
) -> None:
    names = ["hang.glb", "clutch.glb", "a", "b"]
    for number, name in enumerate(names):
        executor.start(task(number, name, tmp_path))
    wait_for(lambda: len(list(tmp_path.glob("*.begun"))) == 2)
    found = sorted(executor.stop(0.0), key=lambda outcome: outcome.number)
    assert [outcome.status for outcome in found] == ["stopped"] * 4
    assert "still running when the batch was stopped" in found[0].reason
    assert "not begun before the batch was stopped" in found[3].reason
    assert list(tmp_path.glob("*.part")) == []
    (after,) = outcomes_of(executor, [task(9, "sound", tmp_path)])
    assert after.status == "done"


def test_a_close_ends_what_runs(tmp_path: Path) -> None:
    with LocalExecutor(processes=1, threads=1, command=ODD) as one:
        one.start(task(0, "clutch.glb", tmp_path))
        wait_for((tmp_path / "clutch.begun").exists)
        process = int((tmp_path / "clutch.begun").read_text().split()[0])
        assert is_alive(process)
    assert not is_alive(process)
    assert list(tmp_path.glob("*.part")) == []


@posix
def test_ctrl_c_in_a_terminal_does_not_reach_workers(
    executor: LocalExecutor, tmp_path: Path
) -> None:
    (done,) = outcomes_of(executor, [task(0, "sound", tmp_path)])
    assert os.getpgid(int(done.worker)) != os.getpgid(0)


def test_processes_that_do_not_even_start_fail_their_tasks(tmp_path: Path) -> None:
    command = (sys.executable, "-c", "raise ImportError('no numpy')")
    with LocalExecutor(processes=2, threads=2, command=command) as broken:
        found = outcomes_of(broken, [task(n, "a.glb", tmp_path) for n in range(3)])
    assert {outcome.status for outcome in found} == {"crashed"}
    assert 'exit status 1, saying "ImportError: no numpy"' in found[0].reason


def test_a_command_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with LocalExecutor(processes=1, threads=1, command=(str(tmp_path / "none"),)) as none:
        none.start(task(0, "a.glb", tmp_path))
        with pytest.raises(EngineError, match="no process can be started"):
            none.finished(ENOUGH_S)
        assert none.stop(0.0) == []


PARENT = """
import sys, threading
from pathlib import Path
from tests.batch.test_processes import ODD, LocalExecutor, task
executor = LocalExecutor(processes=1, threads=1, command=ODD)
executor.start(task(0, "clutch.glb", Path(sys.argv[1])))
threading.Event().wait()
"""


@linux
def test_workers_die_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(tmp_path)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path)},
    )
    try:
        wait_for((tmp_path / "clutch.begun").exists)
        worker = int((tmp_path / "clutch.begun").read_text().split()[0])
        assert is_alive(worker)
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    wait_for(lambda: not is_alive(worker))

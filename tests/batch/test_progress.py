"""How far a batch is: counted from events, told on a terminal and elsewhere."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from aobake.batch import progress
from aobake.batch.progress import Progress
from aobake.batch.tasks import Outcome, Status, Task
from aobake.cli.batch_progress import lines_of, standing, watching
from aobake.config import Configured
from aobake.jobs import Job
from aobake.settings import BakeSettings, ImageSettings, StoreSettings
from tests.support import ROOT

TERMINAL = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "100", "PYTHONPATH": str(ROOT)}


def task(number: int, threads: int = 1, name: str = "") -> Task:
    chosen = Configured(bake=BakeSettings(), store=StoreSettings(), image=ImageSettings())
    source = Path("in", name or f"{number}.glb")
    job = Job(command="vertex", input=source, output=Path("out.glb"), chosen=chosen)
    return Task(number=number, job=job, threads=threads, source=Path("in"))


def outcome(number: int, status: Status = "done") -> Outcome:
    reason = "" if status == "done" else f"{number}.glb: it is broken."
    return Outcome(number=number, status=status, reason=reason)


@dataclass
class Clock:
    now: float = 100.0

    def __call__(self) -> float:
        return self.now


def test_nothing_is_told_of_a_time_that_nobody_can_know() -> None:
    state = progress.planned(0.0, total=3, skipped=1, cost=10.0)
    assert state.rate(5.0) is None
    assert state.remaining_s(5.0) is None
    assert state.settled == 1


def test_what_is_left_follows_from_costs_and_not_from_numbers() -> None:
    state = progress.planned(0.0, total=3, skipped=0, cost=100.0)
    for number, cost in ((0, 5.0), (1, 5.0)):
        state = progress.started(state, task(number), cost, now=0.0)
        state = progress.ended(state, outcome(number))
    assert state.rate(20.0) == pytest.approx(0.1)
    assert state.remaining_s(20.0) == pytest.approx(180.0), "90 of 100 are left, 10 took 20 s"
    state = progress.started(state, task(2), 90.0, now=20.0)
    state = progress.ended(state, outcome(2))
    assert state.remaining_s(30.0) == 0.0


def test_a_running_task_counts_by_its_threads_and_never_as_done() -> None:
    state = progress.planned(0.0, total=2, skipped=0, cost=20.0)
    state = progress.ended(progress.started(state, task(0), 10.0, now=0.0), outcome(0))
    state = progress.started(state, task(1, threads=2), 10.0, now=10.0)
    assert state.remaining_s(12.0) == pytest.approx((20.0 - 14.0) * 12.0 / 14.0)
    late = state.remaining_s(1000.0)
    assert late is not None
    assert late > 0.0


@pytest.mark.parametrize("status", ["done", "failed", "crashed", "memory", "timeout", "stopped"])
def test_every_way_to_end_is_counted_once(status: Status) -> None:
    state = progress.started(Progress(total=1, cost=2.0), task(7), 2.0, now=0.0)
    state = progress.ended(state, outcome(7, status), again=status == "crashed")
    if status == "crashed":
        assert (state.settled, state.retried, state.cost_done) == (0, 1, 0.0)
        return
    assert state.settled == 1
    assert (state.done, state.stopped) == (status == "done", status == "stopped")
    assert state.running == {}


def test_the_display_names_what_runs_and_for_how_long() -> None:
    state = progress.planned(0.0, total=1200, skipped=1000, cost=100.0)
    state = progress.refused(state)
    state = progress.started(state, task(1, name="props/chair.glb", threads=2), 1.0, now=3.0)
    assert lines_of(state, 68.0) == [
        "1,001 of 1,200 assets, 1,000 unchanged, 1 failed, 0.9 a minute",
        "  props/chair.glb  1 min 05 s, 2 threads",
    ]


def test_a_long_list_and_long_names_are_cut() -> None:
    state = Progress(total=20)
    for number in range(20):
        state = progress.started(state, task(number, name="x" * 200), 1.0, now=0.0)
    lines = lines_of(state, 1.0)
    assert lines[-1] == "  and 12 more"
    assert max(map(len, lines)) < 80


def test_without_a_terminal_failures_are_told_at_once_and_the_rest_now_and_then(
    capfd: pytest.CaptureFixture[str],
) -> None:
    clock = Clock()
    with watching(quiet=False, clock=clock) as watcher:
        watcher.planned(4, 1, 3.0)
        watcher.refused("no.glb", "no.glb: two assets have this target.")
        for number in (0, 1):
            watcher.started(task(number), 1.0)
            watcher.tick()
        watcher.ended(outcome(0, "failed"))
        watcher.ended(outcome(1, "crashed"), again=True)
        assert capfd.readouterr().err.splitlines() == [
            "aobake: error: no.glb: two assets have this target.",
            "aobake: error: 0.glb: it is broken.",
            "aobake: warning: 1.glb: it is broken. It is tried again.",
        ]
        clock.now += 10.0
        watcher.tick()
        watcher.tick()
        said = capfd.readouterr().err
        assert said.count("\n") == 1
        assert said.startswith("aobake: 3 of 4 assets, 1 unchanged, 2 failed, 1 tried again")
        watcher.started(task(1), 1.0)
        watcher.ended(outcome(1))
    assert "aobake: 4 of 4 assets" in capfd.readouterr().err


def test_a_stop_is_told_of_with_what_still_runs(capfd: pytest.CaptureFixture[str]) -> None:
    with watching(quiet=False, clock=Clock()) as watcher:
        watcher.planned(3, 0, 3.0)
        watcher.started(task(0), 1.0)
        watcher.stopping(1, 10.0)
        watcher.ended(outcome(0, "stopped"))
    said = "aobake: stopping; 1 asset has 10 s to end. Ctrl-C again ends it now.\n"
    assert capfd.readouterr().err == said


def test_quiet_tells_failures_alone(capfd: pytest.CaptureFixture[str]) -> None:
    clock = Clock()
    with watching(quiet=True, clock=clock) as watcher:
        watcher.planned(2, 0, 2.0)
        watcher.ended(outcome(0))
        watcher.ended(outcome(1, "failed"))
        clock.now += 60.0
        watcher.tick()
    assert capfd.readouterr().err == "aobake: error: 1.glb: it is broken.\n"


def test_of_failures_that_differ_in_the_asset_alone_the_first_are_told_of_and_the_rest_counted(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with watching(quiet=True) as watcher:
        watcher.planned(12, 0, 12.0)
        watcher.refused("x/a.glb", "in/x/a.glb: it is broken.")
        for number in range(9):
            watcher.started(task(number), 1.0)
            watcher.ended(outcome(number, "failed"))
        watcher.started(task(9), 1.0)
        watcher.ended(replace(outcome(9, "failed"), reason="9.glb: it is another matter."))
    assert capfd.readouterr().err.splitlines() == [
        "aobake: error: in/x/a.glb: it is broken.",
        "aobake: error: 0.glb: it is broken.",
        "aobake: error: 1.glb: it is broken.",
        "aobake: error: 9.glb: it is another matter.",
        "aobake: error: and 7 more, which the report names: it is broken.",
    ]


def test_names_cannot_steer_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    with watching(quiet=True) as watcher:
        watcher.refused("x", "\x1b[2J\x07.glb: it is\nbroken.")
    assert capfd.readouterr().err == "aobake: error: \\x1b[2J\\x07.glb: it is broken.\n"


def test_one_line_tells_how_far_a_batch_is() -> None:
    state = progress.planned(0.0, total=10, skipped=0, cost=10.0)
    state = progress.ended(progress.started(state, task(0), 1.0, now=0.0), outcome(0))
    assert standing(state, 0.5) == "1 of 10 assets, 2.0 a second, about 4 s left"


LIVE = """
from aobake.cli.batch_progress import watching
from tests.batch.test_progress import outcome, task

with watching(quiet=False) as watcher:
    watcher.planned(3, 1, 2.0)
    watcher.started(task(0, name="props/chair.glb"), 1.0)
    watcher.tick()
    watcher.ended(outcome(0, "failed"))
    watcher.tick()
"""


def test_a_terminal_shows_what_runs_and_keeps_failures() -> None:
    pty = pytest.importorskip("pty", reason="needs a pseudo-terminal")
    ours, theirs = pty.openpty()
    done = subprocess.run(
        [sys.executable, "-c", LIVE], cwd=ROOT, stderr=theirs, env=TERMINAL, check=False
    )
    os.close(theirs)
    said = b""
    with contextlib.suppress(OSError):  # what the end of a terminal is on Linux
        while more := os.read(ours, 1 << 16):
            said += more
    os.close(ours)
    text = said.decode()
    assert done.returncode == 0, text
    assert "props/chair.glb  0 s" in text
    assert "2 of 3 assets, 1 unchanged, 1 failed" in text
    assert text.count("aobake: error: 0.glb: it is broken.") == 1
    assert text.endswith("\x1b[2K"), "the display is gone at the end"

"""A batch on a cluster of real processes, one of which is killed; and what is refused before it begins."""

from __future__ import annotations

import logging
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from aobake import EngineError, SettingsError
from aobake.batch import roster
from aobake.batch.cluster import ClusterExecutor, on_cluster
from aobake.batch.cluster_worker import perform, unseen
from aobake.batch.places import local_folder
from aobake.batch.processes import LocalExecutor
from aobake.batch.tasks import Task
from aobake.settings import BakeSettings
from tests.batch.farm import LIMIT_S, Farm, all_of, farm, floor_and_ball, task_of, tree, until

pytest.importorskip("distributed", reason="the extra `cluster` is not installed")

LONG = BakeSettings(rays=1 << 13)  # a second of work or two
ENDLESS = BakeSettings(rays=1 << 20)  # minutes


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    """A scheduler with two workers, for all tests of this module."""
    with farm(tmp_path_factory.mktemp("farm"), workers=2) as made:
        with ClusterExecutor(made.address, patience=LIMIT_S) as executor:
            until(lambda: executor.capacity.workers == 2, made)
        yield made


@pytest.fixture
def assets(tmp_path: Path) -> Path:
    for number in range(6):
        floor_and_ball(tmp_path / "in" / f"ball {number}.obj", fine=number % 3)
    floor_and_ball(tmp_path / "in" / "long.obj", fine=4)
    (tmp_path / "out").mkdir()
    return tmp_path


def test_a_worker_that_is_killed_in_mid_job_costs_nothing_but_time(two: Farm, assets: Path) -> None:
    def tasks(out: str) -> list[Task]:
        small = [
            task_of(assets / "in", assets / out, f"ball {n}.obj", n, output=f"{n}/ball.obj")
            for n in range(6)
        ]
        return [task_of(assets / "in", assets / out, "long.obj", 9, bake=LONG), *small]

    (assets / "here").mkdir()
    with LocalExecutor(processes=1, threads=1) as local:
        assert all(o.status == "done" for o in all_of(local, tasks("here")).values())

    doomed = two.worker(threads=2)  # it has the most to spare, and so gets the first task
    with ClusterExecutor(two.address, patience=LIMIT_S) as executor:
        until(lambda: executor.capacity.workers == 3, two)
        for task in tasks("out"):
            executor.start(task)
        until(lambda: psutil.Process(doomed.pid).children(), two)  # they are at work there
        helpers = psutil.Process(doomed.pid).children()
        os.kill(doomed.pid, signal.SIGKILL)
        doomed.wait()
        outcomes = all_of(executor, tasks("out"), begun=True)
        assert {outcome.status for outcome in outcomes.values()} == {"done"}, outcomes
        until(lambda: executor.capacity.workers == 2, two)
    assert tree(assets / "out") == tree(assets / "here")
    if sys.platform == "linux":
        until(lambda: not any(map(runs, helpers)), "it left a process behind")


def runs(process: psutil.Process) -> bool:
    """Whether a process is there, and no corpse."""
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def workers_of(executor: ClusterExecutor) -> set[str]:
    """The addresses of all workers."""
    return set(executor._client.scheduler_info(n_workers=-1)["workers"])


def test_a_job_that_breaks_fails_alone_and_leaves_its_worker_alive(two: Farm, assets: Path) -> None:
    source, target = assets / "in", assets / "out"
    floor_and_ball(source / "large.obj", fine=5)
    with ClusterExecutor(two.address, patience=LIMIT_S) as executor:
        workers = workers_of(executor)
        (source / "broken.obj").write_text("v 0 0\n")
        outcomes = all_of(
            executor,
            [
                task_of(source, target, "broken.obj", 1),
                task_of(source, target, "long.obj", 2, bake=ENDLESS, timeout=0.3),
                task_of(source, target, "large.obj", 3, bake=ENDLESS, memory=64 << 20),
                task_of(source, target, "ball 0.obj", 4),
            ],
        )
        told = {number: outcome.status for number, outcome in outcomes.items()}
        assert told == {1: "failed", 2: "timeout", 3: "memory", 4: "done"}
        assert all(str(source) in outcomes[number].reason for number in (1, 2, 3))
        assert workers_of(executor) == workers
    assert tree(target).keys() == {"ball 0.obj"}


def test_a_stop_ends_what_runs_and_frees_the_workers(two: Farm, assets: Path) -> None:
    source, target = assets / "in", assets / "out"
    with ClusterExecutor(two.address, patience=LIMIT_S) as executor:
        for number in (1, 2):
            executor.start(task_of(source, target, "long.obj", number, bake=ENDLESS))
        stopped = executor.stop(grace=0.0)
        assert sorted((o.number, o.status) for o in stopped) == [(1, "stopped"), (2, "stopped")]
    with ClusterExecutor(two.address, patience=LIMIT_S) as executor:
        done = all_of(executor, [task_of(source, target, f"ball {n}.obj", n) for n in range(2)])
        assert [done[n].status for n in range(2)] == ["done", "done"]


def test_a_texture_in_tiles_over_two_workers_is_the_same_byte_by_byte(
    two: Farm, assets: Path
) -> None:
    source = assets / "in"
    bake = BakeSettings(rays=4, size=256, supersample=4, denoise="off")

    def task(target: Path) -> Task:
        target.mkdir(exist_ok=True)
        return task_of(
            source, target, "ball 1.obj", output="a/ball.glb", command="texture", bake=bake
        )

    with LocalExecutor(processes=1, threads=1) as local:
        assert all_of(local, [task(assets / "here")])[0].status == "done"
    (assets / "out").mkdir(exist_ok=True)
    folders = local_folder(source), local_folder(assets / "out")
    with on_cluster(two.address, *folders, "on") as executor:
        until(lambda: executor.capacity.workers == 2, two)
        outcome = all_of(executor, [task(assets / "out")])[0]
        assert outcome.status == "done", outcome
        assert len(set(outcome.worker.split(", process "))) >= 3, "two processes had a part in it"
    assert tree(assets / "out") == tree(assets / "here")


def test_a_scheduler_that_is_gone_is_one_line_and_no_hang(
    assets: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    task = task_of(assets / "in", assets / "out", "long.obj", bake=ENDLESS)
    with (
        farm(assets, workers=1) as made,
        ClusterExecutor(made.address, patience=LIMIT_S) as executor,
    ):
        executor.start(task)
        made.processes[0].kill()
        with pytest.raises(EngineError, match=r"^tcp://\S+: the scheduler is gone"):
            until(lambda: executor.finished(1.0))
    assert capfd.readouterr() == ("", "")


def test_folders_have_to_be_the_same_for_all(
    two: Farm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with ClusterExecutor(two.address, patience=LIMIT_S) as executor:
        executor.check_shared(tmp_path, tmp_path)
        assert tree(tmp_path) == {}, "the probe is gone"
        if sys.platform == "linux":
            monkeypatch.chdir(tmp_path)
            own = Path("/proc/self/cwd")  # another folder for each process
            with pytest.raises(SettingsError, match=r"^/proc/self/cwd: the worker tcp:.*Mount it"):
                executor.check_shared(None, own)


def test_a_worker_says_which_folder_it_cannot_use(tmp_path: Path) -> None:
    probe = tmp_path / "probe"
    probe.write_text("yes")
    assert unseen(str(tmp_path), str(probe), "yes") == ""
    assert unseen(str(tmp_path), str(probe), "no") == str(tmp_path)
    assert unseen(str(tmp_path / "missing"), str(probe), "yes") == str(tmp_path / "missing")
    assert unseen("", str(probe), "yes") == unseen(str(tmp_path), "", "yes") == ""


def test_workers_with_another_version_are_refused_at_the_door(
    two: Farm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(roster, "__version__", "99.1")
    with pytest.raises(SettingsError, match=r"has aobake \S+, and this machine has 99\.1\."):
        ClusterExecutor(two.address, patience=LIMIT_S)
    late = perform(task_of(tmp_path, tmp_path, "chair.glb"), "batch", "99.1")
    assert late.status == "failed"
    assert "99.1 is asked for" in late.reason


@pytest.mark.parametrize(
    ("address", "needed"),
    [
        ("scheduler:8786", "tcp://HOST:8786"),
        ("tcp://127.0.0.1:1", "no scheduler can be reached"),
        ("carrier://pigeon:1", "no scheduler can be reached"),
    ],
)
def test_an_address_without_a_scheduler_is_refused_in_one_line(address: str, needed: str) -> None:
    with pytest.raises(SettingsError) as refused:
        ClusterExecutor(address, patience=0.5)
    assert str(refused.value).startswith(f"{address}: ")
    assert logging.getLogger("distributed").level != logging.CRITICAL, "as it was before"
    assert needed in str(refused.value)
    assert "\n" not in str(refused.value)

"""A whole batch: what is baked, what stands, what fails alone, and what a stop leaves."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from aobake.batch.places import local_folder
from aobake.batch.progress import SILENT, Silent, Watcher
from aobake.batch.run import Batch, Ended, Reports, run_batch
from aobake.batch.settings import BatchSettings
from aobake.batch.tasks import Capacity, Executor, Outcome, Status, Task
from aobake.batch.worker import work
from aobake.errors import OutputError
from tests.scenes import CUBE_OBJ

TRIANGLE_PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""


@dataclass(eq=False)
class InThisProcess:
    """Does each task as it is started, one after another.

    happens : what becomes of a task instead of being done: (name of the asset, attempt) -> how it ends
    after : called after each task
    """

    happens: dict[tuple[str, int], Status] = field(default_factory=dict)
    after: Callable[[Task], None] = lambda _: None
    begun: list[str] = field(default_factory=list)
    waiting: list[Outcome] = field(default_factory=list)

    @property
    def capacity(self) -> Capacity:
        return Capacity(threads=1, most_threads=1, memory=1 << 34, workers=1)

    def start(self, task: Task) -> None:
        name = task.job.input.name
        self.begun.append(name)
        status = self.happens.get((name, task.attempt))
        done = (
            work(task)
            if status is None
            else Outcome(number=task.number, status=status, reason=f"{name}: no")
        )
        self.waiting.append(done)
        self.after(task)

    def finished(self, timeout: float) -> Sequence[Outcome]:  # noqa: ARG002 - nothing to wait for
        found, self.waiting = self.waiting, []
        return found

    def stop(self, grace: float) -> Sequence[Outcome]:  # noqa: ARG002 - nothing to wait for
        return self.finished(0.0)

    def close(self) -> None:
        """Nothing to end."""

    @contextmanager
    def opened(self) -> Iterator[Executor]:
        yield self


@pytest.fixture
def batch(tmp_path: Path) -> Batch:
    """Three assets in two folders, and one that is broken."""
    source = tmp_path / "in"
    (source / "props").mkdir(parents=True)
    for number, name in enumerate(("a.obj", "props/b.obj", "props/c.obj")):
        (source / name).write_text(f"# {number}\n{CUBE_OBJ}", encoding="ascii")
    (source / "broken.glb").write_bytes(b"glTF, not really")
    target = tmp_path / "out"
    return Batch(
        source=local_folder(source),
        target=local_folder(target),
        settings=BatchSettings(pictures="none"),
        flags={"rays": 4},
        state=target / ".aobake",
        reports=Reports(
            data=target / "report.json", page=target / "report.html", junit=target / "j.xml"
        ),
    )


def ran(
    batch: Batch,
    executor: InThisProcess | None = None,
    *,
    watcher: Watcher = SILENT,
    stop: threading.Event | None = None,
) -> Ended:
    executor = executor or InThisProcess()
    return run_batch(batch, executor.opened, watcher=watcher, stop=stop)


def states(batch: Batch) -> dict[str, str]:
    assert batch.reports.data is not None
    jobs = json.loads(batch.reports.data.read_text(encoding="utf-8"))["jobs"]
    return {job["source"]: job["state"] for job in jobs}


def test_every_asset_is_baked_into_a_tree_of_the_same_shape_and_a_broken_one_fails_alone(
    batch: Batch, tmp_path: Path
) -> None:
    ended = ran(batch)
    assert states(batch) == {
        "a.obj": "baked", "props/b.obj": "baked", "props/c.obj": "baked", "broken.glb": "failed",
    }  # fmt: skip
    assert ended.totals.failures == 1
    written = {
        p.relative_to(tmp_path / "out").as_posix() for p in (tmp_path / "out").rglob("*.obj")
    }
    assert written == {"a.obj", "props/b.obj", "props/c.obj"}
    for report in ("report.json", "report.html", "j.xml"):
        assert (tmp_path / "out" / report).stat().st_size


def test_a_second_run_bakes_what_failed_alone(batch: Batch) -> None:
    ran(batch)
    again = InThisProcess()
    ran(batch, again)
    assert again.begun == ["broken.glb"]
    assert [states(batch)[name] for name in ("a.obj", "props/b.obj")] == ["unchanged"] * 2


def test_what_changed_is_baked_again_and_nothing_else(batch: Batch, tmp_path: Path) -> None:
    ran(batch)
    (tmp_path / "in" / "broken.glb").unlink()
    (tmp_path / "in" / "a.obj").write_text(f"# other\n{CUBE_OBJ}", encoding="ascii")
    (tmp_path / "out" / "props" / "b.obj").unlink()
    again = InThisProcess()
    ran(batch, again)
    assert sorted(again.begun) == ["a.obj", "b.obj"]
    settings = InThisProcess()
    ran(replace(batch, flags={"rays": 5}), settings)
    assert sorted(settings.begun) == ["a.obj", "b.obj", "c.obj"]
    forced = InThisProcess()
    ran(replace(batch, flags={"rays": 5}, force=True), forced)
    assert sorted(forced.begun) == ["a.obj", "b.obj", "c.obj"]


def test_a_renamed_asset_is_not_baked_again(batch: Batch, tmp_path: Path) -> None:
    source, target = tmp_path / "in", tmp_path / "out"
    (source / "props" / "d.ply").write_text(TRIANGLE_PLY, encoding="ascii")
    ran(batch)
    before = (target / "props" / "d.ply").read_bytes()
    (source / "props" / "d.ply").rename(source / "chair.ply")
    again = InThisProcess()
    ended = ran(replace(batch, prune=True), again)
    assert again.begun == ["broken.glb"]
    assert states(batch)["chair.ply"] == "moved"
    assert (target / "chair.ply").read_bytes() == before
    assert ended.pruned is not None
    assert ended.pruned.removed == ("props/d.ply",)
    assert not (target / "props" / "d.ply").exists()


def test_outputs_without_an_asset_are_told_of_and_kept(batch: Batch, tmp_path: Path) -> None:
    ran(batch)
    (tmp_path / "in" / "a.obj").unlink()
    assert ran(batch).stale == ("a.obj",)
    assert (tmp_path / "out" / "a.obj").exists()


def test_what_crashes_is_tried_again_as_often_as_asked(batch: Batch) -> None:
    crashing: dict[tuple[str, int], Status] = {
        ("a.obj", 1): "crashed",
        ("b.obj", 1): "timeout",
        ("b.obj", 2): "memory",
    }
    executor = InThisProcess(happens=crashing)
    ran(replace(batch, settings=BatchSettings(pictures="none", retries=1)), executor)
    assert executor.begun.count("a.obj") == executor.begun.count("b.obj") == 2
    assert executor.begun.count("broken.glb") == 1
    found = states(batch)
    assert (found["a.obj"], found["props/b.obj"]) == ("baked", "memory")


def test_each_of_two_assets_with_one_output_is_told_of_and_the_output_before_stays(
    batch: Batch, tmp_path: Path
) -> None:
    source, output = tmp_path / "in", tmp_path / "out" / "a.obj"
    ran(batch)
    before = output.read_bytes()
    rival = source / "a.stl"
    rival.write_text("solid\nendsolid\n", encoding="ascii")
    both = replace(batch.settings, format="obj")
    ended = ran(replace(batch, settings=both, prune=True))
    found = states(batch)
    assert (found["a.obj"], found["a.stl"], found["props/b.obj"]) == (
        "failed",
        "failed",
        "unchanged",
    )
    assert (ended.totals.jobs, ended.totals.failures) == (5, 3)
    assert output.read_bytes() == before
    rival.unlink()
    ran(batch)
    assert states(batch)["a.obj"] == "unchanged"


def test_a_stop_begins_nothing_new_and_the_next_run_goes_on(batch: Batch, tmp_path: Path) -> None:
    stop = threading.Event()
    first = InThisProcess(after=lambda _: stop.set())
    ended = ran(batch, first, stop=stop)
    assert ended.interrupted
    assert len(first.begun) == 1
    assert list(states(batch).values()).count("stopped") == 3
    second = InThisProcess()
    assert not ran(batch, second).interrupted
    done = {"broken.glb"} if first.begun == ["broken.glb"] else set()
    assert sorted(second.begun) == sorted(
        {"a.obj", "b.obj", "c.obj", "broken.glb"} - set(first.begun) | done
    )


def test_nothing_begins_once_it_is_to_stop(batch: Batch) -> None:
    stop = threading.Event()
    stop.set()
    executor = InThisProcess()
    assert ran(batch, executor, stop=stop).interrupted
    assert executor.begun == []
    assert set(states(batch).values()) == {"stopped"}


def test_a_second_batch_into_the_same_folder_is_refused(batch: Batch) -> None:
    refusals: list[str] = []

    def meanwhile(_: Task) -> None:
        with pytest.raises(OutputError) as refusal:
            ran(batch)
        refusals.append(str(refusal.value))

    ran(batch, InThisProcess(after=meanwhile))
    assert len(refusals) == 4
    assert all("another" in line and "\n" not in line for line in refusals)


class Unlucky(Silent):
    """Raises at the first task that ended, as a report does that cannot be written."""

    def ended(self, outcome: Outcome, *, again: bool = False) -> None:  # noqa: ARG002 - whichever
        raise OutputError("the disk is full.")


def test_an_executor_serves_the_next_run_after_one_that_broke_off(batch: Batch) -> None:
    executor = InThisProcess()
    with pytest.raises(OutputError, match="the disk is full"):
        ran(batch, executor, watcher=Unlucky())
    assert executor.waiting == [], "what was under way is no business of the next run"
    batch.source.path("props/c.obj").unlink()  # so that numbers stand for other tasks
    ran(replace(batch, force=True), executor)
    assert states(batch) == {"a.obj": "baked", "props/b.obj": "baked", "broken.glb": "failed"}

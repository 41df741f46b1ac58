"""Texture bakes in tiles: the same result, whole or not at all, however the parts end."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from aobake import InputError
from aobake.batch.leftovers import remove_leftovers
from aobake.batch.parts import first_part, join_bake, make_part
from aobake.batch.tasks import Capacity, Outcome, Remote, Status, Task
from aobake.batch.tiles import TiledExecutor
from aobake.batch.worker import work
from aobake.files import is_unfinished
from aobake.jobs import run_job
from aobake.settings import BakeSettings
from tests.batch.farm import floor_and_ball, task_of, tree

BAKE = BakeSettings(rays=4, size=256, supersample=4, denoise="off")  # four bands


class Recorder:
    """An executor of two workers that does nothing but to end tasks as it is told, in the order they came."""

    def __init__(self, workers: int = 2, does: bool = False) -> None:
        self.capacity = Capacity(threads=8, most_threads=4, memory=1 << 30, workers=workers)
        self.tasks: list[Task] = []
        self.closed = False
        self.ends: dict[str, Status] = {}
        self.does = does

    def start(self, task: Task) -> None:
        self.tasks.append(task)

    def finished(self, timeout: float) -> Sequence[Outcome]:  # noqa: ARG002
        return [self.end(self.tasks.pop(0))] if self.tasks else []

    def end(self, task: Task) -> Outcome:
        if self.does:
            return work(task)
        step = task.part.step if task.part else "whole"
        status = self.ends.get(step, "done")
        outputs = (("chair.glb", ""),) if step in {"whole", "join"} and status == "done" else ()
        return Outcome(
            number=task.number,
            status=status,
            reason=f"{step} {status}",
            outputs=outputs,
            worker=step,
        )

    def stop(self, grace: float) -> Sequence[Outcome]:  # noqa: ARG002
        ended = [self.end(task) for task in self.tasks]
        self.tasks.clear()
        return ended

    def close(self) -> None:
        self.closed = True


def texture(folder: Path, number: int = 3, bake: BakeSettings = BAKE) -> Task:
    task = task_of(folder / "in", folder / "out", "chair.obj", number,
                   output="sub/chair.glb", command="texture", bake=bake)  # fmt: skip
    return replace(task, threads=4)


def steps(executor: Recorder) -> list[str]:
    return [task.part.step if task.part else "whole" for task in executor.tasks]


@pytest.mark.parametrize("count", [1, 3, 7])
def test_any_number_of_tiles_gives_the_bytes_of_the_whole(tmp_path: Path, count: int) -> None:
    floor_and_ball(tmp_path / "in" / "chair.obj", fine=1)
    for name in ("out", "here"):
        (tmp_path / name / "sub").mkdir(parents=True)
    task = texture(tmp_path)
    whole = run_job(replace(task.job, output=tmp_path / "here" / "sub" / "chair.glb"))
    executor = TiledExecutor(Recorder(workers=count, does=True), "on")
    if count == 1:  # not worth it, but for the parts themselves
        part = first_part("sub/chair.glb", 1)
        make_part(part, task.job, tmp_path / "out")
        make_part(replace(part, step="trace"), task.job, tmp_path / "out")
        parted = run_job(task.job, instead=join_bake(replace(part, step="join"), tmp_path / "out"))
        assert parted.report.rays == whole.report.rays
        assert parted.report.findings == whole.report.findings
        assert parted.report.warnings == whole.report.warnings
        for name in part.files:
            (tmp_path / "out" / name).unlink()
    else:
        executor.start(task)
        (outcome,) = executor.finished(60.0)
        assert (outcome.number, outcome.status) == (3, "done"), outcome.reason
        assert outcome.report is not None
        assert outcome.report["rays"] == whole.report.rays
    assert tree(tmp_path / "out") == tree(tmp_path / "here")


def test_steps_follow_each_other_and_take_all_workers_for_the_tracing(tmp_path: Path) -> None:
    inner = Recorder()
    executor = TiledExecutor(inner, "on")
    executor.start(texture(tmp_path))
    seen = []
    while True:
        seen.append((steps(inner), executor.capacity.threads))
        if outcomes := executor.finished(0.0):
            break
    assert seen == [
        (["layout"], 8),
        (["trace", "trace"], 4),  # the task was given four threads, and its tiles take eight
        (["trace"], 8),
        (["join"], 8),
    ]
    assert [(o.number, o.status, o.worker) for o in outcomes] == [
        (3, "done", "layout, trace, join")
    ]


@pytest.mark.parametrize(
    ("tiles", "size", "workers", "cut"),
    [
        ("auto", 4096, 2, True),
        ("auto", 2048, 2, False),
        ("on", 64, 2, True),
        ("on", 4096, 1, False),
        ("off", 8192, 9, False),
    ],
)
def test_what_is_cut(tmp_path: Path, tiles: str, size: int, workers: int, cut: bool) -> None:
    inner = Recorder(workers=workers)
    assert tiles in {"auto", "on", "off"}
    TiledExecutor(inner, tiles).start(texture(tmp_path, bake=BakeSettings(size=size)))  # type: ignore[arg-type]
    assert steps(inner) == (["layout"] if cut else ["whole"])


def test_vertices_are_never_cut(tmp_path: Path) -> None:
    inner = Recorder()
    executor = TiledExecutor(inner, "on")
    executor.start(task_of(tmp_path / "in", tmp_path / "out", "chair.obj", 5))
    assert steps(inner) == ["whole"]
    assert [outcome.number for outcome in executor.finished(0.0)] == [5]


@pytest.mark.parametrize("step", ["layout", "trace", "join"])
@pytest.mark.parametrize("status", ["failed", "memory", "crashed", "timeout"])
def test_a_part_that_fails_is_a_task_that_fails(tmp_path: Path, step: str, status: Status) -> None:
    inner = Recorder()
    inner.ends[step] = status
    executor = TiledExecutor(inner, "on")
    executor.start(texture(tmp_path))
    outcomes: Sequence[Outcome] = ()
    while not outcomes:
        outcomes = executor.finished(0.0)
    assert [(o.number, o.status, o.reason) for o in outcomes] == [(3, status, f"{step} {status}")]
    assert inner.tasks == []


@pytest.mark.parametrize(("turns", "status"), [(0, "stopped"), (1, "stopped"), (3, "done")])
def test_a_stop_lets_the_last_part_end_and_begins_no_other(
    tmp_path: Path, turns: int, status: Status
) -> None:
    inner = Recorder()
    executor = TiledExecutor(inner, "on")
    executor.start(texture(tmp_path))
    for _ in range(turns):
        assert executor.finished(0.0) == []
    (outcome,) = executor.stop(0.0)
    assert (outcome.number, outcome.status) == (3, status)
    assert inner.tasks == []


def test_what_parts_hand_on_is_removed_however_it_ends(tmp_path: Path) -> None:
    floor_and_ball(tmp_path / "in" / "chair.obj", fine=0)
    (tmp_path / "out").mkdir()
    inner = Recorder(does=True)
    executor = TiledExecutor(inner, "on")
    executor.start(texture(tmp_path))
    assert executor.finished(0.0) == []
    assert any("-layout" in name for name in tree(tmp_path / "out"))
    executor.close()
    assert inner.closed
    assert tree(tmp_path / "out") == {}


class Planted:
    """Leaves a mark where a pickle of it is opened."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[object, ...]:
        return (Path.touch, (self.mark,))


def test_a_part_that_somebody_else_put_there_is_never_opened(tmp_path: Path) -> None:
    floor_and_ball(tmp_path / "in" / "chair.obj", fine=0)
    target = tmp_path / "out"
    target.mkdir()
    task, part = texture(tmp_path), first_part("chair.glb", 1)
    make_part(part, task.job, target)
    file, mark = target / part.makes, tmp_path / "mark"
    record = file.read_bytes()
    evil = pickle.dumps(Planted(mark))
    for content in (
        len(evil).to_bytes(8, "little") + record[8:40] + evil,
        record[:-1],
        record[:20],
        record[:40] + evil + record[40:],
    ):
        file.write_bytes(content)
        with pytest.raises(InputError, match="this part of a bake is not as it was made"):
            make_part(replace(part, step="trace"), task.job, target)
    assert not mark.exists()
    assert repr(part.key) not in repr(task) + repr(part)


def test_what_parts_hand_on_is_removed_by_the_next_run_where_this_one_is_killed(
    tmp_path: Path,
) -> None:
    part = first_part("sub/deep/chair.glb", 4)
    assert len(part.files) == 5
    for name in part.files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    assert remove_leftovers(tmp_path) == tuple(sorted(part.files))


def test_a_task_with_remote_folders_is_cut_as_well(tmp_path: Path) -> None:
    task = texture(tmp_path)
    inner = Recorder()
    TiledExecutor(inner, "on").start(
        replace(
            task,
            job=replace(task.job, output=Path("sub/chair.glb")),
            target=None,
            remote=Remote(source="memory://a", target="memory://b"),
        )
    )
    assert steps(inner) == ["layout"]
    part = inner.tasks[0].part
    assert part is not None
    assert part.makes.startswith("sub/")
    assert all(is_unfinished(Path(name).name) for name in part.files), "swept up after a kill"

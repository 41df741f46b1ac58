"""The fault drill in small: whatever happens to a batch, the next run ends as if it had not happened."""

from __future__ import annotations

import importlib
import sqlite3
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from aobake.batch import database
from aobake.batch.places import local_folder
from aobake.batch.processes import LocalExecutor
from aobake.batch.progress import Silent
from aobake.batch.run import Batch, Ended, Reports, run_batch
from aobake.batch.settings import BatchSettings
from aobake.batch.tasks import Outcome
from aobake.errors import OutputError
from tests.support import ROOT

BENCHMARKS = ROOT / "benchmarks"
pytestmark = [
    pytest.mark.skipif(not BENCHMARKS.is_dir(), reason="not a checkout"),
    pytest.mark.skipif(
        sys.platform == "win32", reason="there is no kill -9, and no limit of files"
    ),
]

COUNT, BROKEN = 20, 4
EARLY = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
LATE = b"v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n"


@dataclass(frozen=True)
class After(Silent):
    """Does something once so many tasks have ended."""

    number: int
    does: Callable[[], None]
    seen: list[Outcome] = field(default_factory=list)

    def ended(self, outcome: Outcome, *, again: bool = False) -> None:
        self.seen.append(outcome)
        if len(self.seen) == self.number and not again:
            self.does()


class Stage:
    """Assets, workers that copy them in place of baking, and what an undisturbed batch leaves."""

    def __init__(self, module: ModuleType, folder: Path, workers: LocalExecutor) -> None:
        self.drill: Any = module.Drill(
            module.assets(folder / "in", COUNT, ()),
            folder / "whole",
            ("--pictures", "none", "--processes", 2),
        )
        (self.drill.source / "late.obj").write_bytes(LATE)
        self.module, self.workers = module, workers
        self.run(self.drill)
        self.whole = self.drill.left()

    def at(self, target: Path) -> Any:
        """The same batch into a target of its own."""
        return self.module.Drill(self.drill.source, target, self.drill.arguments)

    def run(self, drill: Any, watcher: Silent | None = None) -> Ended:
        """A batch in this process, on the workers that are there."""
        batch = Batch(
            source=local_folder(drill.source),
            target=local_folder(drill.target),
            settings=BatchSettings(pictures="none"),
            state=drill.target / ".aobake",
            reports=Reports(data=drill.target / "report.json"),
        )
        return run_batch(batch, lambda: nullcontext(self.workers), watcher=watcher or Silent())

    def nothing_is_torn(self, drill: Any) -> bool:
        """Whether every file that is there is one of an undisturbed batch."""
        return bool(drill.left().written.items() <= self.whole.written.items())

    def ends_well(self, drill: Any) -> bool:
        """Whether a run more leaves what an undisturbed batch does."""
        self.run(drill)
        return bool(drill.left() == self.whole)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    folder = tmp_path_factory.mktemp("faults")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        drill = importlib.import_module("drill")
        sys.modules.pop("drill")
        patch.setenv(drill.LIGHT, "1")
        patch.setenv(drill.LOG, str(folder / "bakes.log"))
        command = (sys.executable, "-P", str(BENCHMARKS / "drill.py"), "serve")
        with LocalExecutor(processes=2, threads=2, command=command) as workers:
            yield Stage(drill, folder, workers)


@pytest.fixture
def drill(stage: Stage, tmp_path: Path) -> Any:
    return stage.at(tmp_path / "out")


def test_an_undisturbed_batch_bakes_all_but_what_is_broken(stage: Stage) -> None:
    states = list(stage.whole.states.values())
    assert (states.count("done"), states.count("failed")) == (COUNT + 1 - BROKEN, BROKEN)
    assert not stage.whole.parts


def test_the_parent_is_killed(stage: Stage, drill: Any) -> None:
    process = drill.start()
    assert stage.module.until(lambda: drill.outputs() > COUNT // 2, process)
    process.kill()
    process.communicate()
    assert stage.nothing_is_torn(drill)
    assert stage.ends_well(drill)
    assert drill.twice() <= 2  # those that were in flight


def test_workers_are_killed(stage: Stage, drill: Any) -> None:
    psutil = importlib.import_module("psutil")

    def kill() -> None:
        for child in psutil.Process().children():
            child.kill()

    ended = stage.run(drill, After(5, kill))
    states = ended.totals.states
    assert states["crashed"] <= 2
    assert states["baked"] + states["crashed"] == COUNT + 1 - BROKEN
    assert stage.nothing_is_torn(drill)
    assert stage.ends_well(drill)


def test_the_disk_is_full(stage: Stage, drill: Any) -> None:
    full = drill.source / "full"
    ended = stage.run(drill, After(5, full.touch))
    full.unlink()
    assert ended.totals.states["failed"] > BROKEN
    assert stage.nothing_is_torn(drill)
    assert not drill.left().parts
    assert stage.ends_well(drill)


def test_the_disk_is_full_for_the_manifest(
    stage: Stage, drill: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    check = database._check

    def limited(connection: sqlite3.Connection, name: str) -> None:
        check(connection, name)
        ((pages,),) = connection.execute("PRAGMA page_count").fetchall()
        connection.execute(f"PRAGMA max_page_count = {pages + 1}").fetchall()

    monkeypatch.setattr(database, "_check", limited)
    with pytest.raises(OutputError, match=r"cannot be kept there \(.*full") as refusal:
        stage.run(drill)
    assert "\n" not in str(refusal.value)
    monkeypatch.undo()
    stage.workers.stop(60.0)  # what it had begun is of no run any more
    assert stage.nothing_is_torn(drill)
    assert stage.ends_well(drill)


def test_a_file_stands_where_a_folder_of_outputs_should(stage: Stage, drill: Any) -> None:
    drill.target.mkdir()
    (drill.target / "set 0").write_text("in the way", encoding="ascii")
    assert stage.run(drill).totals.states["failed"] == COUNT
    (drill.target / "set 0").unlink()
    assert stage.ends_well(drill)


def test_an_asset_is_saved_while_it_is_baked(stage: Stage, drill: Any) -> None:
    late = drill.source / "late.obj"
    with restored(late):
        late.write_bytes(EARLY)
        late.with_suffix(".ready").write_bytes(LATE)
        stage.run(drill)
        assert late.read_bytes() == LATE
        assert (drill.target / "late.obj").read_bytes() == b"baked " + EARLY
        assert stage.ends_well(drill)


@contextmanager
def restored(file: Path) -> Iterator[None]:
    content = file.read_bytes()
    try:
        yield
    finally:
        file.write_bytes(content)

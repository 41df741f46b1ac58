"""The memory of a batch: whole jobs or none, any name, and no file taken for what it is not."""

from __future__ import annotations

import itertools
import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from aobake.batch.database import APPLICATION
from aobake.batch.manifest import Manifest
from aobake.batch.places import LocalFolder
from aobake.batch.tasks import Outcome
from aobake.errors import InputError, OutputError
from aobake.settings import BakeSettings
from tests.batch.workshop import CountingFolder, Workshop
from tests.support import ROOT


@pytest.fixture
def shop(tmp_path: Path) -> Workshop:
    return Workshop(tmp_path)


HOSTILE = [
    "a b.glb",
    'it\'s "quoted"; DROP TABLE jobs; --.glb',
    "<script>alert(1)</script>.glb".replace("/", "\u2044"),
    "two\nlines\tand a tab.glb",
    "stone 🪨 Zoë.glb",
    "é.glb",
    "e\u0301.glb",
    "latin \udce9.glb",
    "%41.glb",
    "x" * 251 + ".glb",
]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_any_name_is_remembered_as_it_is(shop: Workshop) -> None:
    for number, name in enumerate(HOSTILE):
        shop.asset(name, f"thing {number}")
        shop.asset(f"folder {name[:200]}/x.glb", f"inner {number}")
    shop.run()
    assert set(shop.kinds().values()) == {"unchanged"}
    with shop.open() as manifest:
        run = manifest.begin({})
        planned = shop.all_planned()
        manifest.keep(list(zip(planned, manifest.standings(planned), strict=True)))
        entries = list(manifest.entries(run))
    assert [entry.source for entry in entries] == sorted(job.source for job in planned)
    assert len(entries) == 2 * len(HOSTILE)
    assert all(entry.outputs == (entry.target,) for entry in entries)


def test_an_entry_says_what_a_job_was_and_what_became_of_it(shop: Workshop) -> None:
    for name in ("a", "b", "c", "d"):
        shop.asset(f"{name}.glb", name)
    shop.run(shop.planned("a.glb"))
    shop.rename("a.glb", "z.glb")
    shop.asset("a.glb", "a")
    planned = {name: shop.planned(name) for name in ("a.glb", "b.glb", "c.glb", "d.glb", "z.glb")}
    with shop.open() as manifest:
        run = manifest.begin({"source": "in"})
        pairs = list(zip(planned.values(), manifest.standings([*planned.values()]), strict=True))
        manifest.keep(pairs[:1])
        assert manifest.adopt(pairs[4:]) == []
        manifest.record(planned["b.glb"], shop.baked(planned["b.glb"]), attempts=2)
        failure = Outcome(
            number=0, status="memory", reason="c.glb: too large", seconds=7, peak_bytes=9
        )
        manifest.record(planned["c.glb"], failure, attempts=3)
        manifest.note([planned["d.glb"]], "stopped", "the batch was stopped")
        manifest.finish({"interrupted": True})
        entries = {entry.source: entry for entry in manifest.entries(run)}
        facts = manifest.facts(run)
    assert [entries[name].state for name in planned] == [
        "unchanged", "baked", "memory", "stopped", "moved",
    ]  # fmt: skip
    assert [entries[name].attempts for name in planned] == [0, 2, 3, 0, 0]
    assert [entries[name].seconds for name in planned] == [2.5, 2.5, 7.0, 0.0, 2.5]
    assert entries["c.glb"].reason == "c.glb: too large"
    assert entries["c.glb"].report is None
    assert entries["b.glb"].report == {"inputs": ["b.glb"], "settings": {"rays": 16}}
    assert entries["b.glb"].settings["rays"] == 16
    assert "size" not in entries["b.glb"].settings  # of textures alone
    assert entries["b.glb"].input_bytes == 1
    assert entries["b.glb"].output_bytes == shop.target.path("b.glb").stat().st_size
    moved = entries["z.glb"].report
    assert moved is not None
    assert moved["inputs"][0]["path"] == str(shop.source.path("z.glb"))  # type: ignore[index]
    assert (facts["source"], facts["interrupted"]) == ("in", True)
    assert facts["finished"]


def test_entries_are_of_the_run_alone(shop: Workshop) -> None:
    shop.asset("a.glb")
    shop.asset("b.glb")
    shop.run()
    planned = shop.planned("b.glb", BakeSettings(rays=5))
    with shop.open() as manifest:
        run = manifest.begin({})
        manifest.standings([planned])
        manifest.record(planned, shop.baked(planned))
        assert [entry.source for entry in manifest.entries(run)] == ["b.glb"]
        assert [entry.settings["rays"] for entry in manifest.entries(run)] == [5]


def test_entries_are_read_one_by_one(shop: Workshop) -> None:
    shop.asset("a.glb")
    one = shop.planned("a.glb")
    with shop.open() as manifest:
        run = manifest.begin({})
        manifest.note([replace(one, target=f"{n:05}.glb") for n in range(5000)], "failed", "no")
        entries: Iterator[object] = manifest.entries(run)
        steps = itertools.count()
        manifest._database._connection.set_progress_handler(lambda: 0 * next(steps), 100)
        next(entries)
    assert next(steps) < 50  # sorted by its index: 5,000 rows would be some 100,000 steps


CHILD = """
import os, signal, sys
from pathlib import Path
from dataclasses import replace
from tests.batch.workshop import CountingFolder, Workshop

shop, fatal = Workshop(Path(sys.argv[1])), sys.argv[2]
one = shop.planned("a.glb")

def traced(statement):
    if number == 5 and statement.startswith(fatal):
        os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))

with shop.open() as manifest:
    manifest.begin({})
    manifest.standings([one])
    outcome = replace(shop.baked(one), pictures={"after": bytes(9000), "before": bytes(9000)})
    manifest._database._connection.set_trace_callback(traced)
    for number in range(100):
        manifest.record(replace(one, target=f"{number}.glb"), outcome)
"""


@pytest.mark.parametrize(
    "statement",
    ["BEGIN", "INSERT INTO jobs", "INSERT OR REPLACE INTO bakes", "INSERT INTO pictures", "COMMIT"],
)
def test_a_run_that_is_killed_loses_the_job_in_flight_and_no_other(
    shop: Workshop, statement: str
) -> None:
    shop.asset("a.glb")
    child = subprocess.run(
        [sys.executable, "-c", CHILD, str(shop.source.folder.parent), statement],
        cwd=ROOT,
        check=False,
        capture_output=True,
    )
    assert child.returncode in {-signal.SIGTERM, -9, signal.SIGTERM}, child.stderr
    with shop.open() as manifest:
        entries = {entry.target: entry for entry in manifest.entries(1)}
        assert entries.keys() == {f"{number}.glb" for number in range(5)}
        for target, entry in entries.items():
            assert entry.outputs == ("a.glb",)
            assert entry.report
            assert [len(content) for content in manifest.pictures(target).values()] == [9000, 9000]


def test_a_second_process_is_told_that_the_manifest_is_in_use(shop: Workshop) -> None:
    with shop.open() as manifest:
        manifest.begin({})
        with pytest.raises(OutputError, match=r"batch\.sqlite: another process has it open"):
            shop.open()


@pytest.mark.parametrize("content", [b"no database", b"SQLite format 3\0" + bytes(5000)])
def test_a_broken_file_is_refused_and_stays(shop: Workshop, content: bytes) -> None:
    shop.database.write_bytes(content)
    with pytest.raises(InputError, match=r"batch\.sqlite: it is damaged .*Move it away"):
        shop.open()
    assert shop.database.read_bytes() == content


def test_damage_in_the_middle_is_said_when_it_is_met(shop: Workshop) -> None:
    for number in range(200):
        shop.asset(f"{number}.glb")
    with shop.open() as manifest:
        manifest.begin({})
        manifest.note(shop.all_planned(), "failed", "a long reason " * 20)
    content = bytearray(shop.database.read_bytes())
    content[8192:-4096] = os.urandom(len(content) - 8192 - 4096)
    shop.database.write_bytes(content)
    with pytest.raises(InputError, match="it is damaged"), shop.open() as manifest:
        manifest.standings(shop.all_planned())


@pytest.mark.parametrize(
    ("pragma", "said"),
    [("user_version = 99", "a newer aobake"), ("application_id = 1", "another program")],
)
def test_a_database_that_is_not_of_this_aobake_is_refused(
    shop: Workshop, pragma: str, said: str
) -> None:
    shop.open().__exit__(None, None, None)
    connection = sqlite3.connect(shop.database)
    assert connection.execute("PRAGMA application_id").fetchone() == (APPLICATION,)
    connection.execute(f"PRAGMA {pragma}")
    connection.commit()
    connection.close()
    with pytest.raises(InputError, match=said):
        shop.open()


def test_a_manifest_that_cannot_be_made_says_where(shop: Workshop, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="nowhere"):
        Manifest.open(tmp_path / "nowhere" / "batch.sqlite", shop.source, shop.target)


def test_a_look_in_memory_leaves_no_file(shop: Workshop) -> None:
    shop.asset("a.glb")
    with Manifest.open(None, shop.source, shop.target) as manifest:
        assert [s.kind for s in manifest.standings(shop.all_planned())] == ["new"]
    assert not shop.database.exists()


def test_a_look_before_there_is_a_target_finds_everything_new(shop: Workshop) -> None:
    shop.asset("a.glb")
    shop.database.parent.rmdir()
    shop.target.folder.rmdir()
    with Manifest.open(None, shop.source, shop.target) as manifest:
        assert [s.kind for s in manifest.standings(shop.all_planned())] == ["new"]


def test_a_copy_that_goes_away_while_it_is_looked_at_ends_no_batch(
    shop: Workshop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody tidies up the target at the very moment."""
    for name in ("a.glb", "b.glb"):
        shop.asset(name, name)
        shop.sides[name] = ("wood.png",)
    shop.asset("wood.png", "brown")
    looked_at: list[str] = []

    def gone(folder: CountingFolder, name: str) -> str:
        looked_at.append(name)
        folder.path(name).unlink()
        return LocalFolder.digest(folder, name)

    with shop.open() as manifest:
        manifest.begin({})
        first, second = (shop.planned(name) for name in ("a.glb", "b.glb"))
        manifest.standings([first, second])
        manifest.record(first, shop.baked(first))
        done = shop.baked(second)
        with monkeypatch.context() as moment:
            moment.setattr(CountingFolder, "digest", gone)
            manifest.record(second, done)
    assert looked_at == ["wood.png"]
    assert shop.kinds() == {"a.glb": "output missing", "b.glb": "unchanged"}

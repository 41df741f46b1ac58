"""The benchmarks' own arithmetic, and their runner: what is found, recorded, skipped, and what fails."""

from __future__ import annotations

import dataclasses
import importlib
import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from tests.support import ROOT, python

FOLDER = ROOT / "benchmarks"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="not a checkout")


class Modules:
    """The benchmarks' modules, by name."""

    def __getattr__(self, name: str) -> ModuleType:
        return importlib.import_module(name)


@pytest.fixture
def modules(monkeypatch: pytest.MonkeyPatch) -> Iterator[Modules]:
    """Importable as they are when the folder is run, and forgotten afterwards."""
    monkeypatch.syspath_prepend(str(FOLDER))
    before = set(sys.modules)
    yield Modules()
    for name in set(sys.modules) - before:
        where = getattr(sys.modules[name], "__file__", None)
        if where and Path(where).parent == FOLDER:
            del sys.modules[name]


def test_the_spread_of_repeats_is_their_median_and_range(modules: Modules) -> None:
    spread = modules.tables.Spread.of([3.0, 1.0, 10.0])
    assert (spread.median, spread.least, spread.most, spread.runs) == (3.0, 1.0, 10.0, 3)


def test_a_table_comes_back_from_its_record_as_it_was(modules: Modules) -> None:
    tables = modules.tables
    cells = [1, 0.5, None, "a", tables.Spread.of([1.0, 2.0])]
    table = tables.Table("t", list("abcde"), [cells], {"rays": 4}, "below")
    again = tables.restored(json.loads(json.dumps(dataclasses.asdict(table))))
    assert again.markdown() == table.markdown()
    assert "| 1 | 0.5 | - | a | 1.5 (1 to 2) |" in table.markdown()


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.0123456, "0.0123"), (12.34, "12.3"), (123456.0, "123,456"), (2e-6, "2.0e-06")],
)
def test_numbers_have_three_digits(modules: Modules, value: float, text: str) -> None:
    assert modules.tables.shown(value) == text


def test_works_are_measured_in_turn_and_the_first_round_does_not_count(modules: Modules) -> None:
    calls: list[str] = []
    ticks = iter(range(1000))
    taken = modules.tables.in_turn(
        {"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}, 2, lambda: next(ticks)
    )
    assert calls == ["a", "b"] * 3
    assert taken == {"a": [1, 1], "b": [1, 1]}


def test_time_to_an_error_lies_on_the_power_law_between_its_levels(modules: Modules) -> None:
    """Error rays^-0.5 and seconds in proportion: a quarter of the error takes sixteen times as long."""
    rivals, spread = modules.rivals, modules.tables.Spread
    levels = [rivals.Level("b", str(n), spread.of([n * 1e-3]), n, n**-0.5) for n in (16, 256, 4096)]
    seconds, rays = rivals.time_to(levels, 1.0 / 32.0)
    assert seconds == pytest.approx(1.024)
    assert rays == pytest.approx(1024)
    assert rivals.time_to(levels, 0.5) is None
    assert rivals.time_to(levels, 1e-3) is None


def test_a_baker_that_aims_elsewhere_is_held_to_its_own_limit(modules: Modules) -> None:
    level = modules.rivals.Level("b", "1", modules.tables.Spread.of([1.0]), 1, rmse=0.1, own=0.02)
    assert level.error == 0.02


def test_the_fitted_exponent_of_a_power_law_is_its_power(modules: Modules) -> None:
    sizes = [10.0, 100.0, 1000.0, 1e4]
    assert modules.growth.slope(sizes, [3.0 * n**1.25 for n in sizes]) == pytest.approx(1.25)
    assert modules.growth.slope(sizes, [0.0] * 4) is None
    assert modules.growth.per_unit([1.0, 2.0, 4.0], [0.0, 5.0, 11.0]) == 3.0


@pytest.mark.parametrize(
    ("found", "better", "by"), [(0.8, "more", 0.25), (1.25, "less", 0.25), (1.25, "more", -0.2)]
)
def test_worse_is_measured_in_the_direction_that_counts(
    modules: Modules, found: float, better: str, by: float
) -> None:
    assert modules.guard.worse(found, 1.0, better) == pytest.approx(by)


@pytest.mark.parametrize(("now", "status"), [([1.05], 0), ([1.2, 1.2], 1), ([1.2, 1.0], 0)])
def test_a_guarded_ratio_fails_when_it_is_worse_twice(
    modules: Modules,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    now: list[float],
    status: int,
) -> None:
    guard, values = modules.guard, iter(now)
    monkeypatch.setattr(guard, "GUARDED", {"rays": guard.Guarded(lambda: 0.0, "less", "count")})
    monkeypatch.setattr(guard, "value_of", lambda _: next(values))
    (tmp_path / "recorded.json").write_text('{"values": {"rays": 1.0}}')
    assert guard.check(tmp_path) == status
    assert ("worse than recorded" in capsys.readouterr().out) == bool(status)


TINY = '''"""A tiny one."""
from tables import Table
def run(quick):
    yield Table("T", ("quick",), [[str(quick)]])
'''
BROKEN = '''"""A broken one."""
def run(quick):
    raise ValueError("on purpose")
    yield
'''
ABSENT = '''"""One that lacks something."""
from tables import Skipped
def run(quick):
    raise Skipped("there is no peer")
    yield
'''
STOPPED = '''"""One that somebody stops."""
from tables import Table
def run(quick):
    yield Table("T", ("n",), [[7]])
    raise KeyboardInterrupt
'''


@pytest.fixture
def runner(tmp_path: Path) -> Path:
    """The runner among benchmarks of our own."""
    folder = tmp_path / "benchmarks"
    folder.mkdir()
    for name in ("__main__.py", "tables.py", "machine.py"):
        shutil.copy(FOLDER / name, folder)
    for name, text in {"tiny": TINY, "broken": BROKEN, "absent": ABSENT}.items():
        (folder / f"{name}.py").write_text(text)
    return folder


def test_the_runner_records_what_it_measured_and_goes_on_after_a_failure(runner: Path) -> None:
    results = runner / "kept"
    for _ in range(2):
        ran = python(str(runner), "--quick", "--results", str(results))
        assert ran.returncode == 1
        assert ran.stderr.endswith("failed: broken\n")
        assert "| True |" in ran.stdout
        assert "skipped: there is no peer" in ran.stdout
    records = [json.loads(line) for line in (results / "tiny.jsonl").read_text().splitlines()]
    assert len(records) == 2
    assert records[0]["tables"][0]["rows"] == [["True"]]
    assert {"machine", "versions", "load", "date", "commit", "peak_memory"} <= records[0].keys()
    assert json.loads((results / "absent.jsonl").read_text().splitlines()[0])["skipped"]
    assert not (results / "broken.jsonl").exists()


def test_a_benchmark_that_is_stopped_keeps_what_it_had_measured(runner: Path) -> None:
    (runner / "stopped.py").write_text(STOPPED)
    results = runner / "kept"
    assert (
        "stopped: the tables above"
        in python(str(runner), "stopped", "--results", str(results)).stdout
    )
    record = json.loads((results / "stopped.jsonl").read_text())
    assert record["stopped"]
    assert record["tables"][0]["rows"] == [[7]]


def test_the_runner_names_the_benchmarks_it_knows(runner: Path) -> None:
    ran = python(str(runner), "--only", "tinny")
    assert ran.returncode == 2
    assert "'tinny'" in ran.stderr
    assert "tiny" in ran.stderr
    assert python(str(runner), "--list").stdout.split()[0] == "absent"


def test_every_benchmark_of_the_project_is_found() -> None:
    listed = {line.split()[0] for line in python(str(FOLDER), "--list").stdout.splitlines()}
    assert {"tracing", "growth", "assets", "startup", "vertex_peers", "texture_peers"} <= listed
    assert not listed & {"scan", "bodies", "tables", "effect_pictures", "spheres"}


def test_the_pages_ask_for_benchmarks_that_exist(modules: Modules) -> None:
    listed = {line.split()[0] for line in python(str(FOLDER), "--list").stdout.splitlines()}
    for path in modules.page.PAGES:
        page = path.read_text(encoding="utf-8")
        asked = {name for name, _ in modules.page.PLACE.findall(page)}
        assert asked
        assert asked <= listed | {modules.page.ITSELF}
        assert page.count("<!-- end -->") == len(modules.page.PLACE.findall(page))
    assert modules.page.DRAWN.keys() <= listed


def test_a_place_of_the_page_takes_the_last_whole_run(
    modules: Modules, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    page, tables = modules.page, modules.tables
    monkeypatch.setattr(page, "HERE", tmp_path)
    (tmp_path / "results").mkdir()
    lines = []
    for number, quick in enumerate((False, False, True)):
        table = dataclasses.asdict(tables.Table("T", ("n",), [[number]]))
        record = {"quick": quick, "tables": [table], "load": [0.5, 1.5], "date": "2020-01-02T03"}
        lines.append(json.dumps(record))
    (tmp_path / "results" / "tiny.jsonl").write_text("\n".join(lines))
    text = "a\n<!-- tiny: T -->\nold\n<!-- end -->\nb\n<!-- other: U -->\n<!-- end -->\n"
    new = page.PLACE.sub(page.filled, text)
    assert "| 1 |" in new
    assert "old" not in new
    assert "`python benchmarks tiny`, 2020-01-02, load 0.5 to 1.5." in new
    assert "Not measured yet: `python benchmarks other`." in new
    assert page.PLACE.sub(page.filled, new) == new

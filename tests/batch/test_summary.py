"""report.json: everything about every job, in constant memory, whole or not at all."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest

from aobake.batch.summary import SCHEMA, STATES, number_in, totals_of, write_json
from aobake.batch.tasks import Entry
from tests.batch.made_up import HOSTILE, entries, entry, facts
from tests.support import ROOT


def test_totals_count_what_was_run_now_and_what_there_is() -> None:
    jobs = [entry("a"), entry("b", "unchanged"), entry("c", "failed"), entry("d", "stopped")]
    totals = totals_of(jobs)
    assert totals.jobs == 4
    assert {state: n for state, n in totals.states.items() if n} == {
        "baked": 1, "unchanged": 1, "failed": 1, "stopped": 1,
    }  # fmt: skip
    assert totals.failures == 1, "what was stopped did not fail"
    assert totals.rays == 512, "those of the unchanged job were traced at another time"
    assert totals.seconds == pytest.approx(4.5)
    assert totals.input_bytes == 4000
    assert totals.output_bytes == 4000


def test_an_empty_batch_has_totals_and_a_report(tmp_path: Path) -> None:
    assert set(totals_of([]).states.values()) == {0}
    write_json(tmp_path / "report.json", facts(0), [])
    assert json.loads((tmp_path / "report.json").read_text(encoding="ascii"))["jobs"] == []


def test_a_report_holds_every_job_as_it_was(tmp_path: Path) -> None:
    count = len(HOSTILE) + 9
    write_json(tmp_path / "report.json", facts(count), entries(count))
    found = json.loads((tmp_path / "report.json").read_text(encoding="ascii"))
    assert found["schema"] == SCHEMA
    assert found["started"] == "2026-01-31T02:03:04Z"
    assert found["totals"]["states"].keys() == set(STATES)
    assert found["settings"]["retries"] == 0
    for told, given in zip(found["jobs"], entries(count), strict=True):
        assert told["source"] == given.source
        assert told["state"] == given.state
        assert told["reason"] == given.reason
        assert told["settings"] == given.settings
        assert told["warnings"] == ([] if given.report is None else given.report["warnings"])


def test_every_key_of_the_report_is_explained(tmp_path: Path) -> None:
    write_json(tmp_path / "report.json", facts(1), entries(1))
    found = json.loads((tmp_path / "report.json").read_text(encoding="ascii"))
    page = (ROOT / "docs" / "batch.md").read_text(encoding="utf-8")
    keys = {*found, *found["totals"], *found["jobs"][0]}
    assert sorted(key for key in keys if f"`{key}`" not in page) == []


def test_a_report_that_breaks_off_leaves_the_earlier_one(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    write_json(path, facts(3), entries(3))
    before = path.read_bytes()

    def broken() -> Iterator[Entry]:
        yield from entries(2)
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_json(path, facts(3), broken())
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_memory_does_not_grow_with_the_jobs(tmp_path: Path) -> None:
    def peak(count: int) -> int:
        run = facts(1)
        tracemalloc.start()
        write_json(tmp_path / "report.json", run, entries(count))
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(10)
    assert peak(2000) < peak(100) + 100_000, "a job takes about a thousand bytes of the file"


def test_numbers_are_taken_where_they_are_numbers() -> None:
    report = {"rays": 3, "error": {"rms": None, "max": 0.5}, "layout": True}
    assert number_in(report, "rays") == 3
    assert number_in(report, "error", "max") == 0.5
    for keys in (("error", "rms"), ("error", "p99"), ("layout",), ("rays", "rms"), ("gone",)):
        assert number_in(report, *keys) is None
    assert number_in(None, "rays") is None

"""A batch in numbers and as JSON: what every report of it says. The keys are explained in docs/batch.md, and stay."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from aobake import __version__, environment, files
from aobake.batch.settings import BatchSettings
from aobake.batch.tasks import Entry

__all__ = [
    "FAILURES",
    "SCHEMA",
    "STATES",
    "RunFacts",
    "Totals",
    "number_in",
    "texts_in",
    "totals_of",
    "write_json",
]

SCHEMA = 1  # grows when a key changes its meaning or goes; new keys do not change it

STATES = ("baked", "unchanged", "moved", "failed", "crashed", "memory", "timeout", "stopped")
FAILURES = frozenset({"failed", "crashed", "memory", "timeout"})
"""States of jobs that were tried and gave nothing; `stopped` ones were not tried to the end."""


@dataclass(frozen=True, kw_only=True)
class Totals:
    """All jobs of a batch together.

    states : state -> jobs, for all of STATES
    with_warnings : jobs whose report has any
    seconds, rays : of the jobs that were run now; input_bytes, output_bytes : of all jobs
    """

    jobs: int
    states: Mapping[str, int]
    with_warnings: int
    seconds: float
    rays: int
    input_bytes: int
    output_bytes: int

    @property
    def failures(self) -> int:
        """Jobs that were tried and gave nothing."""
        return sum(self.states[state] for state in FAILURES)


@dataclass(frozen=True, kw_only=True)
class RunFacts:
    """One run of a batch.

    source, target : the two folders, as they were given
    started, finished : with a time zone
    interrupted : whether it was stopped before all was done
    """

    source: str
    target: str
    started: datetime
    finished: datetime
    settings: BatchSettings
    totals: Totals
    interrupted: bool = False
    version: str = __version__
    machine: str = field(default_factory=environment.machine)
    processors: int = field(default_factory=environment.processors)


def totals_of(entries: Iterable[Entry]) -> Totals:
    """Add up the jobs of a batch, in constant memory; zeros where there are none."""
    states = dict.fromkeys(STATES, 0)
    jobs = with_warnings = rays = input_bytes = output_bytes = 0
    seconds = 0.0
    for entry in entries:
        jobs += 1
        states[entry.state] += 1
        with_warnings += bool(texts_in(entry.report, "warnings"))
        input_bytes += entry.input_bytes
        output_bytes += entry.output_bytes
        if entry.attempts:
            seconds += entry.seconds
            rays += int(number_in(entry.report, "rays") or 0)
    return Totals(
        jobs=jobs,
        states=states,
        with_warnings=with_warnings,
        seconds=seconds,
        rays=rays,
        input_bytes=input_bytes,
        output_bytes=output_bytes,
    )


def number_in(report: Mapping[str, object] | None, *keys: str) -> float | None:
    """A number in the report of a job, by the keys that lead to it; None where there is none."""
    found: object = report
    for key in keys:
        found = found.get(key) if isinstance(found, Mapping) else None
    return found if isinstance(found, int | float) and not isinstance(found, bool) else None


def texts_in(report: Mapping[str, object] | None, key: str) -> list[str]:
    """The texts that the report of a job lists under a key; none where there is none."""
    found = None if report is None else report.get(key)
    return [str(text) for text in found] if isinstance(found, list | tuple) else []


def write_json(path: Path, run: RunFacts, entries: Iterable[Entry]) -> None:
    """Write a batch as JSON: the facts of the run, then one object for each job.

    entries : read once and not kept, so that memory does not grow with them
    The file appears whole or not at all. Raises OutputError.
    """
    files.write_files({path: _pieces(run, entries)})


def _pieces(run: RunFacts, entries: Iterable[Entry]) -> Iterator[bytes]:
    facts = {
        "schema": SCHEMA,
        "version": run.version,
        "source": run.source,
        "target": run.target,
        "started": _moment(run.started),
        "finished": _moment(run.finished),
        "interrupted": run.interrupted,
        "machine": run.machine,
        "processors": run.processors,
        "settings": dataclasses.asdict(run.settings),
        "totals": _rounded(dataclasses.asdict(run.totals)),
    }
    yield (_json(facts, indent=2)[:-2] + ',\n  "jobs": [').encode()
    separator = "\n"
    for entry in entries:
        yield f"{separator}    {_json(_job(entry))}".encode()
        separator = ",\n"
    yield b"\n  ]\n}\n"


def _job(entry: Entry) -> dict[str, object]:
    """A job, without what its own report says once more for every job: versions, machine and plan."""
    report = entry.report
    return {
        "source": entry.source,
        "target": entry.target,
        "command": entry.command,
        "state": entry.state,
        "reason": entry.reason,
        "seconds": round(entry.seconds, 6),
        "stages": {} if report is None else report.get("seconds", {}),
        "peak_bytes": entry.peak_bytes,
        "attempts": entry.attempts,
        "input_bytes": entry.input_bytes,
        "output_bytes": entry.output_bytes,
        "inputs": [] if report is None else report.get("inputs", []),
        "outputs": list(entry.outputs),
        "settings": dict(entry.settings),
        "settings_files": list(entry.settings_files),
        "triangles": number_in(report, "triangles"),
        "points": number_in(report, "points"),
        "rays": number_in(report, "rays"),
        "ao_mean": number_in(report, "ao_mean"),
        "error": None if report is None else report.get("error"),
        "tolerance": None if report is None else report.get("tolerance"),
        "warnings": texts_in(report, "warnings"),
    }


def _json(value: object, indent: int | None = None) -> str:
    """In ASCII: a name may hold what is no character, and is told apart only as an escape."""
    return json.dumps(value, indent=indent, allow_nan=False, default=str)


def _moment(when: datetime) -> str:
    """Such as 2026-01-31T02:03:04Z."""
    return when.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _rounded(totals: dict[str, object]) -> dict[str, object]:
    return {k: round(v, 6) if isinstance(v, float) else v for k, v in totals.items()}

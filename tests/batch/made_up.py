"""Batches that never ran, for reports: jobs in every state, under names that hurt."""

from __future__ import annotations

import random
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

import numpy as np

from aobake.batch.palette import png_of
from aobake.batch.settings import BatchSettings
from aobake.batch.summary import RunFacts, totals_of
from aobake.batch.tasks import Entry

__all__ = ["HOSTILE", "entries", "entry", "facts", "picture"]

HOSTILE = (
    "<script>document.documentElement.dataset.broken = 'yes'<x>",
    "]]><!--&amp; \"a\" 'b'",
    "line\nbreak\ttab",
    "control\x00\x1b[31m\x7f",
    "stray \udcff byte",
    "separators \u2028 and \u2029",
    "turned \u202eblg.",
    "木 ü 🪑",
    "$source ${rows}",
    "\\u003c \\\\",
    "c" * 240,
)
KINDS = ("baked", "baked", "baked", "unchanged", "moved", "failed", "crashed", "timeout", "stopped")
FOLDERS = ("", "props", "props/chairs", "buildings")


def entry(source: str, state: str = "baked", **more: object) -> Entry:
    """A job of an asset, with a report where it gave a result."""
    good = state in {"baked", "unchanged", "moved"}
    fields: dict[str, object] = {
        "target": source,
        "command": "vertex",
        "reason": "" if good else f"{source}: it is broken. Export it anew.",
        "seconds": 1.5,
        "peak_bytes": 100_000_000,
        "attempts": 0 if state in {"unchanged", "moved"} else 1,
        "input_bytes": 1000,
        "output_bytes": 2000 if good else 0,
        "outputs": (source,) if good else (),
        "settings": {"rays": 64, "seed": 0},
        "settings_files": (),
        "report": {
            "triangles": 12,
            "points": 8,
            "rays": 512,
            "ao_mean": 0.5,
            "seconds": {"read": 0.25, "trace": 0.5},
            "error": {"rms": 0.0123456, "p50": 0.01, "p90": 0.02, "p99": 0.03, "max": 0.04},
            "tolerance": None,
            "warnings": [],
            "inputs": [{"path": source, "sha256": "0" * 64}],
        }
        if good
        else None,
    }
    fields |= more
    return Entry(source=source, state=state, **fields)  # type: ignore[arg-type]


def entries(count: int) -> Iterator[Entry]:
    """So many jobs, the same ones at every call, hostile names among them."""
    for number in range(count):
        chance = random.Random(number)
        folder = chance.choice(FOLDERS)
        name = HOSTILE[number] if number < len(HOSTILE) else f"asset {number:05d}.glb"
        made = entry(f"{folder}/{name}" if folder else name, KINDS[number % len(KINDS)])
        if made.report is not None:
            warnings = [f"{name}: 1 face has no area."] * (number % 3)
            rms = {"rms": chance.uniform(0.001, 0.02)}
            report = {**made.report, "warnings": warnings, "error": rms, "triangles": number}
            made = entry(made.source, made.state, report=report, seconds=chance.uniform(0.1, 9.0))
        yield made


def facts(count: int, source: str = "assets") -> RunFacts:
    """The facts of a run of entries(count)."""
    began = datetime(2026, 1, 31, 2, 3, 4, tzinfo=UTC)
    return RunFacts(
        source=source,
        target="baked",
        started=began,
        finished=began + timedelta(minutes=5),
        settings=BatchSettings(),
        totals=totals_of(entries(count)),
    )


def picture(shade: int) -> bytes:
    """A small PNG of one grey."""
    return png_of(np.full((6, 8, 3), shade, np.uint8))

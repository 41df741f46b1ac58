"""A job as the page knows it: short, without what is nothing, without what is as everywhere."""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Mapping

from aobake.batch.summary import number_in, texts_in
from aobake.batch.tasks import Entry
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

__all__ = ["as_json", "row_of"]


def row_of(entry: Entry) -> dict[str, object]:
    """What the script of the page reads of a job; keys without a value are left out."""
    report = entry.report
    errors = {key: _significant(number_in(report, "error", key)) for key in ("rms", "p99", "max")}
    missed = number_in(report, "tolerance", "missed")
    row: dict[str, object | None] = {
        "source": entry.source,
        "target": entry.target,
        "command": entry.command,
        "state": entry.state,
        "reason": entry.reason or None,
        "seconds": round(entry.seconds, 3),
        "stages": _stages(report),
        "peak": entry.peak_bytes or None,
        "attempts": entry.attempts,
        "read": entry.input_bytes,
        "written": entry.output_bytes or None,
        "outputs": list(entry.outputs) or None,
        "triangles": number_in(report, "triangles"),
        "points": number_in(report, "points"),
        "rays": number_in(report, "rays"),
        **errors,
        "missed": missed or None,
        "layout": texts_in(report, "layout") or None,
        "settings": _unusual(entry) or None,
        "files": list(entry.settings_files) or None,
        "warnings": texts_in(report, "warnings") or None,
    }
    return {key: value for key, value in row.items() if value is not None}


def as_json(value: object) -> str:
    """JSON that may stand in an element of a page: in ASCII, and without a character that ends the element."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False, default=str)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _stages(report: Mapping[str, object] | None) -> dict[str, float] | None:
    stages = None if report is None else report.get("seconds")
    if not isinstance(stages, Mapping):
        return None
    found = {str(k): round(float(v), 3) for k, v in stages.items() if isinstance(v, int | float)}
    return {stage: spent for stage, spent in found.items() if spent > 0.0} or None


def _significant(number: float | None) -> float | None:
    return None if number is None else float(f"{number:.3g}")


def _unusual(entry: Entry) -> dict[str, object]:
    """The settings that are not the defaults."""
    usual = _defaults(entry.command)
    return {
        key: value
        for key, value in entry.settings.items()
        if key in usual and json.dumps(value, default=str) != usual[key]
    }


@functools.cache
def _defaults(command: str) -> dict[str, str]:
    """Name of a setting -> its default, as JSON has it."""
    kept = ImageSettings() if command == "texture" else StoreSettings()
    settings = dataclasses.asdict(BakeSettings()) | dataclasses.asdict(kept)
    return {name: json.dumps(value, default=str) for name, value in settings.items()}

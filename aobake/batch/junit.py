"""A batch as JUnit XML, which CI systems show: one test case for each job.

Written as the readers of Jenkins and GitLab take it. A job that is unchanged since an earlier run passes, as its
result stands; only what was not tried to the end is skipped. What raised is a failure, and what broke or ran
over its limits an error.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from datetime import UTC
from pathlib import Path
from xml.sax.saxutils import escape

from aobake import files
from aobake.batch.summary import RunFacts, texts_in
from aobake.batch.tasks import Entry

__all__ = ["write_junit"]

# All that XML 1.0 cannot hold, not even as a reference (its production 2, Char).
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_IN_ATTRIBUTES = {'"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}
_ERRORS = {
    "crashed": "the process crashed",
    "memory": "out of its memory",
    "timeout": "out of its time",
}


def write_junit(path: Path, run: RunFacts, entries: Iterable[Entry]) -> None:
    """Write a batch as JUnit XML.

    entries : read once and not kept
    The file appears whole or not at all. Raises OutputError.
    """
    files.write_files({path: _pieces(run, entries)})


def _pieces(run: RunFacts, entries: Iterable[Entry]) -> Iterator[bytes]:
    totals = run.totals
    errors = sum(totals.states[state] for state in _ERRORS)
    counts = (
        f'tests="{totals.jobs}" failures="{totals.failures - errors}" errors="{errors}" '
        f'time="{totals.seconds:.3f}"'
    )
    started = run.started.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%S")
    yield b'<?xml version="1.0" encoding="UTF-8"?>\n'
    yield f'<testsuites name="aobake" {counts}>\n'.encode()
    yield (
        f'<testsuite name={_attribute(run.source)} {counts} skipped="{totals.states["stopped"]}" '
        f'timestamp="{started}">\n'
    ).encode()
    for entry in entries:
        yield _case(entry).encode()
    yield b"</testsuite>\n</testsuites>\n"


def _case(entry: Entry) -> str:
    folder, _, name = entry.source.rpartition("/")
    seconds = entry.seconds if entry.attempts else 0.0
    head = (
        f"<testcase classname={_attribute(folder or '.')} "
        f'name={_attribute(f"{name} ({entry.command})")} time="{seconds:.3f}"'
    )
    inside = _verdict(entry) + _said(entry)
    return f"{head}>{inside}</testcase>\n" if inside else f"{head}/>\n"


def _verdict(entry: Entry) -> str:
    """What is wrong with a job; '' where nothing is."""
    reason = _attribute(entry.reason)
    if entry.state == "stopped":
        return f"<skipped message={reason}/>"
    if entry.state == "failed":
        return f'<failure message={reason} type="failed">{_text(entry.reason)}</failure>'
    if entry.state in _ERRORS:
        kind = f'type="{_ERRORS[entry.state]}"'
        return f"<error message={reason} {kind}>{_text(entry.reason)}</error>"
    return ""


def _said(entry: Entry) -> str:
    """What a job that gave its result has to say."""
    lines = texts_in(entry.report, "warnings")
    if entry.state in {"unchanged", "moved"}:
        lines = [f"{entry.state}: {entry.reason or 'as an earlier run left it'}", *lines]
    return f"<system-out>{_text(chr(10).join(lines))}</system-out>" if lines else ""


def _attribute(text: str) -> str:
    return f'"{escape(_visible(text), _IN_ATTRIBUTES)}"'


def _text(text: str) -> str:
    return escape(_visible(text), {"\r": "&#13;"})


def _visible(text: str) -> str:
    r"""The text, in which what XML cannot hold is spelled, such as \x1b."""
    return _NO_XML.sub(lambda found: ascii(found[0])[1:-1], text)

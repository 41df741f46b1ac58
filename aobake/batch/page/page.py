"""The page itself: facts, then the jobs as data, then the script that makes a table of them."""

from __future__ import annotations

import base64
import html
import string
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC
from importlib.resources import files
from pathlib import Path

from aobake.batch.page.beside import Beside
from aobake.batch.page.rows import as_json, row_of
from aobake.batch.summary import RunFacts
from aobake.batch.tasks import Entry
from aobake.files import write_files
from aobake.standalone import hash_source, policy

__all__ = ["MOST_EMBEDDED", "write_page"]

MOST_EMBEDDED = 24 << 20  # bytes of pictures within the page; those of 3,000 assets and more


def write_page(
    path: Path,
    run: RunFacts,
    entries: Iterable[Entry],
    pictures: Callable[[Entry], Mapping[str, bytes]],
) -> None:
    """Write a batch as a page that needs nothing but itself, also from a disk and without a network.

    entries : read once and not kept
    pictures : "before" and "after" of an entry, as PNG, either or none. The first 24 MiB are within the page, the
        others, and the viewers that keep_viewer has kept, in the folder beside it
    The page appears whole or not at all; what was beside an earlier one and is needed no more is removed then.
    Raises OutputError.
    """
    beside = Beside(path)
    write_files({path: _pieces(run, entries, _Pictures(pictures, beside), beside)})
    beside.tidy()


class _Pictures:
    """Where the page finds the pictures of an entry: in itself, until that would be too much."""

    def __init__(self, of: Callable[[Entry], Mapping[str, bytes]], beside: Beside) -> None:
        self._of, self._beside, self._left = of, beside, MOST_EMBEDDED

    def of(self, entry: Entry) -> dict[str, str]:
        """Name -> address of "before" and "after"."""
        return {
            name: self._address(png)
            for name, png in self._of(entry).items()
            if name in {"before", "after"}
        }

    def _address(self, png: bytes) -> str:
        self._left -= len(png)
        if self._left < 0:
            return self._beside.picture(png)
        return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"


def _pieces(
    run: RunFacts, entries: Iterable[Entry], pictures: _Pictures, beside: Beside
) -> Iterator[bytes]:
    style, script = _text("page.css"), _text("page.js")
    rules = policy(
        scripts=[hash_source(script)],
        styles=[hash_source(style)],
        images=["data:", "'self'"],  # pictures within it and beside it
    )
    page = string.Template(_text("page.html")).substitute(
        policy=html.escape(rules),
        version=html.escape(run.version),
        source=_shown(run.source),
        target=_shown(run.target),
        facts=_shown(_facts(run)),
        style=style,
        script=script,
        rows="\0",  # nothing else holds it
    )
    head, tail = page.split("\0")
    yield head.encode("utf-8", "replace")
    separator = ""
    for entry in entries:
        row = {**row_of(entry), **pictures.of(entry)}
        viewer = None if entry.report is None else beside.viewer(entry.target)
        yield f"{separator}{as_json(row if viewer is None else {**row, 'view': viewer})}".encode()
        separator = ",\n"
    yield tail.encode("utf-8", "replace")


def _shown(text: str) -> str:
    return html.escape(text.replace("\0", " "))


def _facts(run: RunFacts) -> str:
    """When, on what, and how much, in one line."""
    started, finished = run.started.astimezone(UTC), run.finished.astimezone(UTC)
    took = (finished - started).total_seconds()
    totals = run.totals
    parts = [
        f"{started:%Y-%m-%d %H:%M} UTC",
        f"took {_duration(took)}{', and was interrupted' if run.interrupted else ''}",
        f"{totals.rays / 1e6:,.0f} million rays" if totals.rays else "",
        f"{totals.output_bytes / 1e6:,.1f} MB written" if totals.output_bytes else "",
        f"{run.machine}, {run.processors} processors",
        f"aobake {run.version}",
    ]
    return " · ".join(part for part in parts if part)


def _duration(seconds: float) -> str:
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def _text(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")

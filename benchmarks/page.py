"""Put the tables of the last whole runs into docs/performance.md, docs/accuracy.md and README.md, and draw the plots.

    python benchmarks/page.py [--check]

A table stands between the lines `<!-- benchmark: title -->` and `<!-- end -->`; what is between them is
replaced. `<!-- page: The runs -->` is for the table of all runs. With --check nothing is written, and the status is
1 where a page is not what the records say.
"""

from __future__ import annotations

import argparse
import importlib
import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tables import Table, restored

HERE = Path(__file__).parent
DOCS = HERE.parent / "docs"
PAGES = (DOCS / "performance.md", DOCS / "accuracy.md", HERE.parent / "README.md")
ITSELF = "page"
# Benchmarks that draw a plot of their last run, and the table that it shows.
DRAWN = {"growth": "By triangles", "study_textures": "RMSE by rays"}
PLACE = re.compile(r"<!-- (\w+): ([^\n]+?) -->\n.*?<!-- end -->", re.DOTALL)


def whole_runs(benchmark: str) -> list[Mapping[str, Any]]:
    """The records of a benchmark but for quick ones, the last one last."""
    file = HERE / "results" / f"{benchmark}.jsonl"
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return [record for record in map(json.loads, lines) if not record["quick"]]


def record_of(benchmark: str, title: str) -> Mapping[str, Any] | None:
    """The last whole run that has the table; None where there is none."""
    runs = whole_runs(benchmark)
    having = [run for run in runs if any(table["title"] == title for table in run["tables"])]
    return having[-1] if having else None


def all_runs() -> str:
    """When each benchmark was last run, and the peak memory of the largest of its processes."""
    rows = []
    for name in sorted(path.stem for path in (HERE / "results").glob("*.jsonl")):
        for run in whole_runs(name)[-1:]:
            low, high = run["load"]
            peak = run["peak_memory"] / 1e6
            said = f"{low:.1f} to {high:.1f}"
            rows.append([name, run["date"][:10], run["commit"], said, run["seconds"], peak])
    columns = ("benchmark", "date", "commit", "load", "seconds", "peak memory, MB")
    return Table("The runs", columns, rows).markdown()


def filled(place: re.Match[str]) -> str:
    """A place with its table, or with what to run for it."""
    benchmark, title = place.groups()
    if benchmark == ITSELF:
        return f"<!-- {benchmark}: {title} -->\n{all_runs()}<!-- end -->"
    record = record_of(benchmark, title)
    body = f"Not measured yet: `python benchmarks {benchmark}`.\n"
    if record is not None:
        table = next(t for t in record["tables"] if t["title"] == title)
        low, high = record["load"]
        run = (
            f"`python benchmarks {benchmark}`, {record['date'][:10]}, load {low:.1f} to {high:.1f}."
        )
        body = f"{restored(table).markdown()}\n{run}\n"
    return f"<!-- {benchmark}: {title} -->\n{body}<!-- end -->"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--check", action="store_true")
    asked = parser.parse_args()
    old = {page: page.read_text(encoding="utf-8") for page in PAGES}
    new = {page: PLACE.sub(filled, text) for page, text in old.items()}
    if asked.check:
        sys.exit(new != old)
    for page, text in new.items():
        page.write_text(text, encoding="utf-8")
    for name, title in DRAWN.items():
        if record_of(name, title) is not None:
            drawer = importlib.import_module(name)
            drawer.draw(drawer.last_whole_run(), DOCS / "images")


if __name__ == "__main__":
    main()

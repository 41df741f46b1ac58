"""Put the tables of the last whole run into docs/performance.md, and the plots beside it.

    python benchmarks/page.py [--check]

A table stands between the lines `<!-- benchmark: title -->` and `<!-- end -->`; what is between them is
replaced. With --check nothing is written, and the status is 1 where the page is not what the records say.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tables import restored

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "performance.md"
PLACE = re.compile(r"<!-- (\w+): ([^\n]+?) -->\n.*?<!-- end -->", re.DOTALL)


def record_of(benchmark: str, title: str) -> Mapping[str, Any] | None:
    """The last whole run that has the table; None where there is none."""
    file = HERE / "results" / f"{benchmark}.jsonl"
    if not file.exists():
        return None
    records = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    whole = [r for r in records if not r["quick"] and any(t["title"] == title for t in r["tables"])]
    return whole[-1] if whole else None


def filled(place: re.Match[str]) -> str:
    """A place with its table, or with what to run for it."""
    benchmark, title = place.groups()
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
    old = PAGE.read_text(encoding="utf-8")
    new = PLACE.sub(filled, old)
    if asked.check:
        sys.exit(new != old)
    PAGE.write_text(new, encoding="utf-8")
    if record_of("growth", "By triangles") is not None:
        import growth

        growth.draw(growth.last_whole_run(), PAGE.parent / "images")


if __name__ == "__main__":
    main()

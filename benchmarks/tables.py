"""What a benchmark gives: tables of numbers with their spread, as Markdown and as data.

A benchmark is a module of this folder with a function `run(quick: bool) -> Iterator[Table]`. It yields
each table as soon as it is measured; `quick` asks for sizes that take seconds. It raises Skipped where
something that it needs is not there.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

__all__ = ["Cell", "Skipped", "Spread", "Table", "in_turn", "ratios", "restored", "shown"]


class Skipped(Exception):
    """A benchmark that cannot be run here, and why."""


@dataclass(frozen=True)
class Spread:
    """The median of some repeats, the least and the most of them, and how many there were."""

    median: float
    least: float
    most: float
    runs: int

    @classmethod
    def of(cls, values: Iterable[float]) -> Spread:
        """Of at least one value."""
        some = list(values)
        return cls(statistics.median(some), min(some), max(some), len(some))


Cell = str | int | float | Spread | None


@dataclass(frozen=True)
class Table:
    """Rows of cells under columns; facts are what is the same for all rows."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    facts: Mapping[str, Cell] = field(default_factory=dict)
    note: str = ""

    def markdown(self) -> str:
        """The table as it is printed, with its title above and its note below."""
        facts = "".join(f"; {name} {shown(value)}" for name, value in self.facts.items())
        rows = (self.columns, ["---"] * len(self.columns), *self.rows)
        lines = ["| " + " | ".join(map(shown, cells)) + " |" for cells in rows]
        below = ["", self.note] if self.note else []
        return "\n".join([f"**{self.title}**{facts}", "", *lines, *below, ""])


def restored(data: Mapping[str, Any]) -> Table:
    """A table from a record of it."""

    def cell(value: Any) -> Cell:
        return Spread(**value) if isinstance(value, dict) else value

    rows = [[cell(value) for value in row] for row in data["rows"]]
    facts = {name: cell(value) for name, value in data["facts"].items()}
    return Table(data["title"], data["columns"], rows, facts, data["note"])


def shown(cell: Cell) -> str:
    """A cell as text: three significant digits, and the spread behind the median."""
    match cell:
        case None:
            return "-"
        case Spread(median, least, most):
            return f"{_number(median)} ({_number(least)} to {_number(most)})"
        case float():
            return _number(cell)
        case int():
            return f"{cell:,}"
    return cell


def _number(value: float) -> str:
    if value == 0.0 or 1e-4 <= abs(value) < 999.5:
        text = f"{value:.3g}"
        return text if "e" not in text else f"{value:.4f}"
    return f"{value:,.0f}" if abs(value) >= 999.5 else f"{value:.1e}"


def in_turn(
    works: Mapping[str, Callable[[], object]],
    repeats: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, list[float]]:
    """Seconds of each work, all of them once in each repeat, after one round that does not count.

    Machines are shared and slow down for a while: what is compared has to be measured side by side.
    """
    taken: dict[str, list[float]] = {name: [] for name in works}
    for number in range(repeats + 1):
        for name, work in works.items():
            start = clock()
            work()
            if number:
                taken[name].append(clock() - start)
    return taken


def ratios(above: Iterable[float], below: Iterable[float]) -> Spread:
    """The spread of the ratios within each repeat."""
    return Spread.of(a / b for a, b in zip(above, below, strict=True))

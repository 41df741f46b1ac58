"""What is shown: lines, the progress bar, tables. The one file that imports rich, and only to draw."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence

__all__ = [
    "Draw",
    "Progress",
    "Section",
    "error",
    "live_lines",
    "note",
    "progress_bar",
    "reset",
    "say",
    "say_names",
    "tables",
    "warn",
    "warning",
]

Progress = Callable[[str, int, int], None]
"""Called with the stage, what is done of it, and all there is to do."""

Draw = Callable[[float, Sequence[str]], None]
"""Called with the share that is done, in [0, 1], and lines of text to stand below its bar."""

Section = tuple[str, Mapping[str, str]]
"""A title, and what is said under it: name -> value."""

MOST_WARNINGS = 10
# Controls, and marks that turn the direction of what follows.
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def error(message: str) -> None:
    """One line on stderr that says why nothing came of it."""
    _to_stderr("error", message)


def warning(message: str) -> None:
    """One line on stderr that says what is not as it should be."""
    _to_stderr("warning", message)


def warn(messages: Sequence[str], more: str) -> None:
    """One line on stderr for each warning; of many, the first ones and how many more, and where they are."""
    shown = messages if len(messages) <= MOST_WARNINGS else messages[: MOST_WARNINGS - 1]
    for message in shown:
        warning(message)
    if len(shown) < len(messages):
        warning(f"and {len(messages) - len(shown)} more{more}.")


def note(message: str) -> None:
    """One line on stderr that is no trouble."""
    _to_stderr("", message)


def say(*lines: str) -> None:
    """Lines on stdout."""
    sys.stdout.write("".join(f"{line}\n" for line in lines))


def say_names(*lines: str) -> None:
    """Lines on stdout with names of files in them, each on one line whatever the names hold."""
    say(*map(_one_line, lines))


@contextlib.contextmanager
def progress_bar(*, quiet: bool) -> Iterator[Progress | None]:
    """A bar on stderr that vanishes when it is done; None where nobody would see it."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = (
        TextColumn("{task.description:8}"),
        BarColumn(bar_width=None),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        tasks = {}

        def advance(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage)
            bars.update(tasks[stage], completed=done, total=total)

        yield advance


@contextlib.contextmanager
def live_lines() -> Iterator[Draw | None]:
    """A bar and some lines at the foot of the terminal on stderr, which vanish at the end; None elsewhere.

    Whatever is written to stderr meanwhile stands above them, and stays.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console, Group
    from rich.live import Live
    from rich.padding import Padding
    from rich.progress_bar import ProgressBar
    from rich.text import Text

    console = Console(stderr=True)
    with Live(console=console, transient=True, auto_refresh=False, redirect_stdout=False) as live:

        def draw(share: float, lines: Sequence[str]) -> None:
            texts = [Text(_one_line(line), no_wrap=True, overflow="ellipsis") for line in lines]
            bar = Padding(ProgressBar(total=1.0, completed=share), 0)  # by itself it ends no line
            live.update(Group(bar, *texts), refresh=True)

        yield draw


def tables(sections: Sequence[Section]) -> None:
    """Names and values on stdout: as tables on a terminal, else as `title.name: value`, one a line."""
    if not sys.stdout.isatty():
        for title, rows in sections:
            say(*(f"{title}.{name}: {_one_line(value)}" for name, value in rows.items()))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    for title, rows in sections:
        table = Table(title=Text(title), title_justify="left", show_header=False, box=None)
        table.add_column(style="bold", no_wrap=True)
        table.add_column(overflow="fold")
        for name, value in rows.items():
            table.add_row(Text(name), Text(value))
        console.print(table)
        console.print()


def reset() -> None:
    """Take back what a bar has done to the terminal, for a process that ends without leaving it."""
    with contextlib.suppress(OSError, ValueError):
        if sys.stderr.isatty():
            sys.stderr.write("\r\x1b[2K\x1b[?25h")  # an empty line, and the cursor shown


def _to_stderr(kind: str, message: str) -> None:
    # A closed stderr must not turn one problem into two.
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(f"aobake: {kind}{': ' if kind else ''}{_one_line(message)}\n")
        sys.stderr.flush()


def _one_line(message: str) -> str:
    r"""On one line, with what could steer a terminal spelled, such as \x1b: names of files may hold it."""
    return _CONTROL.sub(lambda found: ascii(found[0])[1:-1], " ".join(message.splitlines()))

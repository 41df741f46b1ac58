"""What `aobake batch` and `aobake watch` share: how flags become a batch, and how its end is told."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

from aobake import SettingsError
from aobake.batch.settings import BatchSettings
from aobake.cli import terminal
from aobake.cli.app import Group, Parameter
from aobake.cli.options import COMMON, flags_of
from aobake.files import check_writable
from aobake.flags import in_flags

if TYPE_CHECKING:
    from aobake.batch.run import Batch, Ended
    from aobake.batch.summary import Totals
    from aobake.batch.tasks import Executor

__all__ = ["BatchFlags", "Folder", "FolderOptions", "batch_of", "executor_here", "stopping", "tell"]

Flags = Mapping[str, object] | None
if TYPE_CHECKING:
    BatchFlags = Flags
else:
    BatchFlags = flags_of((BatchSettings, "Folders", 1))
MOST_NAMES = 5

Folder = Annotated[str, Parameter(alias="-o", group=Group("Writing", sort_key=1))]


@Parameter(name="*", group=COMMON)
@dataclass(frozen=True, kw_only=True)
class FolderOptions:
    """What commands can be told that bake folders."""

    report: Path | None = None
    """Write what was done to this file, as JSON. Left out: report.json in the output folder."""

    junit: Path | None = None
    """Write a JUnit report to this file, for continuous integration."""

    root: Path | None = None
    """Folder that side files of assets may lie in. Left out: the folder of each asset."""

    state: Path | None = None
    """Folder for what is remembered of earlier runs; needed for a URL. Left out: .aobake in the output folder."""

    force: bool = False
    """Bake everything anew, also what has not changed."""

    prune: bool = False
    """Remove outputs of assets that are there no more."""

    quiet: bool = False
    """Say nothing but errors."""

    debug: bool = False
    """Show where in the program an error arose."""


def batch_of(
    folder: str, output: str, batch: Flags, bake: Flags, options: FolderOptions, *, command: str
) -> Batch:
    """The batch that flags ask for. Raises SettingsError, and OutputError for reports that cannot be written."""
    from aobake.batch.remote import place_of
    from aobake.batch.run import Batch, Reports
    from aobake.batch.tree import STATE
    from aobake.jobs import Reading

    remote = "://" in output
    if remote and options.state is None:
        raise SettingsError(
            f"--state is needed where the output is a URL ({output}): a folder on this machine for what "
            "is remembered of earlier runs."
        )
    state = options.state or Path(output) / STATE
    data = options.report or (state if remote else Path(output)) / "report.json"
    page = data.with_suffix(".html")
    if len({data, page, options.junit}) < 3:
        raise SettingsError(
            f"--report {data}: {page} is for people to read. Give names that differ."
        )
    for file in (options.report, options.junit):
        if file is not None and file.parent != Path(output):  # which is made, where there is none
            check_writable(file)
    return Batch(
        source=place_of(folder),
        target=place_of(output),
        settings=_settings(batch or {}),
        flags=bake or {},
        reading=Reading(root=options.root),
        state=state,
        reports=Reports(data=data, page=page, junit=options.junit),
        force=options.force,
        prune=options.prune,
        command=f"aobake {command} {folder} -o {output}",
    )


def _settings(given: Mapping[str, object]) -> BatchSettings:
    from aobake.batch.outputs import check_format

    checked: dict[str, Any] = dict(given)  # by __post_init__
    try:
        settings = BatchSettings(**checked)
        for command in settings.bake:
            if settings.format is not None:
                check_format(command, settings.format)
        return settings
    except SettingsError as error:
        raise SettingsError(in_flags(str(error), BatchSettings)) from error


def executor_here(batch: Batch) -> AbstractContextManager[Executor]:
    """Processes on this machine, as many and with as many threads as the batch may have."""
    from aobake.batch.processes import LocalExecutor

    threads = batch.flags.get("threads")
    return LocalExecutor(
        processes=batch.settings.processes, threads=threads if isinstance(threads, int) else None
    )


@contextmanager
def stopping(stop: threading.Event) -> Iterator[None]:
    """Within it, the first Ctrl-C asks the batch to stop, and the second interrupts it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def ask(_number: int, _frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, ask) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


def tell(ended: Ended, batch: Batch, *, quiet: bool) -> int:
    """Say how a batch ended, in a few lines; the exit status."""
    totals = ended.totals
    if not quiet:
        page = batch.reports.page
        terminal.say_names(f"{batch.target.name}: {_counted(totals)}. {page} shows them.")
        if ended.leftovers:
            terminal.say(f"{len(ended.leftovers)} unfinished files of a killed run were removed.")
        terminal.say_names(*_stale(ended))
    if ended.interrupted:
        terminal.error("interrupted; the same command goes on from here.")
        return 130
    return 1 if totals.failures else 0


def _counted(totals: Totals) -> str:
    """How many jobs came to what."""
    words = {"memory": "out of memory", "timeout": "out of time"}
    found = [f"{n:,} {words.get(state, state)}" for state, n in totals.states.items() if n]
    return ", ".join(found) or "no assets"


def _stale(ended: Ended) -> list[str]:
    """What is said of outputs whose assets are gone."""
    if ended.pruned is not None:
        kept = [f"{name}: kept, {why}." for name, why in ended.pruned.kept]
        removed = ended.pruned.removed
        return [*([f"removed {_some(removed)}."] if removed else []), *kept]
    if not ended.stale:
        return []
    return [f"outputs of no asset now: {_some(ended.stale)}. --prune removes them."]


def _some(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more

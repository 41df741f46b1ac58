"""`aobake watch`: bake what changes in a folder, as it changes."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from aobake import AobakeError, SettingsError
from aobake.cli import terminal
from aobake.cli.batching import (
    BatchFlags,
    Folder,
    FolderOptions,
    batch_of,
    executor_here,
    stopping,
    tell,
)
from aobake.cli.options import BakeFlags
from aobake.files import is_unfinished

if TYPE_CHECKING:
    from aobake.batch.run import Batch

__all__ = ["watch"]

LOOK_MS = 500  # how often it is looked whether to stop
SETTLED_MS = 400  # without a change, before what changed is baked: exporters write in several steps


def watch(
    folder: str,
    /,
    *,
    output: Folder,
    batch: BatchFlags = None,
    bake: BakeFlags = None,
    options: FolderOptions = FolderOptions(),  # noqa: B008 - frozen
) -> int:
    """Bake what changes in a folder of assets, as it changes.

    Begins as aobake batch does, and then waits: whenever an asset, a file that
    it refers to, or an aobake.toml is written, what depends on it is baked
    again. Ctrl-C ends it.

    Parameters
    ----------
    folder:
        The folder of assets.
    output:
        The folder to write into, which must not be within the other.
    """
    from aobake.batch.run import run_batch
    from aobake.cli.batch_progress import watching

    wanted = batch_of(folder, output, batch, bake, options, command="watch")
    stop = threading.Event()
    with stopping(stop), executor_here(wanted) as executor:
        for first in changes(Path(folder), written_by(wanted), stop):
            try:
                with watching(quiet=options.quiet) as watcher:
                    ended = run_batch(
                        wanted, lambda: nullcontext(executor), watcher=watcher, stop=stop
                    )
            except AobakeError as error:
                if first:
                    raise
                terminal.error(str(error))  # the next change may be its cure
                continue
            if not stop.is_set():
                tell(ended, wanted, quiet=options.quiet)
    terminal.error("interrupted.")
    return 130


def written_by(batch: Batch) -> tuple[Path, ...]:
    """The files and folders that a batch writes: a change there is none to bake for."""
    from aobake.batch.page import files_beside
    from aobake.batch.places import LocalFolder

    places: list[Path | None] = [
        batch.state,
        batch.reports.data,
        batch.reports.page,
        batch.reports.junit,
    ]
    if batch.reports.page is not None:
        places.append(files_beside(batch.reports.page))
    if isinstance(batch.target, LocalFolder):
        places.append(batch.target.folder)
    return tuple(path for path in places if path is not None)


def changes(folder: Path, ours: Sequence[Path], stop: threading.Event) -> Iterator[bool]:
    """True now, and then False whenever something below the folder has changed and settled.

    ours : files and folders whose changes do not count     stop : when set, it ends
    Raises SettingsError where watching is not possible.
    """
    try:
        from watchfiles import watch as watched
    except ImportError as error:
        raise SettingsError(
            "aobake watch needs watchfiles. Install it: pip install 'aobake[watch]'"
        ) from error
    if not folder.is_dir():
        raise SettingsError(f"{folder}: a folder on this machine is needed to watch.")
    events = watched(
        folder,
        watch_filter=lambda _, path: counts(path, ours),
        stop_event=stop,
        debounce=4 * SETTLED_MS,
        step=SETTLED_MS,
        rust_timeout=LOOK_MS,
        yield_on_timeout=True,
        raise_interrupt=False,
    )
    next(events, None)  # watching begins before the first bake: nothing is missed meanwhile
    yield True
    for seen in events:
        if stop.is_set():
            return
        if seen:
            yield False


def counts(path: str, ours: Sequence[Path]) -> bool:
    """Whether a change of a file is one to bake for. ours : files and folders of which none is"""
    where = Path(os.path.realpath(path))
    if is_unfinished(where.name):
        return False
    return not any(where.is_relative_to(os.path.realpath(one)) for one in ours)

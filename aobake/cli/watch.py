"""`aobake watch`: bake what changes in a folder, as it changes."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

from aobake import SettingsError
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
        for _ in changes(Path(folder), stop):
            with watching(quiet=options.quiet) as watcher:
                ended = run_batch(wanted, lambda: nullcontext(executor), watcher=watcher, stop=stop)
            if not stop.is_set():
                tell(ended, wanted, quiet=options.quiet)
    terminal.error("interrupted.")
    return 130


def changes(folder: Path, stop: threading.Event) -> Iterator[None]:
    """Once now, and then whenever something below the folder has changed and settled, until it is stopped.

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
        stop_event=stop,
        debounce=4 * SETTLED_MS,
        step=SETTLED_MS,
        rust_timeout=LOOK_MS,
        yield_on_timeout=True,
        raise_interrupt=False,
    )
    next(events, None)  # watching begins before the first bake: nothing is missed meanwhile
    yield
    for seen in events:
        if stop.is_set():
            return
        if seen:
            yield

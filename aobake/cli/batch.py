"""`aobake batch`: bake a folder of assets."""

from __future__ import annotations

import shlex
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from aobake import SettingsError
from aobake.cli import terminal
from aobake.cli.app import Group, Parameter
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
from aobake.files import make_folder
from aobake.flags import changed_settings, command_line

if TYPE_CHECKING:
    from aobake.batch.run import Batch, Pairs
    from aobake.batch.tasks import Executor

__all__ = ["batch"]


@Parameter(name="*", group=Group("Running", sort_key=4))
@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """What is done instead of baking here."""

    dry_run: bool = False
    """Say what would be baked, why, and with which settings; bake nothing."""

    list_commands: bool = False
    """Print a command for each asset to bake, for other farm managers, and make their folders; bake nothing."""

    cluster: str | None = None
    """Bake on the dask cluster with this scheduler, such as tcp://scheduler:8786."""


def batch(
    folder: str,
    /,
    *,
    output: Folder,
    batch: BatchFlags = None,
    bake: BakeFlags = None,
    run: RunOptions = RunOptions(),
    options: FolderOptions = FolderOptions(),  # noqa: B008 - frozen
) -> int:
    """Bake a folder of assets, and later what has changed in it.

    Takes every asset in the folder and below, and writes a tree of the same
    shape. What has not changed since the last run is not baked again. An asset
    that cannot be baked fails alone; report.html shows what became of each.

    Settings come from files aobake.toml in the folders, for everything or for
    patterns of names, and from flags, which have the last word.

    Parameters
    ----------
    folder:
        The folder of assets; a path, or a URL such as s3://bucket/assets.
    output:
        The folder to write into, which must not be within the other.
    """
    from aobake.batch.run import compare, run_batch
    from aobake.cli.batch_progress import watching

    wanted = batch_of(folder, output, batch, bake, options, command="batch")
    if run.dry_run and run.list_commands:
        raise SettingsError("--dry-run and --list-commands both bake nothing; give one of them.")
    if run.dry_run:
        terminal.say_names(*_dry(compare(wanted)))
        return 0
    if run.list_commands:
        return _list_commands(wanted, compare(wanted))
    stop = threading.Event()

    def executor() -> AbstractContextManager[Executor]:
        return _cluster(run.cluster, wanted) if run.cluster else executor_here(wanted)

    with stopping(stop), watching(quiet=options.quiet) as watcher:
        ended = run_batch(wanted, executor, watcher=watcher, stop=stop)
    return tell(ended, wanted, quiet=options.quiet)


def _cluster(address: str, batch: Batch) -> AbstractContextManager[Executor]:
    from aobake.batch.cluster import on_cluster

    return on_cluster(address, batch.source, batch.target, batch.settings.tiles)


def _dry(pairs: Pairs) -> Iterator[str]:
    """For each asset what would be done with it, why, and the settings that are not the defaults."""
    for planned, standing in pairs:
        job = planned.job
        if standing.kind == "refused":
            yield f"refuse  {planned.refused}"
            continue
        what = {"unchanged": "keep", "moved": "reuse"}.get(standing.kind, "bake")
        why = f": {standing.reason}" if standing.reason else ""
        yield f"{what:6}  {planned.source} -> {planned.target}{why}"
        files = ", ".join(str(file) for file in job.chosen.files)
        said = " ".join(changed_settings(job)) or "the defaults"
        yield f"        {job.command}: {said}{f' ({files})' if files else ''}"
    yield _counts(pairs)


def _list_commands(batch: Batch, pairs: Pairs) -> int:
    """Print what is to be baked as commands, and say what none can bake; the exit status."""
    from aobake.batch.places import LocalFolder

    for place in (batch.source, batch.target):
        if not isinstance(place, LocalFolder):
            raise SettingsError(
                f"--list-commands is for folders on this machine, not {place.name}."
            )
    status = 0
    for planned, standing in pairs:
        line = shlex.join(command_line(planned.job))
        if standing.kind == "refused":
            terminal.error(planned.refused)
            status = 1
        elif standing.to_bake and not line.isprintable():
            terminal.error(f"{planned.job.input}: its name cannot stand in a line. Rename it.")
            status = 1
        elif standing.to_bake:
            make_folder(planned.job.output.parent)
            terminal.say(line)
    return status


def _counts(pairs: Pairs) -> str:
    kinds = Counter("to bake" if standing.to_bake else standing.kind for _, standing in pairs)
    return ", ".join(f"{count:,} {kind}" for kind, count in sorted(kinds.items())) or "no assets"

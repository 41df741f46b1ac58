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
from aobake.cli.output import make_folder
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
    """Print one command line for each asset that is to be baked, for another farm manager, and make the
    folders that they write into; bake nothing."""

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
    if run.dry_run or run.list_commands:
        pairs = compare(wanted)
        terminal.say(*(_commands(pairs) if run.list_commands else _dry(pairs)))
        return 0
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


def _commands(pairs: Pairs) -> Iterator[str]:
    for planned, standing in pairs:
        if standing.to_bake:
            make_folder(planned.job.output.parent)
            yield shlex.join(command_line(planned.job))


def _counts(pairs: Pairs) -> str:
    kinds = Counter("to bake" if standing.to_bake else standing.kind for _, standing in pairs)
    return ", ".join(f"{count:,} {kind}" for kind, count in sorted(kinds.items())) or "no assets"

"""Outputs that nothing stands for any more: those of assets that are gone or are written elsewhere now."""

from __future__ import annotations

import unicodedata
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from aobake.batch.database import Database, name_stored
from aobake.batch.places import Place
from aobake.batch.standing import Known, Record
from aobake.batch.tasks import Planned
from aobake.batch.tree import Tree
from aobake.errors import AobakeError

__all__ = ["Pruned", "Stale", "prune", "stale_files"]


@dataclass(frozen=True, kw_only=True)
class Pruned:
    """What became of stale outputs: names that were removed, and (name, why) of those that were kept."""

    removed: tuple[str, ...]
    kept: tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class Stale:
    """What nothing stands for any more.

    jobs : targets of jobs that are to be forgotten with their files
    files : that a bake wrote and none needs, by name
    needed : names of all files that are an output of a job that stands, or lie beside it for it
    """

    jobs: frozenset[str]
    files: Mapping[str, Record]
    needed: frozenset[str]


def stale_files(known: Mapping[str, Known], planned: Sequence[Planned], source: Tree) -> Stale:
    """What is stale now.

    A job is, when it is not planned and its asset is gone, or is planned with another target; an asset that
    is there and was only not asked for, or is refused, keeps its outputs. A file is, when no other job needs it.
    """
    targets = {job.target for job in planned if not job.refused}
    assets = {job.source for job in planned if not job.refused}
    jobs = frozenset(
        job.target
        for job in known.values()
        if job.target not in targets and (job.source in assets or source.gone(job.source))
    )
    standing = [job for job in known.values() if job.target not in jobs]
    needed = frozenset(file.name for job in standing for file in job.of("out", "side")) | targets
    files = {file.name: file for job in standing for file in job.of("left")}
    files |= {file.name: file for name in jobs for file in known[name].of("out", "left")}
    return Stale(
        jobs=jobs,
        files={name: file for name, file in sorted(files.items()) if name not in needed},
        needed=needed,
    )


def prune(stale: Stale, known: Mapping[str, Known], database: Database, target: Place) -> Pruned:
    """Remove stale files that still have the content that a bake gave them; say of the others why they stay."""
    removed: list[str] = []
    kept: list[tuple[str, str]] = []
    folded = {_folded(name) for name in stale.needed}
    for name, file in stale.files.items():
        if target.stamp(name) is None:
            continue
        if why := _why_not(file, folded, target):
            kept.append((name, why))
        else:
            removed.append(name)
    _forget(stale, {name for name, _ in kept}, known, database)
    return Pruned(removed=tuple(removed), kept=tuple(kept))


def _why_not(file: Record, needed: Collection[str], target: Place) -> str:
    """Remove a file, or say why it has to stay."""
    path = PurePosixPath(file.name)
    if path.is_absolute() or ".." in path.parts:
        return "it lies outside of the folder of the outputs"
    if _folded(file.name) in needed:  # the same file, on a disk that does not tell them apart
        return "its name differs from that of an output in use by upper and lower case alone"
    try:
        if target.stamp(file.name) != file.stamp and target.digest(file.name) != file.sha256:
            return "it was changed since it was written"
        target.remove(file.name)
    except AobakeError as error:
        return str(error)
    return ""


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()


def _forget(
    stale: Stale, kept: Collection[str], known: Mapping[str, Known], database: Database
) -> None:
    """Forget jobs none of whose files was kept; a file that another job needs still is that job's from now on."""
    with database.writing() as connection:
        for job in (known[target] for target in stale.jobs):
            written = {file.name for file in job.of("out", "left")}
            if not written & set(kept):
                connection.execute("DELETE FROM jobs WHERE id = ?", (job.job,))
                connection.executemany(
                    "UPDATE files SET role = 'out' WHERE role = 'side' AND name = ?",
                    [(name_stored(name),) for name in written & stale.needed],
                )
        connection.executemany(
            "DELETE FROM files WHERE role = 'left' AND name = ?",
            [(name_stored(name),) for name in stale.files if name not in kept],
        )

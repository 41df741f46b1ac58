"""Jobs and their bakes as rows of the database, and back: nothing is decided here."""

from __future__ import annotations

import functools
import json
import sqlite3
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import cast

from aobake.batch.database import Database, name_of, name_stored, packed, unpacked
from aobake.batch.keys import fingerprint, recipe
from aobake.batch.places import Stamp
from aobake.batch.standing import Known, Record, Role
from aobake.batch.tasks import Entry, Planned

__all__ = [
    "ENTRIES",
    "FAILURES",
    "Bake",
    "bake_of",
    "entry_of",
    "known_jobs",
    "pictures_of",
    "put_bake",
    "put_job",
]

FAILURES = frozenset({"failed", "crashed", "memory", "timeout"})
_GOOD = frozenset({"baked", "unchanged", "moved"})

ENTRIES = """
SELECT jobs.id, source, target, command, state, reason, attempts, jobs.seconds, jobs.peak_bytes, size,
       settings_files, recipes.recipe, bakes.seconds, bakes.peak_bytes, bakes.report
FROM jobs JOIN recipes ON fingerprint = jobs.recipe LEFT JOIN bakes ON bakes.job = jobs.id
WHERE run = ? ORDER BY source, target"""

_JOB = (
    "target", "source", "command", "run", "state", "reason", "attempts", "seconds", "peak_bytes", "size",
    "recipe", "settings_files",
)  # fmt: skip
_PUT_JOB = (
    f"INSERT INTO jobs ({', '.join(_JOB)}) VALUES (:{', :'.join(_JOB)}) ON CONFLICT (target) "  # noqa: S608
    f"DO UPDATE SET {', '.join(f'{name} = :{name}' for name in _JOB)} RETURNING id"
)


@dataclass(frozen=True, kw_only=True)
class Bake:
    """A good bake, as it is kept.

    seconds, peak_bytes : that it took
    files : read, written, needed beside and left over, the asset first
    """

    version: str
    fingerprint: str
    seconds: float
    peak_bytes: int
    report: Mapping[str, object]
    files: tuple[Record, ...]
    pictures: Mapping[str, bytes]


def put_job(
    connection: sqlite3.Connection,
    planned: Planned,
    run: int,
    state: str,
    reason: str = "",
    *,
    attempts: int = 0,
    seconds: float = 0.0,
    peak_bytes: int = 0,
) -> int:
    """What became of a job in a run, in place of what an earlier run said of it; its number."""
    text = recipe(planned.job)
    connection.execute("INSERT OR IGNORE INTO recipes VALUES (?, ?)", (fingerprint(text), text))
    values = {
        "target": name_stored(planned.target or _key_without(planned)),
        "source": name_stored(planned.source),
        "command": planned.job.command,
        "run": run,
        "state": state,
        "reason": name_stored(reason),
        "attempts": attempts,
        "seconds": seconds,
        "peak_bytes": peak_bytes,
        "size": planned.size,
        "recipe": fingerprint(text),
        "settings_files": json.dumps([str(file) for file in planned.job.chosen.files]),
    }
    ((number,),) = connection.execute(_PUT_JOB, values).fetchall()
    return cast(int, number)


def _key_without(planned: Planned) -> str:
    """What a job without a target is known by: names of outputs are relative, and none begins like this."""
    return f"/{planned.job.command}/{planned.source}"


def put_bake(connection: sqlite3.Connection, job: int, bake: Bake) -> None:
    """A good bake of a job, in place of an earlier one."""
    connection.execute(
        "INSERT OR REPLACE INTO bakes VALUES (?, ?, ?, ?, ?, ?)",
        (
            job,
            bake.version,
            bake.fingerprint,
            bake.seconds,
            bake.peak_bytes,
            packed(dict(bake.report)),
        ),
    )
    connection.execute("DELETE FROM files WHERE job = ?", (job,))
    connection.executemany(
        "INSERT INTO files VALUES (?, ?, ?, ?, ?, ?, ?)",
        [
            (
                job,
                file.role,
                position,
                name_stored(file.name),
                file.stamp.size,
                file.stamp.changed,
                file.sha256,
            )
            for position, file in enumerate(bake.files)
        ],
    )
    connection.execute("DELETE FROM pictures WHERE job = ?", (job,))
    connection.executemany(
        "INSERT INTO pictures VALUES (?, ?, ?)",
        [(job, name, content) for name, content in bake.pictures.items()],
    )


def known_jobs(database: Database) -> dict[str, Known]:
    """Target -> what is known of it, in two queries for all jobs."""
    files: dict[int, list[Record]] = defaultdict(list)
    for row in database.rows("SELECT * FROM files ORDER BY job, position"):
        files[cast(int, row[0])].append(_record(row))
    known = {}
    for row in database.rows(
        "SELECT id, target, source, state, reason, version, bakes.recipe, bakes.seconds, bakes.peak_bytes "
        "FROM jobs LEFT JOIN bakes ON job = id"
    ):
        job, target, source, state, reason, version, made_by, seconds, peak = row
        job = cast(int, job)
        records = tuple(files.get(job, ()))
        # The asset of the last good bake; that of the row may have come later, and failed.
        asset = records[0].name if records and records[0].role == "in" else name_of(source)
        known[name_of(target)] = Known(
            job=job,
            target=name_of(target),
            source=asset,
            failure=(name_of(reason) or str(state)) if state in FAILURES else "",
            version=str(version or ""),
            fingerprint=str(made_by or ""),
            seconds=cast(float, seconds or 0.0),
            peak_bytes=cast(int, peak or 0),
            files=records,
        )
    return known


def _record(row: Sequence[object]) -> Record:
    _, role, _, name, size, changed, sha256 = row
    stamp = Stamp(cast(int, size), str(changed))
    return Record(cast(Role, role), name_of(name), stamp, str(sha256))


def bake_of(database: Database, known: Known) -> Bake:
    """The last good bake of a job that has one."""
    ((report,),) = database.rows("SELECT report FROM bakes WHERE job = ?", known.job)
    return Bake(
        version=known.version,
        fingerprint=known.fingerprint,
        seconds=known.seconds,
        peak_bytes=known.peak_bytes,
        report=_mapping(unpacked(cast(bytes, report))),
        files=known.files,
        pictures=pictures_of(database, known.target),
    )


def pictures_of(database: Database, target: str) -> dict[str, bytes]:
    """Name -> content of the pictures of a job; empty where there are none."""
    rows = database.rows(
        "SELECT name, content FROM pictures JOIN jobs ON job = id WHERE target = ? ORDER BY name",
        name_stored(target),
    )
    return {str(name): cast(bytes, content) for name, content in rows}


def entry_of(database: Database, row: Sequence[object]) -> Entry:
    """A row of ENTRIES as reports show it."""
    job, source, target, command, state, reason, attempts, seconds, peak, size = row[:10]
    settings_files, recipe_text, bake_seconds, bake_peak, report = row[10:]
    good = state in _GOOD
    files = _files_of(database, cast(int, job)) if good else []
    written = [file for file in files if file.role == "out"]
    read = [file for file in files if file.role == "in"]
    return Entry(
        source=name_of(source),
        target="" if name_of(target).startswith("/") else name_of(target),
        command=str(command),
        state=state,  # type: ignore[arg-type]
        reason=name_of(reason),
        seconds=cast(float, bake_seconds if good else seconds),
        peak_bytes=cast(int, bake_peak if good else peak),
        attempts=cast(int, attempts),
        input_bytes=sum(file.stamp.size for file in read) if good else cast(int, size),
        output_bytes=sum(file.stamp.size for file in written),
        outputs=tuple(file.name for file in written),
        settings=_settings(str(recipe_text)),
        settings_files=tuple(json.loads(str(settings_files))),
        report=_mapping(unpacked(cast(bytes, report))) if good else None,
    )


@functools.lru_cache(maxsize=256)
def _settings(recipe_text: str) -> Mapping[str, object]:
    """Those in a recipe, which many jobs share."""
    return MappingProxyType(json.loads(recipe_text)["settings"])


def _files_of(database: Database, job: int) -> list[Record]:
    rows = database.rows("SELECT * FROM files WHERE job = ? ORDER BY position", job)
    return [_record(row) for row in rows]


def _mapping(data: object) -> Mapping[str, object]:
    return cast(Mapping[str, object], data)

"""The file that a batch keeps its memory in: SQLite, one transaction for each job.

Names of files are kept as bytes: on Linux a name need not be Unicode, and the TEXT of SQLite must be.
"""

from __future__ import annotations

import json
import sqlite3
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from aobake.errors import InputError, OutputError

__all__ = [
    "Database",
    "name_of",
    "name_stored",
    "open_database",
    "packed",
    "unpacked",
]

SCHEMA = 1  # grows when an older aobake could not read what a newer one writes
APPLICATION = (
    0x616F626B  # "aobk" at a fixed place of the file: no other program's database is taken for ours
)

TABLES = """
CREATE TABLE runs (
    id INTEGER PRIMARY KEY, started TEXT NOT NULL, finished TEXT, facts TEXT NOT NULL);

-- what the last run that planned a job made of it
CREATE TABLE jobs (
    id INTEGER PRIMARY KEY, target BLOB NOT NULL UNIQUE, source BLOB NOT NULL, command TEXT NOT NULL,
    run INTEGER NOT NULL, state TEXT NOT NULL, reason BLOB NOT NULL, attempts INTEGER NOT NULL,
    seconds REAL NOT NULL, peak_bytes INTEGER NOT NULL, size INTEGER NOT NULL,
    recipe TEXT NOT NULL REFERENCES recipes, settings_files TEXT NOT NULL);
CREATE INDEX jobs_of_runs ON jobs (run, source, target);

-- the last good bake of a job, with the files that it read and wrote
CREATE TABLE bakes (
    job INTEGER PRIMARY KEY REFERENCES jobs ON DELETE CASCADE, version TEXT NOT NULL,
    recipe TEXT NOT NULL REFERENCES recipes, seconds REAL NOT NULL, peak_bytes INTEGER NOT NULL,
    report BLOB NOT NULL);
CREATE TABLE files (
    job INTEGER NOT NULL REFERENCES jobs ON DELETE CASCADE, role TEXT NOT NULL, position INTEGER NOT NULL,
    name BLOB NOT NULL, size INTEGER NOT NULL, changed TEXT NOT NULL, sha256 TEXT NOT NULL,
    PRIMARY KEY (job, position)) WITHOUT ROWID;
CREATE TABLE pictures (
    job INTEGER NOT NULL REFERENCES jobs ON DELETE CASCADE, name TEXT NOT NULL, content BLOB NOT NULL,
    PRIMARY KEY (job, name));

CREATE TABLE recipes (fingerprint TEXT PRIMARY KEY, recipe TEXT NOT NULL) WITHOUT ROWID;
"""


class Database:
    """An open file; what goes wrong with it is said in one line."""

    def __init__(self, connection: sqlite3.Connection, path: str) -> None:
        self._connection, self._path = connection, path

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        """All of what is done within, on the disk at the end, or nothing of it. Raises OutputError."""
        with self._explained():
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    def rows(self, query: str, *values: object) -> Iterator[tuple[object, ...]]:
        """The rows of a query as they are read. Raises InputError."""
        with self._explained():
            for row in self._connection.execute(query, values):  # noqa: UP028 - "yield from" closes the cursor late
                yield row

    def close(self) -> None:
        """Let go of the file."""
        self._connection.close()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        with explained(self._path):
            yield


def open_database(path: Path | None) -> Database:
    """Open a file, or begin a new one; None: one in memory, which is forgotten.

    Raises InputError where the file is broken, of a newer aobake, or not one of aobake's; OutputError where
    it cannot be made or another process has it open. It is never removed.
    """
    name = ":memory:" if path is None else str(path)
    with explained(name):
        connection = sqlite3.connect(name, timeout=1.0, isolation_level=None)
        try:
            _settle(connection)
            _check(connection, name)
        except BaseException:
            connection.close()
            raise
    return Database(connection, name)


def _settle(connection: sqlite3.Connection) -> None:
    # Exclusive: without it a write-ahead log needs memory shared between processes, which folders on a
    # network do not have. Full: a commit is on the disk when it returns, whatever is unplugged then.
    for pragma in (
        "locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON",
    ):  # fmt: skip
        connection.execute(f"PRAGMA {pragma}").fetchall()


def _check(connection: sqlite3.Connection, name: str) -> None:
    """Make the tables of a new file; refuse one that is not ours to write."""
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    (schema,) = connection.execute("PRAGMA user_version").fetchone()
    (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if not tables and not application:
        connection.executescript(
            f"BEGIN IMMEDIATE; {TABLES} PRAGMA application_id = {APPLICATION};"
            f"PRAGMA user_version = {SCHEMA}; COMMIT;"
        )
    elif application != APPLICATION:
        raise InputError(
            f"{name}: this is a database of another program. Move it away, and everything is baked anew."
        )
    elif schema > SCHEMA:
        raise InputError(
            f"{name}: a newer aobake wrote it (schema {schema}; this one knows {SCHEMA}). "
            "Update aobake, or move the file away, and everything is baked anew."
        )


@contextmanager
def explained(name: str) -> Iterator[None]:
    """What SQLite has to say, as an error of aobake's with its cure."""
    try:
        yield
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        if code == sqlite3.SQLITE_BUSY:
            raise OutputError(
                f"{name}: another process has it open. Wait for it, or end it."
            ) from error
        if code in {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR}:
            raise InputError(_broken(name, error)) from error
        raise OutputError(
            f"{name}: the memory of the batch cannot be kept there ({error}). "
            "Make room and allow writing, or give another folder."
        ) from error
    except (zlib.error, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(_broken(name, error)) from error


def _broken(name: str, error: Exception) -> str:
    return f"{name}: it is damaged ({error}). Move it away, and everything is baked anew."


def name_stored(name: str) -> bytes:
    """The bytes that stand for a name; in their order names are sorted as Python sorts them."""
    return name.encode("utf-8", "surrogatepass")


def name_of(stored: object) -> str:
    """The name that these bytes stand for."""
    return bytes(stored).decode("utf-8", "surrogatepass") if isinstance(stored, bytes) else ""


def packed(data: object) -> bytes:
    """Data as small JSON."""
    return zlib.compress(json.dumps(data, separators=(",", ":")).encode())


def unpacked(content: bytes) -> object:
    """What was packed."""
    return json.loads(zlib.decompress(content))

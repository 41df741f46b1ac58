"""Folders for the temporary files of workers. What a killed batch leaves of them, the next one removes."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from aobake.batch.lock import system_lock
from aobake.errors import EngineError

__all__ = ["Scratch", "make_scratch", "remove_abandoned"]

PREFIX = "aobake-worker-"
# Whoever holds the lock of this file in a folder uses it; without such a file, a folder is none of ours.
MARK = ".in-use"
_NAME = re.compile(PREFIX + r"[a-z0-9_]{8}")


@dataclass(frozen=True, eq=False)
class Scratch:
    """A folder that is in use as long as this process lives, or until it is removed."""

    folder: str
    handle: int

    def remove(self) -> None:
        """Remove it with all that is in it. What cannot be removed stays."""
        os.close(self.handle)
        shutil.rmtree(self.folder, ignore_errors=True)


def make_scratch() -> Scratch:
    """A new folder among the temporary files of this machine. Raises EngineError."""
    try:
        folder = tempfile.mkdtemp(prefix=PREFIX)
        # Locked before it has its name: until then nobody can take it for an abandoned one.
        new = f"{folder}/new"
        handle = os.open(new, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        why = error.strerror or error
        raise EngineError(f"there is no folder for temporary files ({why}). Set TMPDIR.") from error
    system_lock(handle)
    with contextlib.suppress(OSError):  # where files in use cannot be renamed, it is not marked
        Path(new).rename(f"{folder}/{MARK}")
    return Scratch(folder, handle)


def remove_abandoned() -> None:
    """Remove the folders of processes that are gone. Links are not followed, and folders of others stay.

    Raises OSError where there is no folder for temporary files at all.
    """
    for folder in _marked(tempfile.gettempdir()):
        with contextlib.suppress(OSError):
            handle = os.open(f"{folder}/{MARK}", os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
            try:
                gone = system_lock(handle) is True
            finally:
                os.close(handle)
            if gone:
                shutil.rmtree(folder, ignore_errors=True)


def _marked(where: str) -> Iterator[str]:
    with contextlib.suppress(OSError), os.scandir(where) as entries:
        for entry in entries:
            if (
                _NAME.fullmatch(entry.name)
                and entry.is_dir(follow_symlinks=False)
                and Path(entry.path, MARK).is_file()
            ):
                yield entry.path

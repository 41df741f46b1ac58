"""What a killed run left behind in the target: files that were never finished."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from aobake.files import is_unfinished

__all__ = ["remove_leftovers"]


def remove_leftovers(folder: Path) -> tuple[str, ...]:
    """Remove unfinished files below a folder, which must be locked; their sorted names, relative to it.

    Links are neither followed nor removed, and what cannot be read or removed stays. Empty where there is
    nothing of the kind, or no such folder.
    """
    removed = []
    for entry in _unfinished(folder):
        with contextlib.suppress(OSError):
            os.unlink(entry.path)
            removed.append(Path(entry.path).relative_to(folder).as_posix())
    return tuple(sorted(removed))


def _unfinished(folder: Path) -> Iterator[os.DirEntry[str]]:
    waiting = [os.fspath(folder)]
    while waiting:
        with contextlib.suppress(OSError), os.scandir(waiting.pop()) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    waiting.append(entry.path)
                elif entry.is_file(follow_symlinks=False) and is_unfinished(entry.name):
                    yield entry

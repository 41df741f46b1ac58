"""One process compiles a kernel, and the others that need it wait: a lock beside the file that is to come.

The system lets go of a lock when its process ends, however it ends. Where a folder knows no locks, everybody
compiles, as they would without.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from pathlib import Path
from typing import IO

__all__ = ["ENDING", "Claim", "claimed"]

ENDING = ".claim"
PATIENCE_S = 60.0  # more than any kernel takes on a busy machine
POLL_S = 0.02


class Claim:
    """The right to compile a kernel; give it back when its file is there, or is not needed."""

    def __init__(self, path: Path, lock: IO[bytes] | None) -> None:
        self._path, self._lock = path, lock

    def give_back(self) -> None:
        """Let others have it. Doing so twice does nothing."""
        if self._lock is not None:
            with contextlib.suppress(OSError):  # on Windows another process may have it open
                os.unlink(self._path)
            self._lock.close()
            self._lock = None


def claimed(path: Path, patience_s: float = PATIENCE_S) -> Claim:
    """Claim the making of a file; while another process has the claim, wait until it gives it back or ends.

    path : of the file to be made; the claim lies beside it, and the folder is made if needed
    After waiting, the file may be there. Where nothing can be locked, or waiting takes too long, the claim
    is one in name only.
    """
    place, last = path.with_suffix(ENDING), time.monotonic() + patience_s
    while True:
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            lock = place.open("ab")
        except OSError:
            return Claim(place, None)
        try:
            _lock(lock)
        except (BlockingIOError, PermissionError):
            lock.close()
        except OSError:
            lock.close()
            return Claim(place, None)
        else:
            return Claim(place, lock)
        if time.monotonic() > last:
            return Claim(place, None)
        time.sleep(POLL_S)


def _lock(stream: IO[bytes]) -> None:
    """Lock a file, or raise BlockingIOError or PermissionError at once where somebody else has it."""
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)

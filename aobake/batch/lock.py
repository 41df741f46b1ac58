"""One batch at a time in a target: a lock with the name of its owner in it.

Two things hold it. The lock of the operating system on the file goes with the process, however that ends, so
on one machine nothing is ever stale. Across machines some folders have no such lock, or one that the
others do not see: there the owner in the file counts, as long as it shows signs of life.
The file is never removed by a batch: two others could then each hold a lock on a file of that name.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import platform
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from aobake.errors import OutputError

__all__ = ["BEAT_S", "STALE_S", "Owner", "hold", "system_lock"]

BEAT_S = 20.0  # how often the owner shows that it lives, by the time of change of the file
STALE_S = 300.0  # an owner on another machine that showed nothing for so long is gone

MOST_BYTES = 65536  # of the owner
_NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP}


@dataclass(frozen=True, kw_only=True)
class Owner:
    """Who holds a lock.

    started : tells a process from a later one with the same number; '' where the system does not say
    command : for people     since : UTC, ISO 8601
    """

    process: int
    host: str
    started: str
    command: str
    since: str


@contextlib.contextmanager
def hold(path: Path, *, command: str) -> Iterator[Owner]:
    """Hold the lock in a file until the end of the block.

    command : what to tell others of this process, without secrets
    Raises OutputError, with nothing changed, where another process holds it or it cannot be written.
    """
    owner = Owner(
        process=os.getpid(),
        host=platform.node(),
        started=_started(os.getpid()),
        command=command,
        since=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
    except OSError as error:
        raise OutputError(f"{path}: it cannot be written ({error.strerror or error}).") from error
    try:
        _take(handle, path)
        _write(handle, json.dumps(asdict(owner)).encode())
        ended = threading.Event()
        beat = threading.Thread(
            target=_beat, args=(handle, path, owner, ended), daemon=True, name="lock"
        )
        beat.start()
        try:
            yield owner
        finally:
            ended.set()
            beat.join()
            if _owner(handle) == owner:
                _write(handle, b"")
    finally:
        os.close(handle)  # gives the lock of the system back


def _take(handle: int, path: Path) -> None:
    """Raise OutputError unless the lock is free or its owner is gone."""
    locked = system_lock(handle)
    owner = _owner(handle)
    if locked is False:
        raise OutputError(_refusal(path, owner, "Wait for it, or end it."))
    if owner is None:
        return
    if owner.host == platform.node():
        if locked is None and _lives(owner):
            raise OutputError(_refusal(path, owner, "Wait for it, or end it."))
    else:
        silent = time.time() - os.fstat(handle).st_mtime
        if silent < STALE_S:
            cure = (
                f"Its last sign of life is {max(silent, 0.0):.0f} s old: wait for it, or, if it is gone, "
                f"remove {path} (after {STALE_S:.0f} s it counts as gone)."
            )
            raise OutputError(_refusal(path, owner, cure))


def _refusal(path: Path, owner: Owner | None, cure: str) -> str:
    who = "another process"
    if owner is not None:
        command = owner.command if owner.command.isprintable() else ascii(owner.command)
        who = f"process {owner.process} on {owner.host} ({command}), since {owner.since}"
    return f"{path}: another batch is at work there: {who}. {cure}"


def _owner(handle: int) -> Owner | None:
    """The owner in the file; None where it is empty, half-written or of no known kind."""
    os.lseek(handle, 0, os.SEEK_SET)
    try:
        return Owner(**json.loads(os.read(handle, MOST_BYTES)))
    except (ValueError, TypeError):
        return None


def _write(handle: int, content: bytes) -> None:
    with contextlib.suppress(OSError):  # a full disk takes the name away, not the lock
        os.lseek(handle, 0, os.SEEK_SET)
        os.truncate(handle, 0)
        os.write(handle, content)
        os.fsync(handle)


def _beat(handle: int, path: Path, owner: Owner, ended: threading.Event) -> None:
    while not ended.wait(BEAT_S):
        if _owner(handle) == owner:  # not after a sleep so long that another machine took over
            with contextlib.suppress(OSError):
                os.utime(path)


if sys.platform == "win32":
    import msvcrt

    def system_lock(handle: int) -> bool | None:
        """Whether the lock of the system on an open file could be had; None where its folder has no locks."""
        os.lseek(handle, 1 << 30, os.SEEK_SET)  # beyond what is written: others read the owner
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            return None if error.errno in _NO_LOCKS else False
        return True

    def _runs(process: int) -> bool:  # noqa: ARG001 - as elsewhere
        """Whether there is such a process: not asked, for os.kill would end it."""
        return True
else:
    import fcntl

    def system_lock(handle: int) -> bool | None:
        """Whether the lock of the system on an open file could be had; None where its folder has no locks."""
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return None if error.errno in _NO_LOCKS else False
        return True

    def _runs(process: int) -> bool:
        """Whether there is such a process."""
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return False
        except OSError:  # it is somebody else's
            return True
        return True


def _lives(owner: Owner) -> bool:
    """Whether the process of an owner on this machine is still the same one."""
    started = _started(owner.process)
    if started or owner.started:
        return started == owner.started
    return _runs(owner.process)


def _started(process: int) -> str:
    """When a process was started, as Linux counts it from a start of the machine; '' elsewhere and for none."""
    try:
        stat = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip()
    except OSError:
        return ""
    return f"{boot}/{stat.rpartition(')')[2].split()[19]}"

"""Compiled kernels on disk, found again by what they were compiled from.

A kernel's file is named after a digest of all that its machine code depends on (content.py), the types of its
arguments, the processor, the versions of the compiler, and how it is used. So no code is ever stale; code is
found again after a new installation, a moved folder, or an upgrade that left the kernel alone; and processes that write
a file at the same moment write the same one.

numba's own cache lies beside the source and goes with it, takes a function for unchanged when only another
file's function that it calls has changed, and keeps an index for each function, which two processes that
write at the same moment overwrite for each other.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import importlib.util
import os
import pkgutil
import sys
import time
from collections.abc import Callable
from pathlib import Path

from aobake.errors import OutputError
from aobake.files import write_files
from aobake.tracing import claims
from aobake.tracing.claims import claimed
from aobake.tracing.content import content

__all__ = ["FOLDER_VARIABLE", "Kept", "folder", "problem"]

FOLDER_VARIABLE = "AOBAKE_CACHE_DIR"
ENDING = ".kernel"
# beside a kernel's own source
MAKING = ("arguments.py", "translate.py", "gathering.py", "machine.py")
DIGEST_BYTES = 32
MOST_BYTES = 64 << 20  # of all files: some 500 kernels; a bake of every kind needs about 60
DAY_S = 86400.0
UNFINISHED = (".part", claims.ENDING)
ABANDONED_S = 3600.0  # after which what is unfinished belongs to nobody

_PROBLEMS: list[str] = []  # why code could not be kept: the first reason of this process


def folder() -> Path | None:
    """Where compiled kernels are kept: AOBAKE_CACHE_DIR, or aobake's in the user's cache folder; None: nowhere."""
    chosen = os.environ.get(FOLDER_VARIABLE)
    if chosen:
        return Path(chosen)
    try:
        return _cache_folder() / "aobake" / "kernels"
    except RuntimeError:  # a user without a home
        return None


def _cache_folder() -> Path:
    """The user's folder for what can be made again, as the platform has it."""
    if sys.platform == "win32":
        local = os.environ.get("LOCALAPPDATA")
        return Path(local) if local else Path.home() / "AppData" / "Local"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    chosen = os.environ.get("XDG_CACHE_HOME", "")
    return Path(chosen) if Path(chosen).is_absolute() else Path.home() / ".cache"


def problem() -> str | None:
    """Why kernels that this process compiled could not be kept, in one line; None where they could."""
    return _PROBLEMS[0] if _PROBLEMS else None


class Kept:
    """The compiled forms of one kernel.

    Whatever goes wrong here costs a compilation, never a bake.
    """

    def __init__(self, function: Callable[..., object]) -> None:
        self._function = function

    def known(self) -> bool:
        """Whether the kernel, as it is now, is kept for arguments of some kinds."""
        place = folder()
        return place is not None and next(place.glob(f"{self._stem()}-*{ENDING}"), None) is not None

    def code(self, kinds: str, made: Callable[[], bytes]) -> bytes:
        """The code for arguments of some kinds: from disk, else as it is made now, and kept.

        While another process makes it, waits for that.
        """
        path = self._path(kinds)
        if path is None:
            _note("", "this user has no home")
            return made()
        found = _read(path)
        if found is None:
            claim = claimed(path)
            try:
                found = _read(path)
                if found is None:
                    found = made()
                    _write(path, found)
            finally:
                claim.give_back()
        return found

    def _stem(self) -> str:
        return f"{self._function.__name__}-{content(self._function)[:16]}"

    def _path(self, kinds: str) -> Path | None:
        """The file for arguments of some kinds; None where there is no place for any."""
        place = folder()
        told = (content(self._function), kinds, _compiler())
        rest = hashlib.sha256("\n".join(told).encode()).hexdigest()[:32]
        return None if place is None else place / f"{self._stem()}-{rest}{ENDING}"


def _read(path: Path) -> bytes | None:
    """What was compiled; None where it is not there, or damaged."""
    try:
        whole = path.read_bytes()
    except OSError:
        return None
    digest, code = whole[:DIGEST_BYTES], whole[DIGEST_BYTES:]
    if digest != hashlib.sha256(code).digest():
        return None
    _mark_used(path)
    return code


def _write(path: Path, code: bytes) -> None:
    """Keep what was compiled; where that fails, say so in problem()."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_files({path: hashlib.sha256(code).digest() + code})
        _make_room(path.parent)
    except (OSError, OutputError) as error:
        # On Windows a file cannot be replaced that another process made meanwhile, and has open.
        if not path.exists():
            reason = getattr(error.__cause__ or error, "strerror", None)
            _note(f" in {path.parent}", reason or "no permission")


@functools.cache
def _compiler() -> str:
    """What the same source may be compiled differently by: versions, the processor, how numba is used."""
    from aobake.tracing import machine

    python = importlib.util.MAGIC_NUMBER.hex()
    numba = importlib.metadata.version("numba")
    chosen = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_"))
    ours = (pkgutil.get_data(__package__, name) or b"" for name in MAKING)
    return repr((numba, python, machine.processor(), chosen, *map(_digest, ours)))


def _digest(text: bytes) -> str:
    return hashlib.sha256(text).hexdigest()


def _mark_used(path: Path) -> None:
    """Let a file that is used look young, once a day."""
    with contextlib.suppress(OSError):
        if time.time() - path.stat().st_mtime > DAY_S:
            os.utime(path)


@functools.cache
def _make_room(place: Path) -> None:
    """Remove the files that have not been used for the longest time where there are too many; once a process."""
    with contextlib.suppress(OSError):
        ours = [e for e in os.scandir(place) if e.name.endswith((ENDING, *UNFINISHED))]
        found = [(entry.stat(), entry.path) for entry in ours]
        total = 0
        for stat, path in sorted(found, key=lambda each: -each[0].st_mtime):
            total += stat.st_size
            abandoned = path.endswith(UNFINISHED) and time.time() - stat.st_mtime > ABANDONED_S
            if total > MOST_BYTES or abandoned:
                with contextlib.suppress(OSError):
                    os.unlink(path)


def _note(where: str, reason: str) -> None:
    _PROBLEMS.append(
        f"compiled code cannot be kept{where} ({reason}), so every run compiles anew. "
        f"Set {FOLDER_VARIABLE} to a folder that can be written."
    )

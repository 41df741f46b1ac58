"""Compiled kernels on disk, found again by what they were compiled from.

A kernel's file is named after a digest of all that its machine code depends on (content.py), the types of its
arguments, the processor, and the versions of the compiler. So no code is ever stale; code is found again
after a new installation, a moved folder, or an upgrade that left the kernel alone; and processes that write
a file at the same moment write the same one.

numba's own cache lies beside the source and goes with it, takes a function for unchanged when only another
file's function that it calls has changed, and keeps an index for each function, which two processes that
write at the same moment overwrite for each other.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.util
import os
import pickle
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba.core import compiler, serialize

from aobake.errors import OutputError
from aobake.files import write_files
from aobake.tracing import claims
from aobake.tracing.claims import Claim, claimed
from aobake.tracing.content import content

__all__ = ["FOLDER_VARIABLE", "Kept", "folder", "problem"]

FOLDER_VARIABLE = "AOBAKE_CACHE_DIR"
ENDING = ".kernel"
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
    """The compiled forms of one kernel: what numba asks of a cache.

    Whatever goes wrong here costs a compilation, never a bake.
    """

    def __init__(
        self,
        function: Callable[..., object],
        options: str,
        *,
        before_compiling: Callable[[], None] = lambda: None,
    ) -> None:
        """options : what else the code depends on; before_compiling : called where it is not on disk."""
        self._function, self._options = function, options
        self._before_compiling = before_compiling
        self._claims: dict[Path, Claim] = {}

    @property
    def cache_path(self) -> str | None:
        """The folder, for numba's statistics."""
        place = folder()
        return None if place is None else str(place)

    def known(self) -> bool:
        """Whether the kernel, as it is now, is kept for arguments of some types."""
        place = folder()
        return place is not None and next(place.glob(f"{self._stem()}-*{ENDING}"), None) is not None

    def load_overload(self, signature: object, target: Any) -> Any:
        """The compiled form for a signature; None where it has to be compiled, by this process.

        While another one compiles it, waits for that.
        """
        target.refresh()
        path = self._path(signature, target)
        found = None if path is None else self._found(path, target)
        if found is None:
            self._before_compiling()
        return found

    def _found(self, path: Path, target: Any) -> Any:
        """What is in a file, now or when another process has made it; else None, and the claim to make it."""
        found = _read(path, target)
        if found is None:
            claim = claimed(path)
            found = _read(path, target)
            if found is None:
                self._claims[path] = claim
            else:
                claim.give_back()
        return found

    def save_overload(self, signature: object, result: Any) -> None:
        """Keep what was compiled for a signature; where that fails, say so in problem()."""
        path = self._path(signature, result.target_context)
        if path is None:
            _note("", "this user has no home")
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_files({path: serialize.dumps(result._reduce())})  # noqa: SLF001
            _make_room(path.parent)
        except (OSError, OutputError) as error:
            # On Windows a file cannot be replaced that another process made meanwhile, and has open.
            if not path.exists():
                reason = getattr(error.__cause__ or error, "strerror", None)
                _note(f" in {path.parent}", reason or "no permission")
        if path in self._claims:
            self._claims.pop(path).give_back()

    def _stem(self) -> str:
        return f"{self._function.__name__}-{content(self._function)[:16]}"

    def _path(self, signature: object, target: Any) -> Path | None:
        """The file for a signature; None where there is no place for any."""
        place = folder()
        told = (content(self._function), self._options, repr(signature), _compiler(target))
        rest = hashlib.sha256("\n".join(told).encode()).hexdigest()[:32]
        return None if place is None else place / f"{self._stem()}-{rest}{ENDING}"


def _read(path: Path, target: Any) -> Any:
    """What was compiled; None where it is not there, cut short, or of another format."""
    try:
        payload = pickle.loads(path.read_bytes())  # noqa: S301 - of the user's own folder
        loaded = compiler.CompileResult._rebuild(target, *payload)  # noqa: SLF001
    except Exception:  # noqa: BLE001 - whatever it is: compiled anew
        return None
    _mark_used(path)
    return loaded


@functools.cache
def _compiler(target: Any) -> str:
    """What the same source may be compiled differently by: versions, the processor."""
    python = importlib.util.MAGIC_NUMBER.hex()
    return repr((numba.__version__, llvmlite.__version__, python, target.codegen().magic_tuple()))


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

"""Files in, whole; files out, whole or not at all."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from aobake.errors import InputError, OutputError

__all__ = [
    "PART",
    "UNFINISHED",
    "Content",
    "check_writable",
    "is_unfinished",
    "make_folder",
    "read_bytes",
    "same_file",
    "sha256",
    "write_files",
]

# How the names of all files begin that are not complete yet. They end in ".part", with eight characters before.
UNFINISHED = ".aobake-"
# The same of this process. It differs from one to the next, on one machine or several, so that what a killed one
# left can be told from its neighbours' work.
PART = f"{UNFINISHED}{os.urandom(4).hex()}-"
_UNFINISHED = re.compile(re.escape(UNFINISHED) + r"([0-9a-f]{8}-)?[0-9a-z_]{8}\.part")

Content = bytes | bytearray | memoryview | Iterable[bytes | bytearray | memoryview]


def read_bytes(path: Path, needed_by: str | None = None) -> bytes:
    """The bytes of a file; raises InputError, in one line, where it cannot be had.

    needed_by : the asset that refers to it, named first in the message.
    """
    who = f"{needed_by}: {path.name}" if needed_by else str(path)
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"{who}: this is not a regular file. Give the file itself.")  # noqa: TRY301 - one place
        return path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{who}: there is no such file. Check the path.") from error
    except InputError:  # a ValueError itself
        raise
    except OSError as error:
        raise InputError(f"{who}: it cannot be read ({error.strerror or error}).") from error
    except ValueError as error:  # a NUL byte in the path
        raise InputError(f"{who!r}: this is not a file name ({error}).") from error
    except MemoryError as error:
        raise InputError(f"{who}: it does not fit into memory.") from error


def sha256(path: Path) -> str:
    """Hexadecimal digest of a file's content, read in pieces."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def same_file(a: Path, b: Path) -> bool:
    """Whether two paths name one file, through links and spelling; False where either is missing."""
    try:
        return a.samefile(b)
    except OSError:
        return False


def is_unfinished(name: str) -> bool:
    """Whether this is the name, without folders, of a file of ours that is not complete, and of no other."""
    return _UNFINISHED.fullmatch(name) is not None


def make_folder(path: Path, needed_by: str | None = None) -> bool:
    """Make a folder, and those above it, unless it is there; whether it was made.

    needed_by : the file that goes there, named first in the message.
    Raises OutputError.
    """
    try:
        path.mkdir(parents=True)
    except OSError as error:
        if path.is_dir():
            return False
        who = f"{needed_by}: its folder {path}" if needed_by else f"{path}: this folder"
        raise OutputError(f"{who} cannot be made ({error.strerror or error}).") from error
    return True


def check_writable(path: Path) -> None:
    """Raise OutputError now where write_files(path) would fail for its folder: before a long bake, not after."""
    folder = path.parent
    if path.is_dir():
        raise OutputError(f"{path}: this is a folder. Give the name of the file to write.")
    if not folder.is_dir():
        raise OutputError(f"{path}: there is no folder {folder}. Make it, or write somewhere else.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(
            f"{path}: nothing can be written into the folder {folder}. Change its permissions."
        )


def write_files(files: Mapping[Path, Content], *, sync: bool = True) -> None:
    """Write several files so that each appears whole, the last one of the mapping last.

    All are written beside their targets under other names first and are moved into place only when
    every one of them is complete: whatever fails, no target is half-written and no stray file stays.
    Existing targets are replaced. A content in pieces is asked for one piece after the other, and may be
    made meanwhile.

    sync : whether to wait until the disk has them, milliseconds each; not for thousands that can be made again
    Raises OutputError.
    """
    staged: list[tuple[str, Path]] = []
    target: Path | None = None
    try:
        for target, content in files.items():
            check_writable(target)
            staged.append((_stage(target, content, sync), target))
        for temporary, target in staged:
            os.replace(temporary, target)
    except OSError as error:
        name = error.filename2 or target
        raise OutputError(f"{name}: it cannot be written ({error.strerror or error}).") from error
    finally:
        for temporary, _ in staged:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(temporary)


def _stage(target: Path, content: Content, sync: bool) -> str:
    pieces = [content] if isinstance(content, bytes | bytearray | memoryview) else content
    handle, name = tempfile.mkstemp(prefix=PART, suffix=".part", dir=target.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            for piece in pieces:
                stream.write(piece)
            stream.flush()
            if sync:
                os.fsync(stream.fileno())
        os.chmod(name, _mode(target))
    except BaseException:
        os.unlink(name)
        raise
    return name


def _mode(target: Path) -> int:
    """Permissions of the file that is replaced, or those of any new file."""
    try:
        return target.stat().st_mode & 0o777
    except OSError:
        mask = os.umask(0)
        os.umask(mask)
        return 0o666 & ~mask

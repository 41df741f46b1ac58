"""Where the assets of a batch are, and where their outputs go: a folder on this machine, or one behind fsspec."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from aobake import files
from aobake.errors import InputError, OutputError

__all__ = ["Found", "LocalFolder", "Place", "Stamp", "local_folder"]

LEADS_OUT = "this is a link that leads out of the folder. Copy what it stands for, or leave it out (--skip)."


@dataclass(frozen=True)
class Stamp:
    """What tells cheaply that a file is the same: its size, and its time of change or whatever stands for it."""

    size: int
    changed: str


@dataclass(frozen=True, kw_only=True)
class Found:
    """A file below a place, or a folder that cannot be read.

    name : relative to it, with forward slashes
    problem : why it cannot be read, in one line without the name; '' where it can
    folder : whether it is a folder
    """

    name: str
    stamp: Stamp
    problem: str = ""
    folder: bool = False


class Place(Protocol):
    """A folder with everything below it. Names are relative, with forward slashes."""

    @property
    def name(self) -> str:
        """As people gave it: a path or a URL."""

    @property
    def lists_all(self) -> bool:
        """Whether there is no file but those that `files` finds: no links, which may lead to one in two ways."""

    def files(self, enters: Callable[[str], bool]) -> Iterator[Found]:
        """All files, sorted by name; folders whose name `enters` refuses are left out, as are links that go in
        circles."""

    def stamp(self, name: str) -> Stamp | None:
        """The stamp of a file now; None where there is none."""

    def read(self, name: str, most: int) -> bytes:
        """A file, or its first `most` bytes where it is longer. Raises InputError."""

    def digest(self, name: str) -> str:
        """Hexadecimal SHA-256 of a file. Raises InputError."""

    def path(self, name: str) -> Path:
        """The path of a name on this machine; of a remote place, the relative path."""

    def copy(self, name: str, to: str) -> None:
        """Copy a file within the place, whole or not at all. Raises OutputError."""

    def remove(self, name: str) -> None:
        """Remove a file; nothing where there is none. Raises OutputError."""


@dataclass(frozen=True)
class LocalFolder:
    """A folder on this machine, or one that every machine of a cluster sees. folder : absolute."""

    name: str
    folder: Path

    @property
    def lists_all(self) -> bool:
        """False: a name may lead through links that `files` does not follow."""
        return False

    def files(self, enters: Callable[[str], bool]) -> Iterator[Found]:
        """All files, sorted by name. Raises InputError where the folder itself cannot be read.

        Links to files are followed where they stay inside the folder. So are links to folders, except those
        that go in circles, and those within a folder that was entered through a link already, or else a
        few of them that lead to each other would be a million folders.
        """
        if not self.folder.is_dir():
            missing = "this is no folder" if self.folder.exists() else "there is no such folder"
            raise InputError(f"{self.name}: {missing}. Give the folder that the assets are in.")
        found = sorted(_walk(str(self.folder), enters), key=lambda file: file.name)
        if found and found[0].name == "":
            raise InputError(f"{self.name}: {found[0].problem}")
        return iter(found)

    def stamp(self, name: str) -> Stamp | None:
        """The stamp of a file now; None where there is none."""
        try:
            return _stamp(self.path(name).stat())
        except (OSError, ValueError):  # a NUL byte
            return None

    def read(self, name: str, most: int) -> bytes:
        """A file, or its first `most` bytes where it is longer. Raises InputError."""
        try:
            with self.path(name).open("rb") as stream:
                return stream.read(most)
        except OSError as error:
            raise InputError(f"{self.path(name)}: {_cannot_be_read(error)}") from error

    def digest(self, name: str) -> str:
        """Hexadecimal SHA-256 of a file. Raises InputError."""
        try:
            return files.sha256(self.path(name))
        except OSError as error:
            raise InputError(f"{self.path(name)}: {_cannot_be_read(error)}") from error

    def path(self, name: str) -> Path:
        """The absolute path of a name."""
        return self.folder / name

    def copy(self, name: str, to: str) -> None:
        """Copy a file within the folder, whole or not at all. Raises OutputError."""
        target = self.path(to)
        files.make_folder(target.parent)
        files.write_files({target: _pieces(self.path(name))})

    def remove(self, name: str) -> None:
        """Remove a file; nothing where there is none. Raises OutputError."""
        try:
            self.path(name).unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"{self.path(name)}: it cannot be removed ({error.strerror or error})."
            ) from error


def local_folder(path: str | Path) -> LocalFolder:
    """A folder on this machine, which need not be there yet."""
    absolute = os.path.abspath(path)  # noqa: PTH100 - resolve() would follow links, and lose the name
    return LocalFolder(str(path), Path(absolute))


def _walk(top: str, enters: Callable[[str], bool]) -> Iterator[Found]:
    """Everything below a folder, in no order; the folder itself, with the name '', where it cannot be read."""
    inside = os.path.realpath(top)
    pending = [("", False)]  # a folder, and whether the way to it leads through a link
    while pending:
        folder, linked = pending.pop()
        try:
            with os.scandir(f"{top}/{folder}") as scan:
                entries = list(scan)
        except OSError as error:
            yield _trouble(folder, _cannot_be_read(error), folder=True)
            continue
        for entry in entries:
            name = f"{folder}/{entry.name}" if folder else entry.name
            is_link, is_folder = entry.is_symlink(), _is_folder(entry)
            if is_folder and not enters(name):
                continue
            real = os.path.realpath(entry.path) if is_link else ""
            if is_link and not _below(real, inside):
                yield _trouble(name, LEADS_OUT, folder=is_folder)
            elif not is_folder:
                yield _file(name, entry)
            elif not is_link:
                pending.append((name, linked))
            elif not linked and not _below(os.path.realpath(f"{top}/{folder}"), real):
                pending.append((name, True))


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link to itself
        return False


def _file(name: str, entry: os.DirEntry[str]) -> Found:
    try:
        status = entry.stat()
    except OSError as error:
        return _trouble(name, _cannot_be_read(error))
    if not stat.S_ISREG(status.st_mode):
        return _trouble(name, "this is not a regular file. Give the file itself.")
    if not os.access(entry.path, os.R_OK):
        return _trouble(name, "it cannot be read (Permission denied).")
    return Found(name=name, stamp=_stamp(status))


def _trouble(name: str, problem: str, *, folder: bool = False) -> Found:
    return Found(name=name, stamp=Stamp(0, ""), problem=problem, folder=folder)


def _stamp(status: os.stat_result) -> Stamp:
    """Both times, since programs that unpack or copy set the time of change back; no one can set the other."""
    return Stamp(status.st_size, f"{status.st_mtime_ns} {status.st_ctime_ns}")


def _below(path: str, folder: str) -> bool:
    return path == folder or path.startswith(folder.rstrip(os.sep) + os.sep)


def _cannot_be_read(error: OSError) -> str:
    return f"it cannot be read ({error.strerror or error})."


def _pieces(path: Path) -> Iterator[bytes]:
    with path.open("rb") as stream:
        while piece := stream.read(1 << 20):
            yield piece

"""Folders that are not on this machine, through fsspec: s3://, gs://, sftp:// and whatever else it knows.

aobake is given no keys and passes none on: each machine finds them in the settings that the store's own
tools use. So none can end up in a report, a manifest or a log.
"""

from __future__ import annotations

import contextlib
import hashlib
import posixpath
import secrets
import urllib.parse
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from aobake.batch.places import Found, Place, Stamp, local_folder
from aobake.errors import AobakeError, InputError, OutputError, SettingsError, nearest
from aobake.files import PART, is_unfinished

if TYPE_CHECKING:
    import fsspec

__all__ = ["RemoteFolder", "place_of"]

# What tells that an object has changed, in the words of the various stores, the best first.
MARKS = (
    "ETag", "etag", "md5Hash", "content_md5", "mtime", "LastModified", "last_modified", "updated",
    "modified", "created",
)  # fmt: skip
# Stores of objects: an upload shows nothing before it is complete, where elsewhere it gets its name afterwards.
OBJECT_STORES = {"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "oci", "oss", "memory"}
USUAL = ("az", "gs", "hdfs", "s3", "sftp", "smb", "webdav")  # that fsspec knows, of many more
PIECE = 1 << 20
CURE = "Check the address, and that this machine may use it (docs/cluster.md)."


def place_of(text: str) -> Place:
    """The folder that people mean by a path or a URL; a file:// URL is a path.

    Raises SettingsError for a URL that cannot be used, and whatever a local folder does.
    """
    if "://" not in text:
        return local_folder(Path(text))
    if text.startswith("file://"):
        return local_folder(Path(urllib.parse.unquote(urllib.parse.urlsplit(text).path)))
    return RemoteFolder(text)


class RemoteFolder:
    """A Place behind a URL.

    name : the URL, without a slash at the end; whoever holds it can open the folder again
    """

    def __init__(self, url: str, options: Mapping[str, object] | None = None) -> None:
        """Open nothing yet.

        options : for fsspec; they are shown nowhere
        Raises SettingsError for a URL that cannot be used.
        """
        _refuse(url)
        self.name = url.rstrip("/")
        self.options = dict(options or {})
        self._protocol = url.partition("://")[0]
        self._files, path = _opened(self.name, self.options)
        self._path = path.rstrip("/")

    @property
    def lists_all(self) -> bool:
        """Whether it is a store of objects, which has no links; sftp has."""
        return self._protocol in OBJECT_STORES

    @property
    def mirror(self) -> Path:
        """Where the folder lies in a tree of all stores: relative paths lead from one folder to another."""
        parts = [part for part in self._path.split("/") if part]
        return Path(self._protocol, *parts)

    def files(self, enters: Callable[[str], bool]) -> Iterator[Found]:
        """All files, sorted by name; folders whose name `enters` refuses are left out. Raises InputError."""
        with self._told("", InputError, "listed"):
            self._files.invalidate_cache()
            listed = self._files.find(self._path, detail=True)
        entered: dict[str, bool] = {"": True}

        def inside(folder: str) -> bool:
            if folder not in entered:
                entered[folder] = inside(posixpath.dirname(folder)) and enters(folder)
            return entered[folder]

        for path in sorted(listed):
            name = path.removeprefix(self._path).removeprefix("/")
            if name and not name.endswith("/") and inside(posixpath.dirname(name)):
                yield Found(name=name, stamp=_stamp(listed[path]), problem=_problem(name))

    def stamp(self, name: str) -> Stamp | None:
        """The stamp of a file now; None where there is none. Raises InputError."""
        with self._told(name, InputError, "looked at"):
            self._files.invalidate_cache()
            try:
                facts = self._files.info(self._full(name))
            except FileNotFoundError:
                return None
        return _stamp(facts) if facts.get("type") == "file" else None

    def read(self, name: str, most: int) -> bytes:
        """A file, or its first `most` bytes where it is longer. Raises InputError."""
        with (
            self._told(name, InputError, "read"),
            self._files.open(self._full(name), "rb") as stream,
        ):
            return bytes(stream.read(most))

    def digest(self, name: str) -> str:
        """Hexadecimal SHA-256 of a file. Raises InputError."""
        digest = hashlib.sha256()
        with (
            self._told(name, InputError, "read"),
            self._files.open(self._full(name), "rb") as stream,
        ):
            while piece := stream.read(PIECE):
                digest.update(piece)
        return digest.hexdigest()

    def path(self, name: str) -> Path:
        """The relative path of a name: there is none on this machine."""
        return Path(name)

    def copy(self, name: str, to: str) -> None:
        """Copy a file within the folder, whole or not at all. Raises OutputError."""
        with self._told(to, OutputError, "written"), self._whole(to) as target:
            self._files.cp_file(self._full(name), target)

    def remove(self, name: str) -> None:
        """Remove a file; nothing where there is none. Raises OutputError."""
        with (
            self._told(name, OutputError, "removed"),
            contextlib.suppress(FileNotFoundError),
        ):
            self._files.rm_file(self._full(name))

    def remove_leftovers(self) -> tuple[str, ...]:
        """Remove what a run that was killed had not finished writing; their names, sorted.

        Raises InputError, and OutputError where something stays.
        """
        names = [found.name for found in self.files(lambda _: True)]
        left = tuple(name for name in names if is_unfinished(posixpath.basename(name)))
        for name in left:
            self.remove(name)
        return left

    def fetch(self, name: str, to: Path) -> bool:
        """Bring a file to this machine; False where there is none. Raises InputError."""
        with self._told(name, InputError, "fetched"):
            try:
                to.parent.mkdir(parents=True, exist_ok=True)
                self._files.get_file(self._full(name), str(to))
            except FileNotFoundError:
                return False
        return to.is_file()

    def deliver(self, file: Path, name: str) -> None:
        """Put a file of this machine there, whole or not at all. Raises OutputError."""
        with self._told(name, OutputError, "written"), self._whole(name) as target:
            self._files.put_file(str(file), target)

    def shown(self, name: str) -> str:
        """The URL of a name, for people."""
        return f"{self.name}/{name}" if name else self.name

    def _full(self, name: str) -> str:
        if _problem(name):
            raise InputError(f"{self.shown(name)}: {_problem(name)}")
        return f"{self._path}/{name}"

    @contextlib.contextmanager
    def _whole(self, name: str) -> Iterator[str]:
        """The path to write to, so that nothing stands under a name before it is complete."""
        full = self._full(name)
        folder = posixpath.dirname(full)
        if self._protocol in OBJECT_STORES:
            yield full
            return
        self._files.makedirs(folder, exist_ok=True)
        part = f"{folder}/{PART}{secrets.token_hex(4)}.part"
        try:
            yield part
            self._files.mv(part, full)
        except BaseException:
            with contextlib.suppress(Exception):
                self._files.rm_file(part)
            raise

    @contextlib.contextmanager
    def _told(self, name: str, kind: type[AobakeError], done: str) -> Iterator[None]:
        """What a store raises, in one line of ours."""
        try:
            yield
        except AobakeError:
            raise
        except Exception as error:  # every store has exceptions of its own
            why = _without(_first_line(error), self.options)
            raise kind(f"{self.shown(name)}: it cannot be {done} ({why}). {CURE}") from error


def _refuse(url: str) -> None:
    """Raise SettingsError for a URL that gives away a secret, or is more than the address of a folder."""
    split = urllib.parse.urlsplit(url)
    if split.password is not None:
        hidden = url.replace(f":{split.password}@", ":...@")
        raise SettingsError(
            f"{hidden}: a password in a URL ends up in reports and logs. Leave it out, and put it where the "
            "store's own tools look for it (docs/cluster.md)."
        )
    if "::" in url or split.query or split.fragment:
        raise SettingsError(
            f"{url}: this is more than the address of a folder. Give PROTOCOL://BUCKET/FOLDER."
        )
    if any(part in {".", ".."} for part in split.path.split("/")):
        raise SettingsError(f"{url}: an address with . or .. in it. Write it out.")


def _opened(url: str, options: Mapping[str, object]) -> tuple[fsspec.AbstractFileSystem, str]:
    try:
        import fsspec
    except ImportError as error:
        raise SettingsError(
            f"{url}: folders that are not on this machine need the package fsspec, not installed here. "
            'Install the extra: pip install "aobake[cluster]".'
        ) from error
    protocol = url.partition("://")[0]
    if protocol not in fsspec.available_protocols():
        raise SettingsError(
            f"{url}: {protocol}:// is no kind of folder that is known.{nearest(protocol, USUAL)}"
        )
    try:
        files, path = fsspec.url_to_fs(url, **options)
    except ImportError as error:
        raise SettingsError(
            f"{url}: {protocol}:// needs a package that is not installed here ({_first_line(error)}). "
            "It is needed on every worker as well."
        ) from error
    except Exception as error:  # every store has exceptions of its own
        why = _without(_first_line(error), options)
        raise SettingsError(f"{url}: it cannot be opened ({why}). {CURE}") from error
    return files, str(path)


def _stamp(facts: Mapping[str, object]) -> Stamp:
    size = facts.get("size")
    mark = next((facts[key] for key in MARKS if facts.get(key) is not None), "")
    return Stamp(size=size if isinstance(size, int) else 0, changed=str(mark))


def _problem(name: str) -> str:
    """Why there can be no file of this name on a machine; '' where there can."""
    if any(part in {"", ".", ".."} for part in name.split("/")) or "\0" in name:
        return "its name cannot be that of a file in a folder. Give it another one."
    return ""


def _first_line(error: BaseException) -> str:
    text = str(error).strip().splitlines()
    return (text[0] if text else type(error).__name__)[:200]


def _without(text: str, options: Mapping[str, object]) -> str:
    """The text without any of the words that options hold."""
    for value in options.values():
        if isinstance(value, str) and value:
            text = text.replace(value, "...")
    return text

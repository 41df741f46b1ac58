"""What a URI in a glTF file stands for: bytes within it, or a file beside it. Nothing is ever fetched."""

from __future__ import annotations

import base64
import binascii
import os
import re
import urllib.parse
from dataclasses import dataclass
from pathlib import Path

from aobake.errors import InputError

__all__ = [
    "SideFile",
    "data_bytes",
    "data_uri",
    "find",
    "is_data",
    "names_host",
    "spellings",
]

# One letter and a colon is a drive of Windows, and so a path.
SCHEME = re.compile(r"^\s*(?:[A-Za-z][A-Za-z0-9+.-]+:|[/\\]{2})")


@dataclass(frozen=True)
class SideFile:
    """A file that a URI names.

    path : where it is, or would be
    relative : the same, seen from the folder of the asset
    inside : whether it lies in the folder of the asset, or in the root that was given
    below : whether it lies in the folder of the asset
    """

    path: Path
    relative: Path
    inside: bool
    below: bool

    @property
    def exists(self) -> bool:
        """Whether there is such a file."""
        return self.path.is_file()


def is_data(uri: str) -> bool:
    """Whether a URI holds its own bytes."""
    return uri[:5].lower() == "data:"


def names_host(uri: str) -> bool:
    """Whether a URI names a scheme or a host, so that its bytes lie elsewhere."""
    return SCHEME.match(uri) is not None and not is_data(uri)


def data_bytes(uri: str, where: str) -> bytes:
    """The bytes within a data URI. Raises InputError where they are broken."""
    head, comma, body = uri.partition(",")
    if not comma:
        raise InputError(f"{where}: its data URI has no comma, and so no data. Export it again.")
    if not head.lower().endswith(";base64"):
        return urllib.parse.unquote_to_bytes(body)
    if "%" in body:
        body = urllib.parse.unquote(body)
    if re.search(r"\s", body):
        body = re.sub(r"\s+", "", body)
    try:
        return base64.b64decode(body + "=" * (-len(body) % 4), validate=True)
    except (binascii.Error, ValueError) as error:
        raise InputError(
            f"{where}: its data URI is no base64 ({error}). Export it again."
        ) from error


def data_uri(pieces: bytes, kind: str = "application/octet-stream") -> str:
    """A data URI that holds these bytes."""
    return f"data:{kind};base64," + base64.b64encode(pieces).decode("ascii")


def spellings(uri: str) -> tuple[str, ...]:
    """The names that a relative URI may stand for, the likeliest first: percent-decoded, as it stands, and
    with backslashes read as slashes.
    """
    decoded = urllib.parse.unquote(uri)
    return tuple(dict.fromkeys((decoded, uri, decoded.replace("\\", "/"))))


def find(uri: str, folder: Path, root: Path | None) -> SideFile | None:
    """The file that a relative URI names, seen from the folder of the asset.

    root : a folder whose files are allowed as well
    Returns None where the text can name no file. Of its spellings the first that exists is taken, else
    the first.
    """
    first = None
    for name in spellings(uri):
        try:
            found = _side_file(name, folder, root)
            if found.exists:
                return found
        except (
            OSError,
            ValueError,
        ):  # a name that the system cannot hold: NUL, too long, a loop of links
            continue
        first = first or found
    return first


def _side_file(name: str, folder: Path, root: Path | None) -> SideFile:
    # a/../b is b, as for a browser, whether or not there is an a.
    relative = Path(os.path.normpath(name))
    home = folder.resolve()
    real = (home / relative).resolve()
    within = real.is_relative_to(home)
    below = within and not relative.is_absolute() and relative.parts[:1] != ("..",)
    inside = within or (root is not None and real.is_relative_to(root.resolve()))
    return SideFile(home / relative if below else real, relative, inside, below)

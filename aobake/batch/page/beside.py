"""The folder beside a page: viewers of the assets, the scripts that these share, and pictures that are too many.

report.html has report_files/. Names in it are digests, so that they say nothing and never clash.
"""

from __future__ import annotations

import functools
import hashlib
import re
from pathlib import Path
from urllib.parse import quote

from aobake.files import make_folder, write_files

__all__ = ["Beside", "files_beside", "keep_viewer"]

_OWN = re.compile(r"[0-9a-f]{32}\.(html|png)")


def files_beside(page: Path) -> Path:
    """The folder of a page."""
    return page.with_name(f"{page.stem}_files")


def keep_viewer(page: Path, target: str, viewer: bytes) -> None:
    """Keep the viewer of an asset for a page that is, or will be, written.

    target : the output of the asset, below the target folder; viewer : its page, which looks for its scripts
    in its own folder
    Raises OutputError.
    """
    beside = Beside(page)
    make_folder(beside.folder)
    for name, content in _scripts().items():
        if not _holds(beside.folder / name, len(content)):
            write_files({beside.folder / name: content})
    write_files({beside.folder / _viewer_name(target): viewer}, sync=False)


class Beside:
    """The folder beside a page, and what the page refers to in it so far."""

    def __init__(self, page: Path) -> None:
        """page : the HTML file, whether or not it is there yet"""
        self.folder = files_beside(page)
        self._used: set[str] = set()

    def viewer(self, target: str) -> str | None:
        """The address of the viewer of an asset, relative to the page; None where none was kept."""
        name = _viewer_name(target)
        return self._address(name) if (self.folder / name).is_file() else None

    def picture(self, png: bytes) -> str:
        """The address of a picture that is kept here from now on. Raises OutputError."""
        name = f"{hashlib.sha256(png).hexdigest()[:32]}.png"
        if not _holds(self.folder / name, len(png)):
            make_folder(self.folder)
            write_files({self.folder / name: png}, sync=False)
        return self._address(name)

    def tidy(self) -> None:
        """Remove viewers and pictures that the page does not refer to; what else lies here stays."""
        unused = _own(self.folder) - self._used
        for name in unused:
            (self.folder / name).unlink(missing_ok=True)

    def _address(self, name: str) -> str:
        self._used.add(name)
        return f"{quote(self.folder.name, errors='surrogateescape')}/{name}"


@functools.cache
def _scripts() -> dict[str, bytes]:
    # Heavy: to import it takes longer than a batch with nothing to do.
    from aobake.viewer.page import shared_scripts

    return shared_scripts()


def _viewer_name(target: str) -> str:
    digest = hashlib.sha256(target.encode("utf-8", "surrogateescape")).hexdigest()
    return f"{digest[:32]}.html"


def _own(folder: Path) -> set[str]:
    if not folder.is_dir():
        return set()
    return {path.name for path in folder.iterdir() if _OWN.fullmatch(path.name)}


def _holds(path: Path, size: int) -> bool:
    """Whether a file is there already; its name or its maker tells its content."""
    try:
        return path.stat().st_size == size
    except OSError:
        return False

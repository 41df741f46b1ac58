"""The files of a place as they are before a run: every stamp from one walk, every digest read once."""

from __future__ import annotations

from aobake.batch.places import Place, Stamp
from aobake.errors import InputError

__all__ = ["STATE", "Tree"]

STATE = ".aobake"
"""The folder in a target that holds what the batch itself keeps: never an asset, never an output."""


class Tree:
    """What a place holds. Files are read only when their digest is asked for.

    A walk instead of a stat for each file: a remote place lists 1,000 files in the time that one stat takes.
    """

    def __init__(self, place: Place) -> None:
        self._place = place
        self._digests: dict[str, str] = {}
        self._stamps: dict[str, Stamp] = {}
        self._unread: list[str] = []
        try:
            for found in place.files(lambda folder: folder.rpartition("/")[2] != STATE):
                if found.problem:
                    self._unread.append(found.name)
                else:
                    self._stamps[found.name] = found.stamp
        except InputError:  # no such folder: of a target, not yet
            self._unread.append("")

    def stamp(self, name: str) -> Stamp | None:
        """The stamp of a file when the walk came by; what it could miss is looked for now. None: not there."""
        seen = self.seen(name)
        whole = self._place.lists_all and not self._unread
        return seen if seen or whole else self._place.stamp(name)

    def seen(self, name: str) -> Stamp | None:
        """The stamp of a file when the walk came by; None where it met none."""
        return self._stamps.get(name)

    def digest(self, name: str) -> str:
        """Hexadecimal SHA-256 of a file, read once; '' where it cannot be read."""
        if name not in self._digests:
            try:
                self._digests[name] = self._place.digest(name)
            except InputError:  # the bake says so, better than a comparison can
                self._digests[name] = ""
        return self._digests[name]

    def gone(self, name: str) -> bool:
        """Whether a file is surely not there: what lies in a folder that cannot be read may well be."""
        hidden = any(
            unread in {"", name} or name.startswith(f"{unread}/") for unread in self._unread
        )
        return not hidden and self.stamp(name) is None

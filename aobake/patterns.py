"""Patterns of file names, as .editorconfig and .gitignore have them.

    *   any letters but /        ?   one letter        [ab]   one of these
    **  any folders, or none, where it stands between slashes

A pattern without a slash fits a name in any folder; one with a slash, also in front, fits the whole path;
one that ends with a slash fits everything below. Capital and small letters differ.
"""

from __future__ import annotations

import fnmatch
import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass

from aobake.errors import SettingsError

__all__ = ["Pattern", "pattern"]

ANY_FOLDERS = "**"
Segment = re.Pattern[str] | None  # None: any folders


@dataclass(frozen=True)
class Pattern:
    """A pattern that is ready to be compared. segments : what each part of a path must be; None is **."""

    words: str
    segments: tuple[Segment, ...]

    def fits(self, name: str) -> bool:
        """Whether a path, relative to the folder that the pattern is meant for, is one of these.

        name : with forward slashes, without one in front
        """
        return _fits(self.segments, name.split("/"))

    def takes(self, folder: str) -> bool:
        """Whether it fits a folder, or everything below it."""
        parts = folder.split("/")
        below = len(self.segments) > 1 and self.segments[-2:] == (None, _ANYTHING)
        return _fits(self.segments, parts) or (below and _fits(self.segments[:-1], parts))


@functools.lru_cache(maxsize=4096)
def pattern(words: str) -> Pattern:
    """Read a pattern. Raises SettingsError, a line that begins with the pattern, for what is none."""
    parts = words.split("/")
    if "\\" in words:
        _refuse(words, "has a backslash. Write / between folders.")
    if "{" in re.sub(r"\[[^]]*\]", "", words):
        _refuse(words, "has a brace, which stands for itself only as [{]. Write several patterns.")
    if any(part in {".", ".."} for part in parts):
        _refuse(words, "leaves its folder. Name what lies below it.")
    if not words.strip("/") or "" in parts[1:-1]:
        _refuse(words, "names nothing. Write one like props/**/*.glb.")
    if len(parts) == 1:
        parts = [ANY_FOLDERS, *parts]
    if parts[-1] == "":
        parts = [*([] if "/" in words[:-1] else [ANY_FOLDERS]), *parts[:-1], ANY_FOLDERS, "*"]
    parts = [part for part in parts if part]
    if parts[-1] == ANY_FOLDERS:
        parts.append("*")
    return Pattern(words, tuple(None if part == ANY_FOLDERS else _segment(part) for part in parts))


def _refuse(words: str, finding: str) -> None:
    raise SettingsError(f"{words!r} {finding}")


def _segment(words: str) -> re.Pattern[str]:
    return _ANYTHING if words == "*" else re.compile(fnmatch.translate(words))


def _fits(segments: Sequence[Segment], parts: Sequence[str]) -> bool:
    """Whether the parts of a path are what the segments say.

    It goes back to the last ** alone, which is enough, so that no pattern takes long (R. Cox, "Glob
    matching can be simple and fast too", 2017). fnmatch takes the same care for * within a part.
    """
    here = at = 0
    back: tuple[int, int] | None = (
        None  # to the segment after the last **, and the part it was tried at
    )
    while at < len(parts):
        segment = segments[here] if here < len(segments) else _NOTHING
        if segment is None:
            here += 1
            back = here, at
        elif segment.match(parts[at]):
            here, at = here + 1, at + 1
        elif back is None:
            return False
        else:
            here, at = back[0], back[1] + 1
            back = here, at
    return all(segment is None for segment in segments[here:])


_ANYTHING, _NOTHING = re.compile(""), re.compile(r"(?!)")

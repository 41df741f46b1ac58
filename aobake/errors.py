"""Everything that aobake raises on purpose.

    AobakeError
    ├── SettingsError      a setting or an argument that cannot be honoured   (exit status 2)
    ├── InputError         a file or an array that cannot be used             (exit status 1)
    ├── OutputError        a result that cannot be written                    (exit status 1)
    ├── EngineError        Embree is missing, or refused its work             (exit status 1)
    └── Cancelled          the caller asked to stop                           (exit status 130)

A message is one line: the file, the element, what was found, what is needed, and the cure.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = [
    "AobakeError",
    "Cancelled",
    "EngineError",
    "InputError",
    "OutputError",
    "SettingsError",
    "nearest",
]


class AobakeError(Exception):
    """The base of every error that aobake raises on purpose."""


class SettingsError(AobakeError, ValueError):
    """A setting or an argument that cannot be honoured."""


class InputError(AobakeError, ValueError):
    """A file or an array that cannot be used."""


class OutputError(AobakeError):
    """A result that cannot be written."""


class EngineError(AobakeError, RuntimeError):
    """Embree is missing, or refused its work."""


class Cancelled(AobakeError):
    """The caller asked to stop before the work was done."""


def nearest(wrong: object, known: Iterable[str]) -> str:
    """' Did you mean "x"?' where a known name is close to the wrong one, else ' Known: a, b, c.'."""
    names = sorted(known)
    close = difflib.get_close_matches(str(wrong), names, n=1)
    return f' Did you mean "{close[0]}"?' if close else f" Known: {', '.join(names)}."

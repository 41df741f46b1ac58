"""What a single setting may be: each check raises SettingsError, in words that begin with the setting's name."""

from __future__ import annotations

import math
from collections.abc import Collection

from aobake.errors import SettingsError, nearest

__all__ = [
    "check_between",
    "check_choice",
    "check_flag",
    "check_positive",
    "check_real",
    "check_whole",
    "check_words",
    "is_number",
]


def check_choice(name: str, value: object, known: Collection[str]) -> None:
    """Raise SettingsError for what is none of the known words; it names the nearest."""
    if value not in known:
        raise SettingsError(f"{name} is {value!r}.{nearest(value, known)}")


def check_flag(name: str, value: object) -> None:
    """Raise SettingsError for what is neither True nor False."""
    if not isinstance(value, bool):
        raise SettingsError(f"{name} is {value!r}; True or False is needed.")


def check_whole(name: str, value: object, least: int, most: int) -> None:
    """Raise SettingsError for what is no whole number from `least` to `most`; numpy's count as such."""
    if (
        isinstance(value, bool)
        or not hasattr(value, "__index__")
        or not least <= value.__index__() <= most
    ):
        raise SettingsError(
            f"{name} is {value!r}; a whole number from {least} to {most} is needed."
        )


def check_real(name: str, value: object) -> float:
    """A finite number as a float; raises SettingsError for anything else."""
    number = _real(value)
    if not math.isfinite(number):
        raise SettingsError(f"{name} is {value!r}; a finite number is needed.")
    return number


def check_positive(name: str, value: object) -> None:
    """Raise SettingsError for what is no finite number above 0."""
    if not check_real(name, value) > 0.0:
        raise SettingsError(f"{name} is {value!r}; a number above 0 is needed.")


def check_between(name: str, value: object, least: float, most: float) -> None:
    """Raise SettingsError for what is no number from `least` to `most`."""
    if not least <= _real(value) <= most:
        raise SettingsError(f"{name} is {value!r}; a number from {least:g} to {most:g} is needed.")


def check_words(name: str, given: object) -> tuple[str, ...]:
    """One word, or several in a list or a tuple, as a tuple; raises SettingsError for anything else."""
    several = [given] if isinstance(given, str) else given
    if not isinstance(several, list | tuple) or not all(isinstance(word, str) for word in several):
        raise SettingsError(f"{name} is {given!r}; words are needed.")
    return tuple(several)


def is_number(text: str) -> bool:
    """Whether a text spells a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _real(value: object) -> float:
    """A number as a float; NaN for what is none."""
    if isinstance(value, bool) or not hasattr(value, "__float__"):
        return math.nan
    return float(value)

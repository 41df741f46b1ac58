"""A JSON object of a glTF file, read with types: whatever is wrong becomes one InputError that names it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

from aobake.errors import InputError
from aobake.meshes.formats.gltf.jsontext import JsonObject

__all__ = ["Element"]

MOST = 2**53  # beyond it a JSON number is no whole number in most readers


@dataclass(frozen=True)
class Element:
    """A JSON object and where it stands ('chair.glb: accessor 3').

    Every method raises InputError for a value of another type, and for a missing one unless it says
    what is given instead.
    """

    value: JsonObject
    where: str

    def __contains__(self, key: object) -> bool:
        return key in self.value

    def integer(self, key: str, default: int | None = None, *, most: int = MOST) -> int:
        """A whole number from 0 to most; default where it is missing."""
        return _integer(self.value.get(key, default), most, key, self.where)

    def maybe_integer(self, key: str, *, most: int = MOST) -> int | None:
        """The same, or None where it is missing."""
        return self.integer(key, most=most) if key in self.value else None

    def index(self, key: str, size: int, kind: str) -> int:
        """A whole number that must be below size, the number of `kind` in the file."""
        found = self.integer(key)
        if found >= size:
            raise InputError(f"{self.where}: {key} is {found}, and the file has {size} {kind}.")
        return found

    def maybe_index(self, key: str, size: int, kind: str) -> int | None:
        """The same, or None where it is missing."""
        return self.index(key, size, kind) if key in self.value else None

    def indices(self, key: str, size: int, kind: str) -> list[int]:
        """A list of numbers below size; empty where it is missing."""
        values = self.list_of(key)
        for value in values:
            if _integer(value, MOST, key, self.where) >= size:
                raise InputError(
                    f"{self.where}: {key} names {value!r}, and the file has {size} {kind}."
                )
        return [int(cast(int, value)) for value in values]

    def number(self, key: str, default: float) -> float:
        """A finite number; default where it is missing."""
        return _number(self.value.get(key, default), key, self.where)

    def numbers(self, key: str, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """Finite numbers, as many as the default has; any number of them for None."""
        if key not in self.value and default is not None:
            return default
        values = self.list_of(key)
        if default is not None and len(values) != len(default):
            raise InputError(f"{self.where}: {key} has {len(values)} numbers, not {len(default)}.")
        return tuple(_number(value, key, self.where) for value in values)

    def text(self, key: str, default: str | None = None) -> str:
        """A string; default where it is missing."""
        found = self.value.get(key, default)
        if not isinstance(found, str):
            raise InputError(f"{self.where}: {key} is {_shown(found)}; a string is needed.")
        return found

    def flag(self, key: str) -> bool:
        """True or false; false where it is missing."""
        found = self.value.get(key, False)
        if not isinstance(found, bool):
            raise InputError(f"{self.where}: {key} is {_shown(found)}; true or false is needed.")
        return found

    def list_of(self, key: str) -> list[object]:
        """A list of anything; empty where it is missing."""
        found = self.value.get(key, [])
        if not isinstance(found, list):
            raise InputError(f"{self.where}: {key} is {_shown(found)}; a list is needed.")
        return found

    def child(self, key: str) -> Element | None:
        """An object; None where it is missing."""
        return self.needed(key) if key in self.value else None

    def needed(self, key: str) -> Element:
        """An object."""
        found = self.value.get(key)
        if not isinstance(found, dict):
            raise InputError(f"{self.where}: {key} is {_shown(found)}; an object is needed.")
        return Element(found, f"{self.where}, {key}")

    def children(self, key: str, kind: str) -> list[Element]:
        """Objects of a list, each named by kind and number; empty where it is missing."""
        found = []
        for number, value in enumerate(self.list_of(key)):
            if not isinstance(value, dict):
                raise InputError(
                    f"{self.where}: {kind} {number} is {_shown(value)}; an object is needed."
                )
            found.append(Element(value, f"{self.where} {kind} {number}"))
        return found

    def extension(self, name: str) -> Element | None:
        """The object of an extension; None where it is missing."""
        extensions = self.child("extensions")
        found = extensions.child(name) if extensions else None
        return Element(found.value, f"{self.where}, {name}") if found else None

    @property
    def name(self) -> str:
        """Its name, '' where it has none."""
        return self.text("name", "")

    @property
    def extras(self) -> JsonObject:
        """What applications have noted, by their keys; nothing where that is no object, which is allowed."""
        found = self.value.get("extras")
        return found if isinstance(found, dict) else {}


def _integer(value: object, most: int, key: str, where: str) -> int:
    if isinstance(value, float) and value.is_integer():
        value = int(value)  # 3.0 is how some exporters write 3
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        raise InputError(
            f"{where}: {key} is {_shown(value)}; a whole number from 0 to {most} is needed."
        )
    return value


def _number(value: object, key: str, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where}: {key} is {_shown(value)}; a number is needed.")
    try:
        found = float(value)
    except OverflowError:
        found = math.inf
    if not math.isfinite(found):
        raise InputError(f"{where}: {key} is {_shown(value)}; a finite number is needed.")
    return found


def _shown(value: object) -> str:
    if value is None:
        return "missing"
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else "a list"
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."

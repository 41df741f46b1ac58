"""The body of a PLY file as numbers at places: words of text, or bytes of either order.

A place counts words from the begin of the body, or bytes from the begin of the file.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.ply.header import Header, Property
from aobake.meshes.formats.tokens import IndexArray, floats, line_number, word_spans

__all__ = ["BinaryBody", "Body", "Numbers", "TextBody", "open_body", "size_of"]

Numbers = NDArray[np.generic]
CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}


class Body(Protocol):
    """What the layout of the rows is found with."""

    @property
    def begin(self) -> int:
        """The place of the first number."""

    @property
    def end(self) -> int:
        """One past the place of the last number."""

    def step(self, type_: str) -> int:
        """How many places a number of that type takes."""

    def counter(self, type_: str) -> Callable[[int], int]:
        """What gives the whole number at a place; -1 where it is none. The place must be before the end."""

    def grid(self, place: int, stride: int, rows: int, columns: int, type_: str) -> Numbers:
        """(rows, columns) numbers, the rows a stride apart."""

    def take(self, places: IndexArray, type_: str) -> Numbers:
        """The numbers at these places, in their shape."""


@dataclass(frozen=True, eq=False)
class BinaryBody:
    """Numbers of a byte order ("<" or ">") in the bytes of a whole file."""

    data: bytes
    order: str
    begin: int

    @property
    def end(self) -> int:
        """The size of the file."""
        return len(self.data)

    def step(self, type_: str) -> int:
        """Bytes of a number."""
        return int(type_[1])

    def counter(self, type_: str) -> Callable[[int], int]:
        """What gives the whole number at a place; the file must not end within it."""
        if type_ == "u1":  # nearly all lists, and three times as fast
            return self.data.__getitem__
        unpack = struct.Struct(self.order + CODES[type_]).unpack_from
        return lambda place: int(unpack(self.data, place)[0])

    def grid(self, place: int, stride: int, rows: int, columns: int, type_: str) -> Numbers:
        """(rows, columns) view into the file."""
        dtype = np.dtype(self.order + type_)
        if rows * columns == 0:
            return np.zeros((rows, columns), dtype)
        return np.ndarray((rows, columns), dtype, self.data, place, (stride, dtype.itemsize))

    def take(self, places: IndexArray, type_: str) -> Numbers:
        """The numbers at these places, in their shape."""
        dtype = np.dtype(self.order + type_)
        raw = np.frombuffer(self.data, np.uint8)[places[..., None] + np.arange(dtype.itemsize)]
        values: Numbers = raw.view(dtype)[..., 0]
        return values


@dataclass(frozen=True, eq=False)
class TextBody:
    """words : (W,) float64, every number of the text"""

    words: NDArray[np.float64]
    begin: int = 0

    @property
    def end(self) -> int:
        """How many words there are."""
        return len(self.words)

    def step(self, type_: str) -> int:  # noqa: ARG002
        """One word, whatever the type."""
        return 1

    def counter(self, type_: str) -> Callable[[int], int]:  # noqa: ARG002
        """What gives the whole number at a place; -1 where it is none."""
        item = self.words.item

        def whole(place: int) -> int:
            value = item(place)
            return int(value) if value.is_integer() else -1

        return whole

    def grid(self, place: int, stride: int, rows: int, columns: int, type_: str) -> Numbers:  # noqa: ARG002
        """(rows, columns) view into the words."""
        if rows * columns == 0:
            return np.zeros((rows, columns))
        step = self.words.itemsize
        return np.ndarray(
            (rows, columns), np.float64, self.words.data, place * step, (stride * step, step)
        )

    def take(self, places: IndexArray, type_: str) -> Numbers:  # noqa: ARG002
        """The numbers at these places, in their shape."""
        return self.words[places]


def open_body(data: bytes, header: Header, where: str) -> Body:
    """The numbers behind a header; raises InputError, with the line, for a word that is no number."""
    if header.encoding != "ascii":
        return BinaryBody(
            data, "<" if header.encoding == "binary_little_endian" else ">", header.size
        )
    text = np.frombuffer(data, np.uint8, offset=header.size)
    starts, ends = word_spans(text)
    words = floats(data[header.size :], len(starts))
    if words is not None:
        return TextBody(words)
    for start, end in zip(
        (starts + header.size).tolist(), (ends + header.size).tolist(), strict=True
    ):
        if floats(data[start:end], 1) is None:
            line = line_number(data, start)
            shown = data[start : min(end, start + 40)].decode("utf-8", "replace")
            raise InputError(
                f"{where}: line {line}: {shown!r} is no number. Export the file again."
            )
    raise InputError(f"{where}: its text cannot be read as numbers. Export the file again.")


def size_of(body: Body, prop: Property) -> int:
    """The fewest places that a property takes in a row."""
    return body.step(prop.count_type or prop.type)

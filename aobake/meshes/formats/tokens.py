"""Words in text, found and replaced by position: what the text formats are read and patched with."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["NEWLINE", "IndexArray", "floats", "integers", "line_number", "spliced", "word_spans"]

IndexArray = NDArray[np.int64]
NEWLINE = 10
Number = TypeVar("Number", np.float64, np.int64)
SPACE = 32  # it and everything below it parts words


def word_spans(text: NDArray[np.uint8]) -> tuple[IndexArray, IndexArray]:
    """Where the words of a text begin and end.

    text : (N,) uint8
    Returns (W,) starts and (W,) ends, one past the last byte of each; empty for a text without words.
    """
    inside = np.zeros(len(text) + 2, np.int8)
    inside[1:-1] = text > SPACE
    steps = np.diff(inside)
    return np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)


def floats(text: bytes, words: int) -> NDArray[np.float64] | None:
    """The numbers of a text that has this many words, (words,) float64; None where one is no number."""
    return _numbers(text, words, np.float64)


def integers(text: bytes, words: int) -> IndexArray | None:
    """The whole numbers of a text that has this many words, (words,) int64; None where one is none."""
    return _numbers(text, words, np.int64)


def _numbers(text: bytes, words: int, dtype: type[Number]) -> NDArray[Number] | None:
    if words == 0:
        return np.zeros(0, dtype)  # numpy makes a -1 of white space
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "error"
            )  # before numpy 2.3 a word that is no number is only warned of
            values: NDArray[Number] = np.fromstring(text, dtype, sep=" ")
    except (DeprecationWarning, ValueError, OverflowError):
        return None
    return values if len(values) == words else None  # "1-2" is two numbers to numpy


def line_number(text: bytes, position: int) -> int:
    """The number of the line, from 1, that holds a position; a CR alone ends lines where no LF does."""
    end = b"\n" if b"\n" in text else b"\r"
    return text.count(end, 0, position) + 1


def spliced(
    text: bytes, starts: Iterable[int], ends: Iterable[int], replacements: Iterable[bytes]
) -> bytes:
    """A text with the bytes from each start up to its end replaced; the spans ascend and do not overlap."""
    pieces = []
    kept = 0
    for start, end, replacement in zip(starts, ends, replacements, strict=True):
        pieces.append(text[kept:start])
        pieces.append(replacement)
        kept = end
    pieces.append(text[kept:])
    return b"".join(pieces)

"""What is wrong with an OBJ file, by line: the slow search after the fast reader has stopped."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.obj.statements import Block
from aobake.meshes.formats.tokens import IndexArray, line_number

__all__ = ["refuse_beyond_vertices", "refuse_corner", "refuse_few_numbers", "refuse_number"]

CORNER = re.compile(rb"[+-]?\d{1,18}(/([+-]?\d{1,18})?){0,2}")
CURE = "Mend the line, or export the file again."


def refuse_number(block: Block, statements: IndexArray, text: bytes, where: str) -> NoReturn:
    """Raise InputError for the first word of these statements that is no number."""
    _refuse_word(block, statements, text, where, _is_number, "is no number")


def refuse_corner(block: Block, statements: IndexArray, text: bytes, where: str) -> NoReturn:
    """Raise InputError for the first word of these statements that is no corner of a face."""
    _refuse_word(
        block,
        statements,
        text,
        where,
        _is_corner,
        "is no corner of a face (v, v/vt, v//vn, v/vt/vn)",
    )


def refuse_few_numbers(block: Block, statements: IndexArray, text: bytes, where: str) -> NoReturn:
    """Raise InputError for the first of these statements, which has fewer than three numbers."""
    line = line_number(text, int(block.starts[block.first[statements[0]]]) + block.offset)
    few = int(block.words[statements[0]]) - 1
    raise InputError(f"{where}: line {line} has {few} numbers; x, y and z are needed. {CURE}")


def refuse_beyond_vertices(
    beyond: NDArray[np.bool_],
    written: IndexArray,
    vertices: IndexArray,
    sizes: IndexArray,
    places: IndexArray,
    text: bytes,
    where: str,
) -> None:
    """Raise InputError for the first corner that is beyond the vertices; nothing where none is.

    beyond : (C,) which corners are     written : (C,) as in the file     vertices : (C,) there are so many
    sizes, places : (F,) corners and position of each face
    """
    if not beyond.any():
        return
    corner = int(np.argmax(beyond))
    face = int(np.searchsorted(np.cumsum(sizes), corner, side="right"))
    line = line_number(text, int(places[face]))
    raise InputError(
        f"{where}: line {line}: a face points at vertex {int(written[corner])}; there are "
        f"{int(vertices[corner])} (the first is 1, the last -1). {CURE}"
    )


def _refuse_word(
    block: Block,
    statements: IndexArray,
    text: bytes,
    where: str,
    holds: Callable[[bytes], bool],
    finding: str,
) -> NoReturn:
    raw = block.text.tobytes()
    for first, words in zip(
        block.first[statements].tolist(), block.words[statements].tolist(), strict=True
    ):
        for index in range(first + 1, first + words):
            start = int(block.starts[index])
            word = raw[start : int(block.ends[index])]
            if not holds(word):
                line = line_number(text, start + block.offset)
                shown = word[:40].decode("utf-8", "replace")
                raise InputError(f"{where}: line {line}: {shown!r} {finding}. {CURE}")
    line = line_number(text, int(block.starts[block.first[statements[0]]]) + block.offset)
    raise InputError(f"{where}: a line from line {line} on cannot be read as numbers. {CURE}")


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word


def _is_corner(word: bytes) -> bool:
    return CORNER.fullmatch(word) is not None

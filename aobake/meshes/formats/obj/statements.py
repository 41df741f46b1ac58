"""The text of an OBJ file as statements: words by line, found for many lines at once.

Everything is found by position in the file as it lies on disk, so that it can be patched there.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.tokens import NEWLINE, SPACE, IndexArray, line_number, word_spans

__all__ = ["UTF8_MARK", "Block", "arguments", "blocks"]

BLOCK_BYTES = (
    1 << 24
)  # bounds the memory of the word tables to about 300 MB, whatever the size of the file
MOST_LINE_BYTES = 1 << 25  # a polygon of two million corners
UTF8_MARK = b"\xef\xbb\xbf"
CONTINUED = re.compile(rb"\\ ?\n")


@dataclass(frozen=True, eq=False)
class Block:
    """Some whole lines.

    offset : position of the block in the file
    text : (N,) uint8, comments and line ends as white space
    starts, ends : (W,) spans of its words
    first : (S,) index of the first word of each statement, a line that is not empty
    words : (S,) words of each statement, the first one included
    line_ends : (S,) position of the end of each statement's line
    """

    offset: int
    text: NDArray[np.uint8]
    starts: IndexArray
    ends: IndexArray
    first: IndexArray
    words: IndexArray
    line_ends: IndexArray

    def keyword(self, keyword: bytes) -> NDArray[np.bool_]:
        """(S,) whether a statement begins with this word."""
        begin = self.starts[self.first]
        found: NDArray[np.bool_] = self.ends[self.first] - begin == len(keyword)
        for place, letter in enumerate(keyword):
            # A word at the very end has no second letter; its length has ruled it out already.
            found &= self.text[np.minimum(begin + place, len(self.text) - 1)] == letter
        return found


def blocks(text: bytes, where: str) -> Iterator[Block]:
    """The statements of a file, in blocks of whole lines; nothing for an empty file.

    where : the file, for messages. Raises InputError for a line that is too long to be one.
    """
    plain = _plain(text)
    begin = 0
    while begin < len(plain):
        end = plain.find(b"\n", begin + BLOCK_BYTES) + 1 or len(plain)
        if end - begin > BLOCK_BYTES + MOST_LINE_BYTES:
            line = line_number(text, end - 1)
            raise InputError(
                f"{where}: line {line} is longer than {MOST_LINE_BYTES} bytes, which no statement is. "
                "Export the file again."
            )
        yield _block(begin, np.frombuffer(plain, np.uint8, end - begin, begin))
        begin = end


def arguments(block: Block, statements: IndexArray) -> bytes:
    """The text after the first word of each of these statements, with white space between them."""
    if not len(statements):
        return b""
    heads = block.first[statements]
    begin, end = int(block.starts[heads[0]]), int(block.line_ends[statements[-1]])
    if int(statements[-1] - statements[0]) == len(statements) - 1:
        # Side by side, as nearly always: blanking the first words takes half the time of a mask.
        taken = block.text[begin:end].copy()
        taken[block.starts[heads] - begin] = SPACE
        taken[block.ends[heads] - 1 - begin] = SPACE
        return bytes(taken.data)
    inside = np.zeros(len(block.text) + 1, np.int8)
    inside[block.ends[heads]] += 1
    inside[block.line_ends[statements]] -= 1
    inside = np.cumsum(inside, dtype=np.int8)
    return bytes(block.text[inside[:-1].astype(bool)].data)


def _plain(text: bytes) -> bytes:
    """The text, byte for byte in place, with LF line ends alone and continued lines joined."""
    if text.startswith(UTF8_MARK):
        text = b"   " + text[3:]
    if b"\r" in text:
        text = text.replace(b"\r\n", b" \n").replace(b"\r", b"\n")
    return _joined(text) if CONTINUED.search(text) else text


def _joined(text: bytes) -> bytes:
    joined = bytearray(text)
    for mark in CONTINUED.finditer(text):
        line = joined.rfind(b"\n", 0, mark.start()) + 1
        # A comment may end in a path with a backslash, and must not swallow the next vertex.
        if not joined[line : mark.start()].lstrip().startswith(b"#"):
            joined[mark.start() : mark.end()] = b" " * (mark.end() - mark.start())
    return bytes(joined)


def _block(offset: int, text: NDArray[np.uint8]) -> Block:
    newlines = np.flatnonzero(text == NEWLINE)
    if not len(newlines) or newlines[-1] != len(text) - 1:
        newlines = np.append(newlines, len(text))
    text = _without_comments(text, newlines)
    starts, ends = word_spans(text)
    line_starts = np.concatenate([[0], newlines[:-1] + 1])
    first = np.searchsorted(starts, line_starts)
    words = np.diff(np.append(first, len(starts)))
    used = words > 0
    return Block(offset, text, starts, ends, first[used], words[used], newlines[used])


def _without_comments(text: NDArray[np.uint8], newlines: IndexArray) -> NDArray[np.uint8]:
    marks = np.flatnonzero(text == ord("#"))
    if not len(marks):
        return text
    lines, earliest = np.unique(np.searchsorted(newlines, marks), return_index=True)
    inside = np.zeros(len(text) + 1, np.int8)
    inside[marks[earliest]] = 1
    inside[newlines[lines]] = -1
    return np.where(np.cumsum(inside, dtype=np.int8)[:-1] > 0, np.uint8(SPACE), text)

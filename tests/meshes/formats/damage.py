"""Files with a few bytes changed, cut, doubled and moved: read, or refused in one line."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from aobake import InputError


def damaged(
    seed: bytes, random: np.random.Generator, changes: int, words: Sequence[bytes] = ()
) -> bytes:
    """A copy with up to so many changes. words : what is put in as well"""
    found = bytearray(seed)
    for _ in range(int(random.integers(1, changes + 1))):
        at, to = sorted(random.integers(0, len(found) + 1, 2).tolist())
        match int(random.integers(0, 4)):
            case 0:
                del found[at : min(to, at + 9)]
            case 1:
                found[at:at] = found[at:to][:20]
            case 2 if words:
                found[at:at] = words[int(random.integers(len(words)))]
            case _:
                found[at : at + 1] = bytes([int(random.integers(0, 256))])
    return bytes(found)


def read_or_refused(files: Sequence[bytes], read: Callable[[bytes], object]) -> int:
    """How many of the files are read; the others are refused in one line, and nothing else is raised."""
    refusals: list[str] = []
    for file in files:
        try:
            read(file)
        except InputError as error:
            refusals.append(str(error))
    assert not [line for line in refusals if "\n" in line]
    return len(files) - len(refusals)

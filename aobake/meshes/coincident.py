"""Rows that are equal: vertices at one place, or points that would be baked twice."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import inlined, kernel

__all__ = ["empty_table", "first_equal_row"]

MINUS_ZERO = np.uint64(1 << 63)


def first_equal_row(
    *columns: NDArray[np.float64] | NDArray[np.uint32],
) -> NDArray[np.int32]:
    """(N,) int32: for each row the number of the first row that equals it in all columns.

    columns : one or two (N, K) arrays of float64 or uint32; 0.0 equals -0.0, a NaN the same NaN
    A table of hashes, in one pass: np.unique sorts the rows, which takes 30 times as long.
    """
    count = len(columns[0])
    first = np.arange(count, dtype=np.int32)
    if count:
        _group(_as_bits(columns[0]), _as_bits(columns[-1]), empty_table(count), first)
    return first


def empty_table(count: int) -> NDArray[np.int32]:
    """Room to find numbers below `count`, at least 1, by hashes: -1, a power of two of them, at least 2 count."""
    return np.full(1 << (2 * count - 1).bit_length(), -1, np.int32)


def _as_bits(column: NDArray[np.float64] | NDArray[np.uint32]) -> NDArray[Any]:
    array: NDArray[Any] = np.ascontiguousarray(column)
    return array if array.dtype == np.uint32 else array.view(np.uint64)


@inlined
def _bits(value):
    """The bits of a number; those of 0.0 for -0.0."""
    wide = np.uint64(value)
    return np.uint64(0) if wide == MINUS_ZERO else wide


@kernel
def _group(a, b, table, first):
    """Fill first (N,); table : a power of two, at least 2 N, of -1.

    One form for words of 32 bits, which -0.0 + 0.0 allows, would save half a second of the first run of all;
    it took up to twice as long for vertices.
    """
    size = len(table)
    for row in range(len(first)):
        h = np.uint64(0x9E3779B97F4A7C15)
        for values in (a, b):
            for k in range(values.shape[1]):
                h = (h ^ _bits(values[row, k])) * np.uint64(0xFF51AFD7ED558CCD)
                h ^= h >> np.uint64(32)
        slot = np.int64(h & np.uint64(size - 1))
        while table[slot] >= 0 and not _equal(a, b, row, table[slot]):
            slot = (slot + 1) & (size - 1)
        if table[slot] < 0:
            table[slot] = row
        first[row] = table[slot]


@inlined
def _equal(a, b, row, other):
    """Whether two rows are the same in both arrays."""
    for k in range(a.shape[1]):
        if _bits(a[row, k]) != _bits(a[other, k]):
            return False
    for k in range(b.shape[1]):  # noqa: SIM110 - compiled
        if _bits(b[row, k]) != _bits(b[other, k]):
            return False
    return True

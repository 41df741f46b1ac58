"""How many pixels of an image, out of a set of them, lie in boxes: also in boxes that go on beyond the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.scene import FloatArray, Wrap

__all__ = ["BoxesOfPixels", "marked_share", "pixels_around"]

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BoxesOfPixels:
    """low, high : (N, 2) int64, the column and the row where boxes begin, and where they have ended."""

    low: IntArray
    high: IntArray


def pixels_around(places: FloatArray, slack: float, *, nearest: bool) -> BoxesOfPixels:
    """The pixels that lookups anywhere on some faces touch.

    places : (N, 3, 2) float64, column and row at the corners of each face, in pixels from the image's edges
    slack : how far off these may be, in pixels; nearest : whether only the pixel below a place is looked at
    """
    reach = slack if nearest else 0.5 + slack
    low, high = places.min(axis=1), places.max(axis=1)
    return BoxesOfPixels(
        np.floor(low - reach).astype(np.int64), np.floor(high + reach).astype(np.int64) + 1
    )


def marked_share(
    marks: NDArray[np.bool_], boxes: BoxesOfPixels, wrap: tuple[Wrap, Wrap]
) -> FloatArray:
    """(N,) float64, which share of the pixels in each box is marked; exactly 0 for none, and 1 for all.

    marks : (H, W), not empty; wrap : what lies outside of it, along its columns and its rows
    Source: F. Crow, Summed-area tables for texture mapping, 1984.
    """
    x = (boxes.low[:, 0], boxes.high[:, 0])
    y = (boxes.low[:, 1], boxes.high[:, 1])
    marks, x = _endless(marks, x, wrap[0], 1)
    marks, y = _endless(marks, y, wrap[1], 0)
    table = np.zeros((marks.shape[0] + 1, marks.shape[1] + 1), np.uint32)
    np.cumsum(marks, axis=0, dtype=np.uint32, out=table[1:, 1:])
    np.cumsum(table[1:, 1:], axis=1, out=table[1:, 1:])
    found = (
        _below(table, x[1], y[1])
        - _below(table, x[0], y[1])
        - _below(table, x[1], y[0])
        + _below(table, x[0], y[0])
    )
    return np.asarray(found / ((x[1] - x[0]) * (y[1] - y[0])).astype(np.float64))


def _endless(
    marks: NDArray[np.bool_], ends: tuple[IntArray, IntArray], wrap: Wrap, axis: int
) -> tuple[NDArray[np.bool_], tuple[IntArray, IntArray]]:
    """The same question for an image that is repeated along an axis."""
    if wrap == "repeat":
        return marks, ends
    if wrap == "mirror":
        return np.concatenate([marks, np.flip(marks, axis)], axis=axis), ends
    low = np.clip(ends[0], 0, marks.shape[axis] - 1)
    return marks, (low, np.maximum(np.clip(ends[1], 0, marks.shape[axis]), low + 1))


def _below(table: NDArray[np.uint32], x: IntArray, y: IntArray) -> IntArray:
    """(N,) int64, marked pixels of the endless pattern from (0, 0) to (x, y), of which both may be negative.

    table : (H + 1, W + 1), those of one period
    """
    height, width = table.shape[0] - 1, table.shape[1] - 1
    whole_x, x = np.divmod(x, width)
    whole_y, y = np.divmod(y, height)
    columns, rows = table[height].astype(np.int64), table[:, width].astype(np.int64)
    return np.asarray(
        table[y, x] + whole_y * columns[x] + whole_x * rows[y] + whole_x * whole_y * columns[width]
    )

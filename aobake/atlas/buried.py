"""Texels inside of something: where bodies pass through each other, or stand on one another.

Nobody sees such a texel, but a bilinear lookup beside it does read it, and draws a black outline around
the body. So those that lie next to a lit texel of their chart take the mean of such neighbours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["lit_rims"]

Float32Array = NDArray[np.float32]

AROUND = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if (row, column) != (0, 0)]
BEYOND_NOISE = 4.0  # standard errors: a gradient into the dark stays what it is


def lit_rims(values: Float32Array, error: Float32Array, chart: NDArray[np.int32]) -> Float32Array:
    """A page on which no texel that is wholly dark lies next to a lit one of its chart.

    values, error : (H, W) float32 in [0, 1], and their standard errors; chart : (H, W) int32, -1: none
    Returns (H, W) float32; only texels that are exactly 0 have changed.
    """
    height, width = chart.shape
    row, column = np.nonzero((chart >= 0) & (values == 0.0))
    total, count = np.zeros(len(row)), np.zeros(len(row))
    for down, right in AROUND:
        r, c = row + down, column + right
        inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
        r, c = np.clip(r, 0, height - 1), np.clip(c, 0, width - 1)
        lit = inside & (chart[r, c] == chart[row, column]) & (values[r, c] > 0.0)
        total += np.where(lit, values[r, c], 0.0)
        count += lit
    mean = total / np.maximum(count, 1.0)
    chosen = mean > BEYOND_NOISE * error[row, column]
    result = values.copy()
    result[row[chosen], column[chosen]] = mean[chosen]
    return result

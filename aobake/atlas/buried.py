"""Texels inside of something: where bodies pass through each other, or stand on one another.

Nobody sees such a texel, but a bilinear lookup beside it does read it, and draws a black outline around
the body. So those that lie next to lit texels of their chart take what these lead to: each is continued by the
step to it from the texel behind it. Where something stands on a floor that leads to about the same again; into
a dark corner, which few rays cannot tell from the inside of a body, it leads to 0.

What was measured, as root mean square errors of bilinear lookups on 30,000 places of a surface, at 192 x 192
texels of 64 rays: of all that see anything, and in brackets weighed by how open they are, as they are seen:

                                          demo hall          a house            a figure
    as traced                             0.0654 (0.0595)    0.0872 (0.0747)    0.0466 (0.0447)
    what lit neighbours lead to           0.0661 (0.0556)    0.0780 (0.0572)    0.0331 (0.0301)    this one
    of those with a lit one behind them   0.0688 (0.0561)    0.0796 (0.0552)    0.0329 (0.0295)
    their mean                            0.0859 (0.0567)    0.0795 (0.0526)    0.0346 (0.0303)
    their mean, of three at least         0.0831 (0.0570)    0.0799 (0.0560)    not measured
    the darkest of them                   0.0761 (0.0568)    0.0770 (0.0555)    not measured

The third and those below it light dark corners of the hall the more, the fewer the rays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["lit_rims"]

Float32Array = NDArray[np.float32]

AROUND = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if (row, column) != (0, 0)]
BEYOND_NOISE = 4.0  # standard errors: a gradient into the dark stays what it is


def lit_rims(values: Float32Array, error: Float32Array, chart: NDArray[np.int32]) -> Float32Array:
    """A page on which no texel that is wholly dark lies next to ones of its chart that lead to light.

    values, error : (H, W) float32 in [0, 1], and their standard errors; chart : (H, W) int32, -1: none
    Returns (H, W) float32; only texels that are exactly 0 have changed.
    """
    row, column = np.nonzero((chart >= 0) & (values == 0.0))
    own = chart[row, column]
    total, lit = np.zeros(len(row)), np.zeros(len(row))
    for down, right in AROUND:
        near, behind = (
            _of_chart(values, chart, own, row + steps * down, column + steps * right)
            for steps in (1, 2)
        )
        onwards = np.clip(2.0 * near - behind, 0.0, near)
        total += np.where(behind > 0.0, onwards, 0.0)
        lit += near > 0.0
    mean = total / np.maximum(lit, 1.0)
    chosen = mean > BEYOND_NOISE * error[row, column]
    result = values.copy()
    result[row[chosen], column[chosen]] = mean[chosen]
    return result


def _of_chart(
    values: Float32Array,
    chart: NDArray[np.int32],
    own: NDArray[np.int32],
    row: NDArray[np.int64],
    column: NDArray[np.int64],
) -> Float32Array:
    """Values at places of a page; 0 where another chart is than the own, or none, or no page."""
    height, width = chart.shape
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    row, column = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
    return np.where(inside & (chart[row, column] == own), values[row, column], np.float32(0.0))

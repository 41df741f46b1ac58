"""Which charts lie over themselves.

Tried on the 53 charts of a scan, 69,168 triangles: a grid of half a cell for each triangle instead of two 0.95
of the processor seconds, of eight 1.51. The kernel takes 0.5 % of a texture of 1,024 at 16 rays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.arena import give_back, reserved, taken, zeros
from aobake.tracing.compiled import inlined, kernel

__all__ = ["arena_for", "note_overlaps"]

MOST_CELLS = 32  # that a triangle is entered in, on average; a coarser grid else


def arena_for(most: int) -> NDArray[np.uint8]:
    """Memory to look at charts of at most so many triangles, one after the other."""
    cells = (int((2.0 * most) ** 0.5) + 1) ** 2
    return reserved(16 * (cells + 1) + 4 * MOST_CELLS * most, 3)


@inlined
def _apart(uv, one, other, least):
    """Whether an edge of one triangle has the other beyond it, but for `least`. Triangles turn left."""
    for k in range(3):
        x, y = uv[one, k, 0], uv[one, k, 1]
        dx, dy = uv[one, (k + 1) % 3, 0] - x, uv[one, (k + 1) % 3, 1] - y
        size = np.sqrt(dx * dx + dy * dy)
        inmost = -np.inf
        for n in range(3):
            inmost = max(inmost, dx * (uv[other, n, 1] - y) - dy * (uv[other, n, 0] - x))
        if inmost <= least * size:
            return True
    return False


@inlined
def _cells(uv, f, low_u, low_v, size, cells):
    """First and last column and row of the cells that a triangle's box touches."""
    u0, u1 = min(uv[f, 0, 0], uv[f, 1, 0], uv[f, 2, 0]), max(uv[f, 0, 0], uv[f, 1, 0], uv[f, 2, 0])
    v0, v1 = min(uv[f, 0, 1], uv[f, 1, 1], uv[f, 2, 1]), max(uv[f, 0, 1], uv[f, 1, 1], uv[f, 2, 1])
    last = cells - 1
    return (
        min(int((u0 - low_u) / size * cells), last),
        min(int((u1 - low_u) / size * cells), last),
        min(int((v0 - low_v) / size * cells), last),
        min(int((v1 - low_v) / size * cells), last),
    )


@inlined
def _overlaps(arena, uv, chosen, tolerance):  # noqa: C901, PLR0912 - a grid is filled and looked up at once
    """Whether any two of the chosen triangles overlap by more than a share of the whole."""
    low_u = low_v = np.inf
    high_u = high_v = -np.inf
    for f in chosen:
        for k in range(3):
            low_u, high_u = min(low_u, uv[f, k, 0]), max(high_u, uv[f, k, 0])
            low_v, high_v = min(low_v, uv[f, k, 1]), max(high_v, uv[f, k, 1])
    size = max(high_u - low_u, high_v - low_v)
    if not size > 0.0:
        return False
    cells, entries = int(np.sqrt(2.0 * len(chosen))) + 1, np.int64(0)
    while True:
        mark, entries = taken(arena), np.int64(0)
        start = zeros(arena, cells * cells + 1, np.int64)
        for f in chosen:
            c0, c1, r0, r1 = _cells(uv, f, low_u, low_v, size, cells)
            entries += (c1 - c0 + 1) * (r1 - r0 + 1)
            for r in range(r0, r1 + 1):
                for c in range(c0, c1 + 1):
                    start[r * cells + c + 1] += 1
        if entries <= MOST_CELLS * len(chosen) or cells == 1:
            break
        give_back(arena, mark)
        cells = (cells + 1) // 2
    for n in range(cells * cells):
        start[n + 1] += start[n]
    filled, entry = zeros(arena, cells * cells, np.int64), zeros(arena, entries, np.int32)
    for n in range(cells * cells):
        filled[n] = start[n]
    for f in chosen:
        c0, c1, r0, r1 = _cells(uv, f, low_u, low_v, size, cells)
        for r in range(r0, r1 + 1):
            for c in range(c0, c1 + 1):
                n = r * cells + c
                for k in range(start[n], filled[n]):
                    other = entry[k]
                    if not _apart(uv, f, other, tolerance * size) and not _apart(
                        uv, other, f, tolerance * size
                    ):
                        return True
                entry[filled[n]] = f
                filled[n] += 1
    return False


@kernel
def note_overlaps(arena, uv, order, starts, tolerance, found):
    """Fill found (charts,) bool: whether two triangles of a chart overlap.

    uv : (F, 3, 2) float64, triangles that turn left; thinner ones than `tolerance` overlap nothing
    order, starts : the faces of chart c are order[starts[c] : starts[c + 1]]
    tolerance : share of the chart's size by which triangles may overlap
    """
    for c in range(len(found)):
        mark = taken(arena)
        found[c] = _overlaps(arena, uv, order[starts[c] : starts[c + 1]], tolerance)
        give_back(arena, mark)

"""Packing of charts by their outlines: each goes to the first place, from the top, where it fits.

The page is a grid of cells, in which every row knows, for every column, where the next occupied and the
next free cell are. A row of a chart that does not fit so says at once how far it has to move, and a whole
row of places is passed in a few jumps.

Approaches tried on place_charts, 53 charts of a scan on a page of 1,024 at three scales, of which one fits, as
processor seconds beside it as it is, with the same places: without each row's longest gap 1.04; without it and
with the spans from the top, instead of the longest one first, 1.08; without beginning at the span that met
something 1.03; jumps of 32 bits instead of 16 1.15; each chart looked for from the top of the page 2.17. Two
turns instead of four take 0.69 and put charts elsewhere; left, since how full pages get so is not measured.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.arena import give_back, reserved, taken, zeros
from aobake.tracing.compiled import inlined, kernel

__all__ = ["hull_arena", "page_arena", "place_charts", "set_upright"]

TOUCH = 1e-7  # cells: a triangle that ends on a line between two cells does not enter the second
TURNS = 4
ALIKE = (
    0.9  # charts of at least this share of a size are not looked for a place above each other again
)


def hull_arena(most: int) -> NDArray[np.uint8]:
    """Memory for set_upright, for charts of at most so many points."""
    return reserved(16 * (2 * most + 1), 1)


def page_arena(page: tuple[int, int, int]) -> NDArray[np.uint8]:
    """Memory for place_charts on such a page: five bytes a cell for it, and twelve for a chart of its size."""
    width = page[0] + 2 * page[1] + 1
    return reserved(17 * width * width + 64, 16)


@inlined
def _surround(points, hull):
    """Fill in the corners of the convex hull of two or more points in ascending order; how many they are.

    Source: A. Andrew, 1979.
    """
    count = 0
    for way in range(2):
        least = count + 1
        for n in range(len(points)):
            k = n if way == 0 else len(points) - 1 - n
            x, y = points[k, 0], points[k, 1]
            while count > least and (hull[count - 1, 0] - hull[count - 2, 0]) * (
                y - hull[count - 2, 1]
            ) <= (hull[count - 1, 1] - hull[count - 2, 1]) * (x - hull[count - 2, 0]):
                count -= 1
            hull[count, 0], hull[count, 1] = x, y
            count += 1
        count -= 1
    return count


@kernel
def set_upright(arena, points, starts, extent):
    """Turn each chart into its tightest box, in place, the box at the origin; fill extent (charts, 2).

    points : (P, 2) float64; those of chart c are points[starts[c] : starts[c + 1]],
        in ascending order of u, then v
    One side of the box of least area lies on the convex hull (H. Freeman, R. Shapira, 1975).
    """
    for c in range(len(extent)):
        own = points[starts[c] : starts[c + 1]]
        mark = taken(arena)
        hull = zeros(arena, (2 * len(own) + 1, 2), np.float64)
        corners, best, cos, sin = _surround(own, hull), np.inf, 1.0, 0.0
        for n in range(corners):
            m = n + 1 if n + 1 < corners else 0
            x, y = hull[m, 0] - hull[n, 0], hull[m, 1] - hull[n, 1]
            size = np.sqrt(x * x + y * y)
            if not size > 0.0:
                continue
            x, y = x / size, y / size
            low_u, high_u, low_v, high_v = np.inf, -np.inf, np.inf, -np.inf
            for k in range(corners):
                u, v = x * hull[k, 0] + y * hull[k, 1], x * hull[k, 1] - y * hull[k, 0]
                low_u, high_u, low_v, high_v = (
                    min(low_u, u),
                    max(high_u, u),
                    min(low_v, v),
                    max(high_v, v),
                )
            area = (high_u - low_u) * (high_v - low_v)
            if area < best * (1.0 - 1e-9):
                best, cos, sin = area, x, y
        low_u = low_v = np.inf
        high_u = high_v = -np.inf
        for k in range(len(own)):
            u, v = cos * own[k, 0] + sin * own[k, 1], cos * own[k, 1] - sin * own[k, 0]
            own[k, 0], own[k, 1] = u, v
            low_u, high_u, low_v, high_v = (
                min(low_u, u),
                max(high_u, u),
                min(low_v, v),
                max(high_v, v),
            )
        for k in range(len(own)):
            own[k, 0] -= low_u
            own[k, 1] -= low_v
        extent[c, 0], extent[c, 1] = high_u - low_u, high_v - low_v
        give_back(arena, mark)


@inlined
def _touched(arena, points, triangles, scale, shift_x, shift_y, mask):
    """Set the cells of mask (h, w) that triangles touch; points are scaled and shifted to cells."""
    h, w = mask.shape
    x, y = zeros(arena, 3, np.float64), zeros(arena, 3, np.float64)
    for t in range(len(triangles)):
        low_y, high_y = np.inf, -np.inf
        for k in range(3):
            x[k] = points[triangles[t, k], 0] * scale + shift_x
            y[k] = points[triangles[t, k], 1] * scale + shift_y
            low_y, high_y = min(low_y, y[k]), max(high_y, y[k])
        first = max(int(np.floor(low_y + TOUCH)), 0)
        last = min(int(np.floor(high_y - TOUCH)), h - 1)
        for r in range(min(first, h - 1), max(last, min(first, h - 1)) + 1):
            low, high = np.inf, -np.inf
            for k in range(3):
                m = k + 1 if k < 2 else 0
                xa, ya, xb, yb = x[k], y[k], x[m], y[m]
                if ya > yb:
                    xa, ya, xb, yb = xb, yb, xa, ya
                if yb < r or ya > r + 1:
                    continue
                slope = (xb - xa) / (yb - ya) if yb > ya else 0.0
                one = xa + slope * (r - ya) if ya < r else xa
                two = xb + slope * (r + 1 - yb) if yb > r + 1 else xb
                low, high = min(low, one, two), max(high, one, two)
            begin = min(max(int(np.floor(low + TOUCH)), 0), w - 1)
            end = min(max(int(np.floor(high - TOUCH)), begin), w - 1)
            for c in range(begin, end + 1):
                mask[r, c] = True


@inlined
def _turn(mask, turn, new):
    """Fill in the mask after quarter turns that take (x, y) to (-y, x)."""
    h, w = mask.shape
    for r in range(h):
        for c in range(w):
            row, column = r, c
            if turn == 1:
                row, column = c, h - 1 - r
            elif turn == 2:
                row, column = h - 1 - r, w - 1 - c
            elif turn == 3:
                row, column = w - 1 - c, r
            new[row, column] = mask[r, c]


@inlined
def _widen(arena, mask, by, grown):
    """Fill in, in zeros (h + 2 by, w + 2 by), the mask (h, w) grown by some cells to all sides."""
    h, w = mask.shape
    wide = zeros(arena, (h, w + 2 * by), np.bool_)
    for r in range(h):
        last = -1  # column up to which the row is set
        for c in range(w):
            if mask[r, c]:
                for n in range(max(c, last + 1), c + 2 * by + 1):
                    wide[r, n] = True
                last = c + 2 * by
    left = zeros(arena, w + 2 * by, np.int32)  # rows for which a column stays set
    for r in range(h + 2 * by):
        for c in range(w + 2 * by):
            if r < h and wide[r, c]:
                left[c] = 2 * by + 1
            if left[c] > 0:
                grown[r, c] = True
                left[c] -= 1


@inlined
def _spans(arena, mask):
    """((S, 3) int32 runs of set cells: row, first column, column after the last, the longest one first; how many)."""
    h, w = mask.shape
    spans, count, longest = zeros(arena, (h * (w + 1) // 2 + 1, 3), np.int32), 0, 0
    for r in range(h):
        c = 0
        while c < w:
            if mask[r, c]:
                spans[count, 0], spans[count, 1] = r, c
                while c < w and mask[r, c]:
                    c += 1
                spans[count, 2] = c
                if c - spans[count, 1] > spans[longest, 2] - spans[longest, 1]:
                    longest = count
                count += 1
            else:
                c += 1
    for k in range(3):
        spans[0, k], spans[longest, k] = spans[longest, k], spans[0, k]
    return spans, count


@inlined
def _first_place(spans, count, occupied, free, roomiest, first, first_y, last_x, last_y):
    """The first (y, x) from row first_y on at which no span meets an occupied cell; y = -1: there is none."""
    wide = spans[0, 2] - spans[0, 1]
    for y in range(first_y, last_y + 1):
        if roomiest[y + spans[0, 0]] < wide:
            continue
        x, hint, n = first, 0, 0
        while x <= last_x and n < count:
            s = (hint + n) % count
            begin = x + spans[s, 1]
            row = y + spans[s, 0]
            met = occupied[row, begin]
            if met < x + spans[s, 2]:
                x, hint, n = free[row, met] - spans[s, 1], s, 0
            else:
                n += 1
        if x <= last_x:
            return y, x
    return -1, -1


@inlined
def _occupy(mask, y, x, full, occupied, free, roomiest):
    """Enter a mask, and bring the rows' jumps up to date; how many cells it covers."""
    h, w = mask.shape
    covered = 0
    width = full.shape[1]
    for r in range(h):
        row = y + r
        for c in range(w):
            full[row, x + c] |= mask[r, c]
            covered += mask[r, c]
        for c in range(min(x + w, width) - 1, -1, -1):
            occupied[row, c] = c if full[row, c] else occupied[row, c + 1]
            free[row, c] = free[row, c + 1] if full[row, c] else c
        longest, c = 0, 0
        while c < width:
            c = free[row, c]
            end = occupied[row, c]
            longest, c = max(longest, end - c), end
        roomiest[row] = longest
    return covered


@kernel
def place_charts(arena, points, triangles, starts, extent, sequence, scale, page, places):
    """Place charts one after the other; False when one does not fit.

    points, triangles : (P, 2) float64 of upright charts, (T, 3) int32 corners
    starts : the triangles of chart c are triangles[starts[c] : starts[c + 1]]
    sequence : the charts, in the order in which they are placed
    scale : cells per unit
    page : cells along each side, cells between two charts, cells to the border
    places : (charts, 3) int32, filled with the column and row of the first cell, and the quarter turns
    Returns how many cells are covered; -1: a chart did not fit.
    """
    side, padding, border = page
    width = side + 2 * padding
    full = zeros(arena, (width, width), np.bool_)
    occupied = zeros(arena, (width, width + 1), np.int16)
    free = zeros(arena, (width, width + 1), np.int16)
    roomiest, covered = zeros(arena, width, np.int16), 0
    for r in range(width):
        roomiest[r] = width
        for c in range(width + 1):
            occupied[r, c], free[r, c] = width, c
    like, first_y = np.inf, border
    for chart in sequence:
        w = max(int(np.ceil(extent[chart, 0] * scale - TOUCH)), 1)
        h = max(int(np.ceil(extent[chart, 1] * scale - TOUCH)), 1)
        if max(w, h) > side - 2 * border:
            return -1
        mark = taken(arena)
        upright = zeros(arena, (h, w), np.bool_)
        _touched(
            arena, points, triangles[starts[chart] : starts[chart + 1]], scale,
            0.5 * (w - extent[chart, 0] * scale), 0.5 * (h - extent[chart, 1] * scale), upright,
        )  # fmt: skip
        if w + h < ALIKE * like:
            like, first_y = w + h, border
        lowest, turn, at_y, at_x = width + 1, -1, 0, 0
        for t in range(TURNS if max(w, h) > 1 else 1):
            before = taken(arena)
            mask = zeros(arena, (h, w) if t % 2 == 0 else (w, h), np.bool_)
            _turn(upright, t, mask)
            wide = zeros(
                arena, (mask.shape[0] + 2 * padding, mask.shape[1] + 2 * padding), np.bool_
            )
            _widen(arena, mask, padding, wide)
            spans, count = _spans(arena, wide)
            last_y = min(side - border, lowest - 1) - mask.shape[0]
            y, x = _first_place(
                spans, count, occupied, free, roomiest,
                border, first_y, side - border - mask.shape[1], last_y,
            )  # fmt: skip
            if y >= 0:
                lowest, turn, at_y, at_x = y + mask.shape[0], t, y, x
            give_back(arena, before)
        if turn < 0:
            return -1
        first_y = max(first_y, at_y - max(w, h) // 2)
        mask = zeros(arena, (h, w) if turn % 2 == 0 else (w, h), np.bool_)
        _turn(upright, turn, mask)
        covered += _occupy(
            mask, at_y + padding, at_x + padding, full, occupied, free, roomiest,
        )  # fmt: skip
        give_back(arena, mark)
        places[chart, 0], places[chart, 1], places[chart, 2] = at_x, at_y, turn
    return covered

"""Which triangles of a plane lie on others: halved again and again until few are left to compare.

A grid would be simpler, but layouts may hold most of their triangles in a thousandth of their area, or
all of them in one place.
"""

from __future__ import annotations

import numpy as np

from aobake.tracing.compiled import inlined, kernel

__all__ = ["DEEPEST", "ROOM", "find_partners"]

FEW = 24  # triangles of a box that are compared with each other
DEEPEST = 200  # halvings in a row
ROOM = 8  # for the lists of a row of halvings; a box whose halves have no room is compared as it is
WORTH_IT = 0.8  # of the pairs of a box may be left in its halves; many triangles can lie in both


@kernel
def find_partners(corners, boxes, depths, deep, listed, stack, partner):
    """Note for each triangle the first one found that it lies on, in partner (N,) int32, -1 at first.

    corners, boxes : (N, 6) float64, x and y of three corners; (N, 4), least x and y and greatest x and y
    depths : (N,) float64, the depth of overlap that counts for each triangle, if below `deep`
    deep : the depth that counts for both triangles
    listed : int32, the triangles to compare, and room for ROOM times as many behind them
    stack : (DEEPEST, 2) int64, begin and end of the first list in row 0
    The depth is by how much one of the two would have to be moved, so shared edges and corners have none.
    What has a partner is not compared any more, so that thousands in one place take no square of that.
    """
    level = 0
    while level >= 0:
        begin, end = stack[level, 0], stack[level, 1]
        low, high, size = 0, 0, end - begin
        if size > FEW and level + 2 < DEEPEST and end + 2 * size <= len(listed):
            low, high = _halve(boxes, listed, begin, end)
        if low == 0 or low * low + high * high > WORTH_IT * size * size:
            _compare(corners, boxes, depths, deep, listed, begin, end, partner)
            level -= 1
        else:
            stack[level, 0], stack[level, 1] = end, end + low
            stack[level + 1, 0], stack[level + 1, 1] = end + low, end + low + high
            level += 1


@inlined
def _halve(boxes, listed, begin, end):
    """List behind `end` the triangles on either side of the middle of a list; how many there are of each.

    The middle is that of the triangles, not of their box, along the axis on which they spread the most.
    """
    sum_x, sum_y, square_x, square_y = 0.0, 0.0, 0.0, 0.0
    for i in range(begin, end):
        f = listed[i]
        x, y = boxes[f, 0] + boxes[f, 2], boxes[f, 1] + boxes[f, 3]
        sum_x, sum_y = sum_x + x, sum_y + y
        square_x, square_y = square_x + x * x, square_y + y * y
    n = end - begin
    across = square_y - sum_y * sum_y / n > square_x - sum_x * sum_x / n
    axis, middle = (1, 0.5 * sum_y / n) if across else (0, 0.5 * sum_x / n)
    low, high = 0, 0
    for i in range(begin, end):
        if boxes[listed[i], axis] <= middle:
            listed[end + low] = listed[i]
            low += 1
    for i in range(begin, end):
        if boxes[listed[i], axis + 2] >= middle:
            listed[end + low + high] = listed[i]
            high += 1
    return low, high


@inlined
def _compare(corners, boxes, depths, deep, listed, begin, end, partner):
    """Compare each triangle of a list that has no partner with the others, until it has one."""
    for i in range(begin, end):
        one, at = listed[i], begin
        while partner[one] < 0 and at < end:
            other = listed[at]
            compared = at < i and partner[other] < 0  # it looked at all of them
            if at != i and not compared and _boxes_meet(boxes, one, other):
                depth = _depth(corners, one, other)
                if depth > min(deep, depths[one]):
                    partner[one] = other
                if depth > min(deep, depths[other]) and partner[other] < 0:
                    partner[other] = one
            at += 1


@inlined
def _boxes_meet(boxes, one, other):
    return (
        boxes[one, 0] < boxes[other, 2]
        and boxes[other, 0] < boxes[one, 2]
        and boxes[one, 1] < boxes[other, 3]
        and boxes[other, 1] < boxes[one, 3]
    )


@inlined
def _depth(corners, one, other):
    """By how much two triangles lie on each other: the least shift that parts them; not positive: they do not.

    Convex polygons that are apart are apart along the normal of an edge of one of them, and the least
    shift is along such a normal. Source: S. Gottschalk, M. Lin, D. Manocha, OBBTree, 1996.
    """
    depth = np.inf
    for turn in range(6):
        of = one if turn < 3 else other
        a, b = 2 * (turn % 3), 2 * ((turn + 1) % 3)
        x, y = corners[of, a], corners[of, a + 1]
        across, up = y - corners[of, b + 1], corners[of, b] - x
        low, high, other_low, other_high = np.inf, -np.inf, np.inf, -np.inf
        for k in range(3):
            p = (corners[one, 2 * k] - x) * across + (corners[one, 2 * k + 1] - y) * up
            q = (corners[other, 2 * k] - x) * across + (corners[other, 2 * k + 1] - y) * up
            low, high = min(low, p), max(high, p)
            other_low, other_high = min(other_low, q), max(other_high, q)
        shift = min(high - other_low, other_high - low)
        if shift <= 0.0:
            return 0.0
        depth = min(depth, shift / np.sqrt(across * across + up * up))
    return depth

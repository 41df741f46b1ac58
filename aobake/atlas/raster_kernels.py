"""Which triangle each sample of a page is nearest to, and which point of it.

Within the kernels, coordinates are in samples, with the centres of samples at whole numbers.

Tried on cover, 69,168 triangles of a scan on a page of 1,024 in four parts, twice: every triangle compared
where one covers a sample already 1.55, with the same result; the columns of a triangle's box in every row 0.87,
but it lets in triangles that the square around a sample does not meet. locate is not 1 % of any bake measured:
written plainly.
"""

from __future__ import annotations

import numpy as np

from aobake.tracing.compiled import inlined, kernel

__all__ = ["TOUCHING", "cover", "locate"]

TOUCHING = 1e-6  # samples; rounding is 1e-11 at the most, so that no seam of a chart is missed
INWARD = 1.0 / 64.0  # of the way to the middle of its triangle, a clamped point leaves the edge,
INWARD_MOST = 1.0 / 16.0  # but by no more than this, in samples


@kernel
def cover(corners, scale, first_row, reach, nearest, face):
    """Note the nearest triangle at each sample that one comes near to.

    corners : (N, 6) float64, x and y of three corners, finite, in texels from the page's corner
    scale : samples per texel, along each axis
    first_row : the page's row that row 0 of the two arrays below is
    reach : a sample is touched where a square of this half width around it meets the triangle
    nearest : (R, W) float64, squared distances so far; lowered
    face : (R, W) int32, which triangle; the lowest number of those that are equally near
    """
    rows, width = nearest.shape
    for f in range(len(corners)):
        t = _triangle(corners, f, scale)
        low = max(min(t[1], t[3], t[5]) - reach, float(first_row))
        high = min(max(t[1], t[3], t[5]) + reach, float(first_row + rows - 1))
        for y in range(int(np.ceil(low)), int(np.floor(high)) + 1):
            left, right = _span(t, y - reach, y + reach)
            start = int(np.ceil(max(left - reach, 0.0)))
            stop = int(np.floor(min(right + reach, width - 1.0))) + 1
            for x in range(start, stop):
                if nearest[y - first_row, x] > 0.0:
                    distance = _nearest(t, x, y)[0]
                    if distance < nearest[y - first_row, x]:
                        nearest[y - first_row, x] = distance
                        face[y - first_row, x] = f


@kernel
def locate(corners, face, x, y, weights, inside):
    """Fill weights (T, 2) of corners 1 and 2 at the point of triangle face[i] that is nearest to (x, y)[i],
    and inside (T,), whether that is the place itself. A point that is not is kept off the edge."""
    for i in range(len(face)):
        t = _triangle(corners, face[i], 1)
        distance, b, c = _nearest(t, x[i], y[i])
        inside[i] = distance == 0.0
        if distance > 0.0:
            from_x = t[0] + b * (t[2] - t[0]) + c * (t[4] - t[0]) - (t[0] + t[2] + t[4]) / 3.0
            from_y = t[1] + b * (t[3] - t[1]) + c * (t[5] - t[1]) - (t[1] + t[3] + t[5]) / 3.0
            way = np.sqrt(from_x * from_x + from_y * from_y)
            share = min(INWARD, INWARD_MOST / max(way, INWARD_MOST))
            b += share * (1.0 / 3.0 - b)
            c += share * (1.0 / 3.0 - c)
        weights[i, 0], weights[i, 1] = b, c


@inlined
def _triangle(corners, f, scale):
    """The six coordinates of a triangle, in registers."""
    return (
        scale * corners[f, 0] - 0.5,
        scale * corners[f, 1] - 0.5,
        scale * corners[f, 2] - 0.5,
        scale * corners[f, 3] - 0.5,
        scale * corners[f, 4] - 0.5,
        scale * corners[f, 5] - 0.5,
    )


@inlined
def _span(t, low, high):
    """Least and greatest x of the part of a triangle between two heights; (inf, -inf) for none."""
    left, right = np.inf, -np.inf
    for k in range(3):
        ax, ay = t[2 * k], t[2 * k + 1]
        bx, by = t[(2 * k + 2) % 6], t[(2 * k + 3) % 6]
        if min(ay, by) <= high and max(ay, by) >= low:
            rise = by - ay
            enter, leave = 0.0, 1.0
            if rise != 0.0:
                one, other = (low - ay) / rise, (high - ay) / rise
                enter, leave = max(min(one, other), 0.0), min(max(one, other), 1.0)
            from_x, to_x = ax + enter * (bx - ax), ax + leave * (bx - ax)
            left, right = min(left, from_x, to_x), max(right, from_x, to_x)
    return left, right


@inlined
def _nearest(t, x, y):
    """(squared distance, weights of corners 1 and 2) of the point of a triangle that is nearest to (x, y)."""
    ab = _cross(t[2] - t[0], t[3] - t[1], x - t[0], y - t[1])
    bc = _cross(t[4] - t[2], t[5] - t[3], x - t[2], y - t[3])
    ca = _cross(t[0] - t[4], t[1] - t[5], x - t[4], y - t[5])
    area = ab + bc + ca  # twice the triangle's, rounded so that the weights sum up to 1
    if (area > 0.0 and min(ab, bc, ca) >= 0.0) or (area < 0.0 and max(ab, bc, ca) <= 0.0):
        return 0.0, ca / area, ab / area
    best, s = _nearest_on_edge(t[0], t[1], t[2], t[3], x, y)
    b, c = s, 0.0
    distance, s = _nearest_on_edge(t[2], t[3], t[4], t[5], x, y)
    if distance < best:
        best, b, c = distance, 1.0 - s, s
    distance, s = _nearest_on_edge(t[4], t[5], t[0], t[1], x, y)
    if distance < best:
        best, b, c = distance, 0.0, 1.0 - s
    return (best if best > TOUCHING * TOUCHING else 0.0), b, c


@inlined
def _nearest_on_edge(ax, ay, bx, by, x, y):
    """(squared distance, share of the way from a to b) of the point of an edge that is nearest to (x, y)."""
    ux, uy = bx - ax, by - ay
    size = ux * ux + uy * uy
    s = 0.0
    if size > 0.0:
        s = min(max(((x - ax) * ux + (y - ay) * uy) / size, 0.0), 1.0)
    dx, dy = ax + s * ux - x, ay + s * uy - y
    return dx * dx + dy * dy, s


@inlined
def _cross(ax, ay, bx, by):
    return ax * by - ay * bx

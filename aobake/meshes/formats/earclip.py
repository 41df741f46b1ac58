"""Cut one polygon into triangles along its ears."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.scene import FloatArray

__all__ = ["clip_ears"]

Point = tuple[float, float]
MOST_CORNERS = 4096  # the time grows with the square: 1 s here; a larger polygon becomes a fan


def clip_ears(points: FloatArray) -> NDArray[np.int64]:
    """Triangles that cover a flat polygon without holes, also where it is concave.

    points : (N, 3) float64, N >= 3, its corners in order
    Returns (N - 2, 3) int64 into points, each wound as the polygon is. Where no ear is left (the polygon
    crosses itself), and above MOST_CORNERS, what remains becomes a fan.
    Source: Meisters, Polygons Have Ears, 1975; only reflex corners can lie in an ear (Eberly, 2002).
    """
    flat: list[Point] = [(x, y) for x, y in _flattened(points).tolist()]
    left = len(flat)
    after = [*range(1, left), 0]
    before = [left - 1, *range(left - 1)]
    reflex = {b for b in range(left) if not _turn(flat[before[b]], flat[b], flat[after[b]]) > 0}
    triangles: list[tuple[int, int, int]] = []
    at = refused = 0
    while left > 3 and refused < left and len(flat) <= MOST_CORNERS:
        ear = (before[at], at, after[at])
        if not _is_ear(flat, reflex, ear):
            refused += 1
            at = after[at]
            continue
        triangles.append(ear)
        at = _cut(flat, reflex, before, after, at)
        left -= 1
        refused = 0
    first, second = at, after[at]
    while after[second] != first:
        triangles.append((first, second, after[second]))
        second = after[second]
    return np.array(triangles, np.int64)


def _cut(flat: list[Point], reflex: set[int], before: list[int], after: list[int], ear: int) -> int:
    """Take a corner out of the ring; the one after it."""
    a, c = before[ear], after[ear]
    after[a], before[c] = c, a
    for corner in (a, c):
        # A reflex corner may become convex, never the other way round.
        if corner in reflex and _turn(flat[before[corner]], flat[corner], flat[after[corner]]) > 0:
            reflex.remove(corner)
    return c


def _flattened(points: FloatArray) -> FloatArray:
    """(N, 2) points in the polygon's plane, counter-clockwise, about its own centre and size."""
    with np.errstate(all="ignore"):
        centred = points - points.mean(axis=0)
        centred = centred / np.abs(centred).max()
        normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    dropped = int(np.argmax(np.abs(normal)))
    u, v = (dropped + 1) % 3, (dropped + 2) % 3
    flat: FloatArray = centred[:, [u, v]] if normal[dropped] >= 0 else centred[:, [v, u]]
    return flat


def _is_ear(flat: list[Point], reflex: set[int], corner: tuple[int, int, int]) -> bool:
    if corner[1] in reflex:
        return False
    a, b, c = flat[corner[0]], flat[corner[1]], flat[corner[2]]
    for index in reflex:
        p = flat[index]
        inside = _turn(a, b, p) >= 0 and _turn(b, c, p) >= 0 and _turn(c, a, p) >= 0
        if inside and p not in (a, b, c):
            return False
    return True


def _turn(a: Point, b: Point, c: Point) -> float:
    """Twice the signed area of a, b, c; positive where they turn left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

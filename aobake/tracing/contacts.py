"""Which triangles pass within a tiny distance of a point: asked of Embree's tree.

Embree calls back for every triangle of each leaf that the ball touches; the callback only notes the
numbers, and what truly lies within the ball is decided in float64 by the caller.

Of 13 triangles that are noted at a vertex of a scan 6 touch it. place_origins took 1 / 0.65 of its time while
corners_of was called, which takes all arrays of the world apart for each triangle, instead of merged into its
callers by LLVM; sorting only what may touch, and seeing that by boxes without a branch and a square root, left 0.84
of the rest.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import aligned, callback, inlined
from aobake.tracing.foreign import array_at, call_point_query
from aobake.tracing.vectors import cross, dot, length, minus, row

__all__ = [
    "MOST_TOUCHING",
    "ULP",
    "Touching",
    "new_touching",
    "note_triangle",
    "query_buffers",
    "touching",
]

CANDIDATES = 4096  # triangles noted for one ball; a point with more is called doubtful
MOST_TOUCHING = CANDIDATES  # triangles weighed at one point
ULP = 2.0**-23  # of a float32 in [1, 2); half of it below
NO_INSTANCE = 0xFFFFFFFF
QUERY_FLOATS, CONTEXT_WORDS = 16, 48  # RTCPointQuery and RTCPointQueryContext, with room to spare
# its instID, behind two 4x4 matrices; Embree resets it when it leaves an instance
CONTEXT_INSTANCE = 32
ARGUMENT_USER, ARGUMENT_PRIMITIVE, ARGUMENT_CONTEXT = (
    1,
    2,
    3,
)  # 8-byte fields of the callback's arguments


def _note(arguments):
    """Append (instance, geometry, primitive) to the user's buffer, whose first word counts them."""
    fields = array_at(arguments, 4, np.int64)
    words = array_at(arguments, 8, np.uint32)
    found = array_at(fields[ARGUMENT_USER], 1 + 3 * CANDIDATES, np.uint32)
    context = array_at(fields[ARGUMENT_CONTEXT], CONTEXT_WORDS, np.uint32)
    count = found[0]
    if count < CANDIDATES:
        found[1 + 3 * count] = context[CONTEXT_INSTANCE]
        found[2 + 3 * count] = words[2 * ARGUMENT_PRIMITIVE + 1]
        found[3 + 3 * count] = words[2 * ARGUMENT_PRIMITIVE]
        found[0] = count + 1
    return False


@functools.cache
def note_triangle() -> int:
    """Address of the callback, compiled when it is first needed."""
    return callback(_note, returns=bool)


def query_buffers() -> tuple[NDArray[np.generic], NDArray[np.generic], NDArray[np.generic]]:
    """Memory for the queries of one thread: RTCPointQuery, RTCPointQueryContext, what was noted."""
    return (
        aligned(QUERY_FLOATS, np.float32),
        aligned(CONTEXT_WORDS, np.uint32),
        aligned(1 + 3 * CANDIDATES, np.uint32),
    )


@inlined
def candidates_near(ask, point, radius, buffers):
    """Note the triangles of all leaves that a ball touches in the last of the buffers; returns how many.

    It then holds that number and as many rows (instance or NO_INSTANCE, geometry, primitive), in any order.
    """
    query, context, found = buffers
    query[0], query[1], query[2] = point[0], point[1], point[2]
    query[3], query[4] = 0.0, radius
    context[CONTEXT_INSTANCE] = NO_INSTANCE
    found[0] = 0
    call_point_query(
        ask[0], ask[2], query.ctypes.data, context.ctypes.data, ask[1], found.ctypes.data
    )
    return np.int64(found[0])


@inlined
def copy_row(found, source, target):
    """Put one noted triangle in the place of another one."""
    for k in range(1, 4):
        found[3 * target + k] = found[3 * source + k]


@inlined
def sort_rows(found, count):
    """Put the first so many noted triangles into an order that does not depend on how the tree was built."""
    for i in range(1, count):
        a, b, c = found[1 + 3 * i], found[2 + 3 * i], found[3 + 3 * i]
        j = i - 1
        while j >= 0 and comes_after(found, j, a, b, c):
            copy_row(found, j, j + 1)
            j -= 1
        found[3 * j + 4], found[3 * j + 5], found[3 * j + 6] = a, b, c


@inlined
def comes_after(found, j, a, b, c):
    """Whether row j of the noted triangles comes after (a, b, c)."""
    x, y, z = found[1 + 3 * j], found[2 + 3 * j], found[3 + 3 * j]
    return x > a or (x == a and (y > b or (y == b and z > c)))


class Touching(NamedTuple):
    """The triangles that touch a point, relative to it; the first `filled` rows count.

    corners : (3 K, 3) float64
    fronts : (K, 3) float64, unit normals
    inward : (K, 3) float64, unit vectors from the point towards their centres, within their planes
    extent : how far their farthest corner is away
    reach : how far the nearest of their farthest corners is away: all of them go on at least that far
    width, aspect : of the narrowest of them, and how many times as long as wide it is
    slack : how far the transform of an instance among them may be off
    """

    filled: int
    corners: NDArray[np.float64]
    fronts: NDArray[np.float64]
    inward: NDArray[np.float64]
    extent: float
    reach: float
    width: float
    aspect: float
    slack: float


def new_touching() -> Touching:
    """Memory for the triangles at one point."""
    return Touching(
        0,
        np.empty((3 * MOST_TOUCHING, 3)),
        np.empty((MOST_TOUCHING, 3)),
        np.empty((MOST_TOUCHING, 3)),
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )


@inlined
def corners_of(world, found, n, point):
    """The corners of candidate n, in float64, relative to the point; and how far its transform may be off."""
    vertices, faces, first_vertex, first_face, flat, placed, matrices, slacks = world
    alone = found[1 + 3 * n] == NO_INSTANCE
    instance = np.int64(found[1 + 3 * n]) - flat
    body = np.int64(found[2 + 3 * n]) if alone else flat + placed[instance]
    face, first = first_face[body] + np.int64(found[3 + 3 * n]), first_vertex[body]
    a = row(vertices, first + np.int64(faces[face, 0]))
    b = row(vertices, first + np.int64(faces[face, 1]))
    c = row(vertices, first + np.int64(faces[face, 2]))
    if alone:
        return minus(a, point), minus(b, point), minus(c, point), 0.0
    a, b, c = (
        moved(matrices, instance, a),
        moved(matrices, instance, b),
        moved(matrices, instance, c),
    )
    return minus(a, point), minus(b, point), minus(c, point), slacks[instance]


@inlined
def moved(matrices, instance, v):
    """A point where an instance puts it."""
    i = 3 * instance
    return (
        dot(row(matrices, i), v) + matrices[i, 3],
        dot(row(matrices, i + 1), v) + matrices[i + 1, 3],
        dot(row(matrices, i + 2), v) + matrices[i + 2, 3],
    )


@inlined
def farthest(a, b, c):
    """How far the farthest of three corners is from 0."""
    return np.sqrt(max(dot(a, a), dot(b, b), dot(c, c)))


@inlined
def may_touch(a, b, c, radius):
    """Whether the box around a triangle comes as close to 0 as the radius and the triangle's own rounding allow.

    A large triangle is where it is only to an ulp of its size, once it is rounded. Without a branch: half of the
    candidates do not come so close, in no order.
    """
    x, y, z = span(a[0], b[0], c[0]), span(a[1], b[1], c[1]), span(a[2], b[2], c[2])
    far = max(x[1], -x[0], y[1], -y[0], z[1], -z[0])
    gap = max(x[0], -x[1], y[0], -y[1], z[0], -z[1])
    return gap <= radius + 2.0 * ULP * far


@inlined
def span(x, y, z):
    """The least and the greatest of three numbers."""
    return min(x, y, z), max(x, y, z)


@inlined
def keep_close(ask, world, point, radius, buffers):
    """Note the triangles around a point, and keep those that may touch a ball; returns how many."""
    found, kept = buffers[2], 0
    for n in range(candidates_near(ask, point, radius, buffers)):
        a, b, c, loose = corners_of(world, found, n, point)
        copy_row(found, n, kept)
        kept += may_touch(a, b, c, radius + loose)
    sort_rows(found, kept)
    return kept


@inlined
def distance_to_triangle(a, b, c):
    """How far the triangle a b c is from 0. Source: Ericson, Real-Time Collision Detection, 5.1.5."""
    ab, ac = minus(b, a), minus(c, a)
    d1, d2 = -dot(ab, a), -dot(ac, a)
    d3, d4 = -dot(ab, b), -dot(ac, b)
    d5, d6 = -dot(ab, c), -dot(ac, c)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v, w = 0.0, 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        total = va + vb + vc
        v, w = vb / total, vc / total
    return length(
        (a[0] + v * ab[0] + w * ac[0], a[1] + v * ab[1] + w * ac[1], a[2] + v * ab[2] + w * ac[2])
    )


@inlined
def closer(a, b, c, reach):
    """Whether a triangle is no farther away from 0 than that; most have a corner that tells."""
    if min(dot(a, a), dot(b, b), dot(c, c)) <= reach * reach:
        return True
    return distance_to_triangle(a, b, c) <= reach


@inlined
def touching(ask, world, point, radius, buffers, near):
    """The triangles within a radius of the point and their own rounding, as a Touching.

    ask : (address of rtcPointQuery, address of the callback, address of the tree)
    world : the arrays of world.World
    near : whose memory is used
    """
    count, extent, least, slack, aspect = 0, 0.0, np.inf, 0.0, 0.0
    width = np.inf
    for n in range(keep_close(ask, world, point, radius, buffers)):
        a, b, c, loose = corners_of(world, buffers[2], n, point)
        far = farthest(a, b, c)
        reach = radius + loose + ULP * far
        front = cross(minus(b, a), minus(c, a))
        size = length(front)
        if not size > 0.0 or not closer(a, b, c, reach):
            continue
        for i in range(3):
            near.corners[3 * count, i] = a[i]
            near.corners[3 * count + 1, i] = b[i]
            near.corners[3 * count + 2, i] = c[i]
        width, aspect = min(width, size / far), max(aspect, far * far / size)
        front = (front[0] / size, front[1] / size, front[2] / size)
        middle = (a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2])
        rise = dot(middle, front)
        inward = minus(middle, (rise * front[0], rise * front[1], rise * front[2]))
        size = length(inward)
        scale = 1.0 / size if size > 0.0 else 0.0
        for i in range(3):
            near.fronts[count, i] = front[i]
            near.inward[count, i] = scale * inward[i]
        extent, least = max(extent, far), min(least, far)
        slack = max(slack, loose)
        count += 1
    return Touching(
        count, near.corners, near.fronts, near.inward, extent, least, width, aspect, slack
    )

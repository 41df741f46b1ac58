"""Which triangles pass within a tiny distance of a point: asked of Embree's tree.

Embree calls back for every triangle of each leaf that the ball touches; the callback only notes the
numbers, and what truly lies within the ball is decided in float64 by the caller.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from aobake.tracing.compiled import aligned, callback, inlined
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


@intrinsic
def pointer_to(typingctx, address):
    """An integer address as a pointer."""
    signature = types.voidptr(types.intp)

    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return signature, generate


@intrinsic
def call_point_query(typingctx, function, scene, query, context, note, user):
    """rtcPointQuery(scene, query, context, note, user), all given as integer addresses."""
    signature = types.void(*[types.intp] * 6)

    def generate(context, builder, signature, arguments):
        pointer = ir.IntType(8).as_pointer()
        prototype = ir.FunctionType(ir.IntType(1), [pointer] * 5)
        target = builder.inttoptr(arguments[0], prototype.as_pointer())
        builder.call(target, [builder.inttoptr(address, pointer) for address in arguments[1:]])
        return context.get_dummy_value()

    return signature, generate


def _note(arguments):
    """Append (instance, geometry, primitive) to the user's buffer, whose first word counts them."""
    fields = numba.carray(arguments, 4, np.int64)
    words = numba.carray(arguments, 8, np.uint32)
    found = numba.carray(pointer_to(fields[ARGUMENT_USER]), 1 + 3 * CANDIDATES, np.uint32)
    context = numba.carray(pointer_to(fields[ARGUMENT_CONTEXT]), CONTEXT_WORDS, np.uint32)
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
    return callback(types.boolean(types.voidptr), _note)


def query_buffers() -> tuple[NDArray[np.generic], NDArray[np.generic], NDArray[np.generic]]:
    """Memory for the queries of one thread: RTCPointQuery, RTCPointQueryContext, what was noted."""
    return (
        aligned(QUERY_FLOATS, np.float32),
        aligned(CONTEXT_WORDS, np.uint32),
        aligned(1 + 3 * CANDIDATES, np.uint32),
    )


@inlined
def candidates_near(function, note, scene, point, radius, buffers):
    """Note the triangles of all leaves that a ball touches in the last of the buffers.

    It then holds their number C and C rows (instance or NO_INSTANCE, geometry, primitive), in an order
    that does not depend on how the tree was built.
    """
    query, context, found = buffers
    query[0], query[1], query[2] = point[0], point[1], point[2]
    query[3], query[4] = 0.0, radius
    context[CONTEXT_INSTANCE] = NO_INSTANCE
    found[0] = 0
    call_point_query(
        function, scene, query.ctypes.data, context.ctypes.data, note, found.ctypes.data
    )
    for i in range(1, np.int64(found[0])):
        a, b, c = found[1 + 3 * i], found[2 + 3 * i], found[3 + 3 * i]
        j = i - 1
        while j >= 0 and comes_after(found, j, a, b, c):
            for k in range(1, 4):
                found[3 * j + 3 + k] = found[3 * j + k]
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
def load_corners(world, found, n, point, corners, first):
    """Put the corners of candidate n, in float64, relative to the point, into rows from `first` on."""
    vertices, faces, first_vertex, first_face, flat, placed, matrices, _ = world
    alone = found[1 + 3 * n] == NO_INSTANCE
    instance = np.int64(found[1 + 3 * n]) - flat
    body = np.int64(found[2 + 3 * n]) if alone else flat + placed[instance]
    face = first_face[body] + np.int64(found[3 + 3 * n])
    for k in range(3):
        v = row(vertices, first_vertex[body] + np.int64(faces[face, k]))
        for i in range(3):
            x = v[i]
            if not alone:
                m = row(matrices, 3 * instance + i)
                x = dot(m, v) + matrices[3 * instance + i, 3]
            corners[first + k, i] = x - point[i]


@inlined
def out_of_reach(a, b, c, radius):
    """Whether the box around a triangle is farther away from 0 than the radius."""
    for i in range(3):  # noqa: SIM110 - compiled
        if min(a[i], b[i], c[i]) > radius or max(a[i], b[i], c[i]) < -radius:
            return True
    return False


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
def touching(ask, world, point, radius, buffers, near):
    """The triangles within a radius of the point and their own rounding, as a Touching.

    ask : (address of rtcPointQuery, address of the callback, address of the tree)
    world : the arrays of world.World
    near : whose memory is used
    """
    found = buffers[2]
    candidates_near(ask[0], ask[1], ask[2], point, radius, buffers)
    count, extent, least, slack, aspect = 0, 0.0, np.inf, 0.0, 0.0
    width = np.inf
    for n in range(np.int64(found[0])):
        if count == MOST_TOUCHING:
            break
        load_corners(world, found, n, point, near.corners, 3 * count)
        a = row(near.corners, 3 * count)
        b, c = row(near.corners, 3 * count + 1), row(near.corners, 3 * count + 2)
        alone = found[1 + 3 * n] == NO_INSTANCE
        loose = 0.0 if alone else world[7][np.int64(found[1 + 3 * n]) - world[4]]
        # A large triangle is where it is only to an ulp of its size, once it is rounded.
        far = max(length(a), length(b), length(c))
        reach = radius + loose + ULP * far
        if out_of_reach(a, b, c, reach):
            continue
        front = cross(minus(b, a), minus(c, a))
        size = length(front)
        if not size > 0.0 or not distance_to_triangle(a, b, c) <= reach:
            continue
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

"""Which triangles pass within a tiny distance of a point: asked of Embree's tree.

Embree calls back for every triangle of each leaf that the ball touches; the callback only notes the
numbers, and what truly lies within the ball is decided in float64 by the caller.
"""

from __future__ import annotations

import functools

import numpy as np
from llvmlite import ir
from numba import carray, types
from numba.core import cgutils
from numba.extending import intrinsic

from aobake.tracing.compiled import callback, inlined

__all__ = ["NO_INSTANCE", "CANDIDATES", "candidates_near", "note_triangle", "query_buffers"]

CANDIDATES = 1024  # triangles noted for one ball; what a fan of more needles adds changes no decision
NO_INSTANCE = 0xFFFFFFFF
QUERY_FLOATS, CONTEXT_WORDS = 16, 48  # RTCPointQuery and RTCPointQueryContext, with room to spare
CONTEXT_INSTANCE = 32  # its instID, behind two 4x4 matrices; Embree resets it when it leaves an instance
ARGUMENT_USER, ARGUMENT_PRIMITIVE, ARGUMENT_CONTEXT = 1, 2, 3  # 8-byte fields of the callback's arguments


@intrinsic
def pointer_to(typingctx, address):  # type: ignore[no-untyped-def]
    """An integer address as a pointer."""
    signature = types.voidptr(types.intp)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return signature, generate


@intrinsic
def call_point_query(typingctx, function, scene, query, context, note, user):  # type: ignore[no-untyped-def]
    """rtcPointQuery(scene, query, context, note, user), all given as integer addresses."""
    signature = types.void(*[types.intp] * 6)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pointer = ir.IntType(8).as_pointer()
        prototype = ir.FunctionType(ir.IntType(1), [pointer] * 5)
        target = builder.inttoptr(arguments[0], prototype.as_pointer())
        builder.call(target, [builder.inttoptr(address, pointer) for address in arguments[1:]])
        return context.get_dummy_value()

    return signature, generate


def _note(arguments):  # type: ignore[no-untyped-def]
    """Append (instance, geometry, primitive) to the user's buffer, whose first word counts them."""
    fields = carray(arguments, 4, np.int64)
    words = carray(arguments, 8, np.uint32)
    found = carray(pointer_to(fields[ARGUMENT_USER]), 1 + 3 * CANDIDATES, np.uint32)
    context = carray(pointer_to(fields[ARGUMENT_CONTEXT]), CONTEXT_WORDS, np.uint32)
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


@inlined
def query_buffers():  # type: ignore[no-untyped-def]
    """Memory for queries of one thread: (query, context, found)."""
    query = np.zeros(QUERY_FLOATS + 16, np.float32)
    context = np.zeros(CONTEXT_WORDS + 16, np.uint32)
    first = (-(query.ctypes.data // 4)) % 16
    start = (-(context.ctypes.data // 4)) % 16
    return query[first:], context[start:], np.zeros(1 + 3 * CANDIDATES, np.uint32)


@inlined
def candidates_near(function, note, scene, point, radius, buffers):  # type: ignore[no-untyped-def]
    """Note the triangles of all leaves that a ball touches; returns (C, 3) uint32 rows.

    Rows are (instance or NO_INSTANCE, geometry, primitive), in an order that does not depend on how
    the tree was built.
    """
    query, context, found = buffers
    query[0], query[1], query[2] = point[0], point[1], point[2]
    query[3], query[4] = 0.0, radius
    context[CONTEXT_INSTANCE] = NO_INSTANCE
    found[0] = 0
    call_point_query(
        function, scene, query.ctypes.data, context.ctypes.data, note, found.ctypes.data
    )
    rows = found[1 : 1 + 3 * found[0]].reshape(-1, 3)
    for i in range(1, len(rows)):
        a, b, c = rows[i, 0], rows[i, 1], rows[i, 2]
        j = i - 1
        while j >= 0 and (
            rows[j, 0] > a
            or (rows[j, 0] == a and (rows[j, 1] > b or (rows[j, 1] == b and rows[j, 2] > c)))
        ):
            rows[j + 1] = rows[j]
            j -= 1
        rows[j + 1, 0], rows[j + 1, 1], rows[j + 1, 2] = a, b, c
    return rows

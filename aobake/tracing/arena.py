"""Memory for kernels, which allocate none: they take it from the front of an array that they are given.

np.zeros and np.empty in a kernel bring numba's counting of references with them, and its formatting of strings
for the errors that they could raise: with them, the kernels of an unwrapping took twice as long to compile.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

from aobake.tracing.compiled import aligned, inlined, operation

__all__ = ["give_back", "reserved", "taken", "zeros"]

LINE = 64  # bytes: what is taken begins at a cache line; the first one holds how many are taken


def reserved(size: int, pieces: int) -> NDArray[np.uint8]:
    """Memory for so many pieces of at most `size` bytes in all, that are taken at the same time."""
    return aligned(size + LINE * (pieces + 1), np.uint8).view(np.uint8)


@operation
def _counter(typingctx, arena):
    """(1,) int64, at the front of an arena: how many bytes of it are taken."""
    from numba import types

    kind = types.Array(types.int64, 1, "C")

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return _viewed(context, builder, kind, data, [context.get_constant(types.intp, 1)])

    return kind(arena), generate


@inlined
def taken(arena):
    """How much of an arena is taken, for give_back."""
    return _counter(arena)[0]


@inlined
def give_back(arena, mark):
    """Give back what has been taken since that mark."""
    _counter(arena)[0] = mark


@operation
def zeros(typingctx, arena, shape, dtype):
    """An array of zeros, of a shape that is a number or a tuple, from an arena that has room for it.

    Where a bound was worked out wrongly and it has none, the array is the system's memory and stays to the end of the
    process: values are right all the same.
    """
    from numba import types
    from numba.core import cgutils

    kind = types.Array(dtype.dtype, getattr(shape, "count", 1), "C")

    def generate(context, builder, signature, arguments):
        held = context.make_array(signature.args[0])(context, builder, arguments[0])
        counts = [arguments[1]]
        if isinstance(signature.args[1], types.BaseTuple):
            counts = cgutils.unpack_tuple(builder, arguments[1])
        word = context.get_value_type(types.intp)
        size = word(context.get_abi_sizeof(context.get_data_type(kind.dtype)))
        for count in counts:
            size = builder.mul(size, count)
        counter = builder.bitcast(held.data, word.as_pointer())
        begin = builder.add(builder.load(counter), word(LINE))
        end = builder.add(begin, builder.and_(builder.add(size, word(LINE - 1)), word(-LINE)))
        place = cgutils.alloca_once(builder, held.data.type)
        fits = builder.icmp_signed("<=", end, held.nitems)
        with builder.if_else(fits, likely=True) as (there, beyond):
            with there:
                builder.store(builder.sub(end, word(LINE)), counter)
                inside = builder.gep(held.data, [begin])
                cgutils.memset(builder, inside, size, 0)
                builder.store(inside, place)
            with beyond:
                calloc = ir.FunctionType(ir.IntType(8).as_pointer(), [word, word])
                calloc = cgutils.get_or_insert_function(builder.module, calloc, "calloc")
                further = builder.call(calloc, [word(1), size])
                builder.store(builder.bitcast(further, held.data.type), place)
        return _viewed(context, builder, kind, builder.load(place), counts)

    whole = types.intp if kind.ndim == 1 else types.UniTuple(types.intp, kind.ndim)
    return kind(arena, whole, dtype), generate


def _viewed(context, builder, kind, data, counts):
    """The memory at a pointer as an array, in rows."""
    from numba.np.arrayobj import populate_array

    word, element = counts[0].type, context.get_data_type(kind.dtype)
    size = word(context.get_abi_sizeof(element))
    strides = [size]
    for count in reversed(counts[1:]):
        strides.insert(0, builder.mul(strides[0], count))
    array = context.make_array(kind)(context, builder)
    place = builder.bitcast(data, element.as_pointer())
    populate_array(array, place, counts, strides, size, None)
    return array._getvalue()  # noqa: SLF001 - numba has no public way

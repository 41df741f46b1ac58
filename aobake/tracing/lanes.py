"""Eight float32 at once, for kernels: a row of one of Embree's packets, in one register.

LLVM makes such instructions of a loop over eight lanes only where it can tell that no two arrays overlap, which it
cannot of arguments. What each lane holds is what the loop would give, to the last bit. Sets of lanes are bits.

Making and counting a packet of kernels.trace took 75 to 100 ns by loops, and takes 20 to 26 ns so (around a call that
does nothing; Embree takes 1,400 for it).
"""

from __future__ import annotations

import functools

from llvmlite import ir

from aobake.tracing.compiled import operation

__all__ = [
    "ALL",
    "at_most",
    "below",
    "count",
    "divided",
    "eight",
    "minus",
    "picked",
    "plus",
    "put",
    "put_mask",
    "spread",
    "times",
]

ALL = 0xFF  # of the lanes
ROW = ir.VectorType(ir.FloatType(), 8)
BIT, BITS, MASK = ir.IntType(1), ir.IntType(8), ir.VectorType(ir.IntType(32), 8)
BYTES = 4  # that arrays are aligned to, at least


@functools.cache
def _row():
    """numba's type of such a row."""
    from numba.core.datamodel import models
    from numba.extending import register_model

    class Eight(_types().Type):
        pass

    @register_model(Eight)
    class _Model(models.PrimitiveModel):
        def __init__(self, manager, kind) -> None:
            super().__init__(manager, kind, ROW)

    return Eight(name="eight float32")


def _types():
    """numba's types, which only compiling needs."""
    from numba import types

    return types


def _place(context, builder, array_type, array, first, kind):
    """A pointer to eight elements of a contiguous array, counted flat."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [first]), kind.as_pointer())


def _bits(context, builder, lanes):
    """Eight truths as a whole number."""
    return builder.zext(builder.bitcast(lanes, BITS), context.get_value_type(_types().int64))


def _lanes(builder, bits):
    """A whole number as eight truths."""
    return builder.bitcast(builder.trunc(bits, BITS), ir.VectorType(BIT, 8))


@operation
def eight(typingctx, array, first):
    """Elements first to first + 7 of a contiguous float32 array, counted flat."""

    def generate(context, builder, signature, arguments):
        place = _place(context, builder, signature.args[0], *arguments, ROW)
        return builder.load(place, align=BYTES)

    return _row()(array, _types().intp), generate


@operation
def put(typingctx, array, first, row):
    """Set elements first to first + 7 of a contiguous float32 array, counted flat."""

    def generate(context, builder, signature, arguments):
        place = _place(context, builder, signature.args[0], *arguments[:2], ROW)
        builder.store(arguments[2], place, align=BYTES)
        return context.get_dummy_value()

    return _types().void(array, _types().intp, _row()), generate


@operation
def put_mask(typingctx, array, first, bits):
    """Set elements first to first + 7 of a contiguous int32 array: -1 for lanes of the set, 0 for others."""

    def generate(context, builder, signature, arguments):
        place = _place(context, builder, signature.args[0], *arguments[:2], MASK)
        builder.store(builder.sext(_lanes(builder, arguments[2]), MASK), place, align=BYTES)
        return context.get_dummy_value()

    return _types().void(array, _types().intp, _types().int64), generate


@operation
def spread(typingctx, value):
    """One float32 in all lanes."""

    def generate(context, builder, signature, arguments):
        index = ir.IntType(32)
        one = builder.insert_element(ir.Constant(ROW, ir.Undefined), arguments[0], index(0))
        zeros = ir.Constant(MASK, [0] * 8)
        return builder.shuffle_vector(one, ir.Constant(ROW, ir.Undefined), zeros)

    return _row()(_types().float32), generate


def _lane_by_lane(instruction):
    """An operation on two rows."""

    @operation
    def combined(typingctx, a, b):
        def generate(context, builder, signature, arguments):
            return getattr(builder, instruction)(*arguments)

        return _row()(_row(), _row()), generate

    return combined


plus, minus, times, divided = map(_lane_by_lane, ("fadd", "fsub", "fmul", "fdiv"))


def _lanes_where(comparison):
    """The set of lanes where one row compares so with another; never where one of them is NaN."""

    @operation
    def compared(typingctx, a, b):
        def generate(context, builder, signature, arguments):
            return _bits(context, builder, builder.fcmp_ordered(comparison, *arguments))

        return _types().int64(_row(), _row()), generate

    return compared


below, at_most = _lanes_where("<"), _lanes_where("<=")


@operation
def picked(typingctx, bits, a, b):
    """One row in the lanes of a set, another one in the others."""

    def generate(context, builder, signature, arguments):
        bits, a, b = arguments
        return builder.select(_lanes(builder, bits), a, b)

    return _row()(_types().int64, _row(), _row()), generate


@operation
def count(typingctx, bits):
    """How many lanes are in a set."""

    def generate(context, builder, signature, arguments):
        return builder.ctpop(arguments[0])

    return _types().int64(_types().int64), generate

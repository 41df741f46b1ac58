"""What kernels do that Python cannot: call C functions, and look at memory, by addresses.

A kernel that held a pointer could not be kept on disk: addresses are arguments.
"""

from __future__ import annotations

from llvmlite import ir

from aobake.tracing.compiled import operation

__all__ = ["array_at", "call_packet", "call_point_query"]

BYTE = ir.IntType(8)
POINTER = BYTE.as_pointer()


@operation
def call_packet(typingctx, function, valid, scene, rays, asked):
    """function(valid, scene, rays, asked), all given as integer addresses; asked : 0 for no arguments."""
    from numba import types

    def generate(context, builder, signature, arguments):
        prototype = ir.FunctionType(ir.VoidType(), [POINTER] * 4)
        target = builder.inttoptr(arguments[0], prototype.as_pointer())
        given = [builder.inttoptr(address, POINTER) for address in arguments[1:]]
        builder.call(target, given)
        return context.get_dummy_value()

    return types.void(*[types.intp] * 5), generate


@operation
def call_point_query(typingctx, function, scene, query, context, note, user):
    """rtcPointQuery(scene, query, context, note, user), all given as integer addresses."""
    from numba import types

    def generate(context, builder, signature, arguments):
        prototype = ir.FunctionType(ir.IntType(1), [POINTER] * 5)
        target = builder.inttoptr(arguments[0], prototype.as_pointer())
        builder.call(target, [builder.inttoptr(address, POINTER) for address in arguments[1:]])
        return context.get_dummy_value()

    return types.void(*[types.intp] * 6), generate


@operation
def array_at(typingctx, address, count, dtype):
    """(count,) the memory at an address, as an array."""
    from numba import types
    from numba.np.arrayobj import populate_array

    kind = types.Array(dtype.dtype, 1, "C")

    def generate(context, builder, signature, arguments):
        place, length, _ = arguments
        size = context.get_constant(
            types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype))
        )
        array = context.make_array(kind)(context, builder)
        data = builder.inttoptr(place, context.get_data_type(kind.dtype).as_pointer())
        populate_array(array, data, [length], [size], size, None)
        return array._getvalue()  # noqa: SLF001 - numba has no public way

    return kind(types.intp, types.intp, dtype), generate

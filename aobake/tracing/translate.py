"""From a Python function to object code, by numba. Imported only where a kernel is not on disk.

numba makes a function of its own convention: it takes the place of its result, the place of an exception, and
its arguments piece by piece. Around it goes a C function, so that nothing of Python and of numba is needed to call
it: neither now, nor in a process that finds the code on disk.
"""

from __future__ import annotations

import functools
import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir

from aobake.tracing import machine
from aobake.tracing.arguments import types_of

__all__ = ["as_callback", "as_kernel", "hurry", "introduce", "introduce_operation"]

SLOT = ir.IntType(64)
# numpy's error model drops the zero-division checks, which would keep loops from being vectorised. Nothing is
# allocated and no references are counted: every view of an array would be one, and threads that share the array
# would fight over the counter.
OPTIONS: Mapping[str, object] = {
    "error_model": "numpy",
    "nogil": True,
    "_nrt": False,
    "no_cfunc_wrapper": True,
    "no_cpython_wrapper": True,
}


def hurry() -> None:
    """Import numba in less time, and let it compile in less; for a process in which nobody else uses it.

    Its array functions ask for scipy's linear algebra when they are first imported, for np.dot, which no kernel of
    ours calls: 0.17 s. And it makes every function fast by itself, and machine code of it, and again within each
    that calls it: a third of all compiling, for nothing, since machine.py does so once for a kernel as a whole.
    """
    blas = "scipy.linalg.cython_blas"
    if blas not in sys.modules:
        sys.modules[blas] = None  # type: ignore[assignment]  # Python's way to say: not there
        try:
            importlib.import_module("numba.np.arraymath")
        finally:
            del sys.modules[blas]
    from aobake.tracing.gathering import gather

    gather()


def introduce(function: Callable[..., object]) -> None:
    """Tell numba of a function that kernels call."""
    from numba.extending import register_jitable

    register_jitable(**_options())(function)


def introduce_operation(definition: Callable[..., object]) -> None:
    """Tell numba of an operation that kernels call, by a function that numba.extending.intrinsic would take."""
    from numba.core.registry import cpu_target
    from numba.core.typing.templates import infer_global
    from numba.extending import intrinsic

    operation = intrinsic(definition)
    cpu_target.typing_context.refresh()
    infer_global(definition, cpu_target.typing_context.resolve_value_type(operation))


def as_kernel(function: Callable[..., object], arguments: Sequence[object]) -> tuple[bytes, str]:
    """Object code of a kernel for arguments of the kinds of these, and the name of the type of its result.

    Its entry takes the address of a row of 64-bit slots, the arguments as arguments.py has them, and that of
    another one for the result, and returns 0.
    """
    kinds = types_of(arguments)
    compiled, result = _compiled(function, kinds)

    def body(builder: ir.IRBuilder, callee: ir.Function, given: Sequence[ir.Value]) -> None:
        slots, place = given
        pieces = []
        for number, kind in enumerate(callee.function_type.args[2:]):
            slot = builder.gep(slots, [ir.Constant(SLOT, number)])
            pieces.append(builder.load(builder.bitcast(slot, kind.as_pointer())))
        builder.ret(_call(builder, callee, builder.bitcast(place, callee.args[0].type), pieces))

    signature = ir.FunctionType(ir.IntType(32), [SLOT.as_pointer()] * 2)
    return _around(compiled, signature, body), str(result)


def as_callback(function: Callable[..., object], *, returns: type[bool] | None) -> bytes:
    """Object code of a function that C calls with one address; its entry is that function."""
    import numba

    compiled, _ = _compiled(function, (numba.intp,))

    def body(builder: ir.IRBuilder, callee: ir.Function, given: Sequence[ir.Value]) -> None:
        place = builder.alloca(callee.args[0].type.pointee)
        _call(builder, callee, place, given)
        if returns is None:
            builder.ret_void()
        else:
            builder.ret(builder.load(place))

    result = ir.VoidType() if returns is None else ir.IntType(8)  # as numba keeps truths
    return _around(compiled, ir.FunctionType(result, [SLOT]), body)


def _compiled(
    function: Callable[..., object], kinds: tuple[Any, ...]
) -> tuple[tuple[llvm.ModuleRef, str, ir.FunctionType], Any]:
    """The module of a function, its name there and its type; and numba's type of its result."""
    import numba
    from numba.core.registry import cpu_target

    from aobake.tracing.gathering import module_of

    compiler: Any = numba.njit(**_options())(function)
    compiler.compile(kinds)
    made = compiler.overloads[kinds]
    result = made.signature.return_type
    convention = cpu_target.target_context.call_conv
    kind = convention.get_function_type(result, kinds)
    return (module_of(made.library), made.fndesc.mangled_name, kind), result


@functools.cache
def _options() -> dict[str, Any]:
    """How numba is to compile kernels and the functions that they call."""
    from aobake.tracing.gathering import KernelPasses

    return {**OPTIONS, "pipeline_class": KernelPasses}


def _call(
    builder: ir.IRBuilder, callee: ir.Function, place: ir.Value, pieces: Sequence[ir.Value]
) -> ir.Value:
    """Call a function as numba does; returns its status."""
    exception = builder.alloca(callee.args[1].type.pointee)
    return builder.call(callee, [place, exception, *pieces])


def _around(
    compiled: tuple[llvm.ModuleRef, str, ir.FunctionType],
    signature: ir.FunctionType,
    body: Callable[[ir.IRBuilder, ir.Function, Sequence[ir.Value]], None],
) -> bytes:
    """Object code of a function with a C function around it."""
    whole, name, kind = compiled
    around = ir.Module("entry")
    around.triple, around.data_layout = whole.triple, whole.data_layout
    entry = ir.Function(around, signature, machine.ENTRY)
    body(ir.IRBuilder(entry.append_basic_block()), ir.Function(around, kind, name), entry.args)
    whole.link_in(llvm.parse_assembly(str(around)))
    return machine.emitted(whole)

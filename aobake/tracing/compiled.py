"""How kernels are compiled: with numba, once per machine, and called without it.

A kernel that is called for the first time is looked up in the user's cache folder (kept.py), by what it is made of
and the kinds of its arguments. Only where it is not there, numba is imported and makes machine code (translate.py),
which is loaded from memory as it is from disk (machine.py): a bake whose kernels are kept never imports numba.

What made compiling short, in seconds of a vertex bake's 24: no wrappers for Python and C around functions that only
kernels call, 4; no np.zeros and np.argsort in kernels, 7; and a quarter of what was left since code is linked and
made fast once (gathering.py). Tried and left: merging small functions before they are typed (numba's
inline="always") took four times as long for
place_origins, since each copy is typed and lowered again.
"""

from __future__ import annotations

import ctypes
import functools
import sys
import threading
from collections.abc import Callable
from typing import Any, Generic, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from aobake.errors import EngineError
from aobake.tracing import machine
from aobake.tracing.arguments import slotted
from aobake.tracing.kept import Kept

__all__ = [
    "Kernel",
    "aligned",
    "callback",
    "compile_alone",
    "inlined",
    "kernel",
    "operation",
]

P = ParamSpec("P")
R = TypeVar("R")
Function = TypeVar("Function", bound=Callable[..., object])
Result = type[ctypes.c_int64 | ctypes.c_uint64 | ctypes.c_double]
Entry = tuple[Callable[..., int], Result | None]  # the C function, and what it gives

_ENTRY = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p)
RESULTS: dict[str, Result | None] = {
    "none": None,
    "int64": ctypes.c_int64,
    "uint64": ctypes.c_uint64,
    "float64": ctypes.c_double,
}
_COMPILING = (
    threading.RLock()
)  # callbacks are asked for while arguments of kernels are put together

# What numba has not been told of. That takes 0.6 ms for each, and only compiling needs it.
_FUNCTIONS: list[Callable[..., object]] = []
_OPERATIONS: list[Callable[..., object]] = []
_ALONE: list[bool] = []


class Kernel(Generic[P, R]):
    """A compiled function over arrays and numbers. It returns nothing or a number.

    The interpreter lock is let go of while it runs. It allocates nothing: scratch memory is an argument.
    """

    def __init__(self, function: Callable[P, R]) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._kept = Kept(function)
        self._entries: dict[str, Entry] = {}

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> R:
        if named:
            raise TypeError(f"{self.py_func.__name__} takes its arguments by their places.")
        kinds, slots = slotted(arguments)
        entry, kind = self._entries.get(kinds) or self._compiled(kinds, arguments)
        result = (kind or ctypes.c_int64)()
        status = entry((ctypes.c_int64 * len(slots))(*slots), ctypes.byref(result))
        if status != 0:
            raise EngineError(f"kernel {self.py_func.__name__} ended with status {status}.")
        return result.value if kind else None  # type: ignore[return-value]

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of arguments that it has been called with."""
        return tuple(self._entries)

    def is_kept(self) -> bool:
        """Whether its code, as it is now, is on disk for arguments of some kinds."""
        return self._kept.known()

    def _compiled(self, kinds: str, arguments: tuple[object, ...]) -> Entry:
        """The code for arguments of some kinds, from disk or from numba."""

        def made() -> bytes:
            _introduce()
            from aobake.tracing import translate

            code, result = translate.as_kernel(self.py_func, arguments)
            if result not in RESULTS:
                name = self.py_func.__name__
                raise EngineError(f"kernel {name} returns {result}: fill an array instead.")
            return bytes([list(RESULTS).index(result)]) + code

        with _COMPILING:
            if kinds not in self._entries:
                code = self._kept.code(kinds, made)
                result = list(RESULTS.values())[code[0]]
                self._entries[kinds] = _ENTRY(machine.loaded(code[1:])), result
            return self._entries[kinds]


def kernel(function: Callable[P, R]) -> Kernel[P, R]:
    """Compile a function over arrays and numbers when it is first called; keep the code on disk."""
    return Kernel(function)


def inlined(function: Function) -> Function:
    """A function that kernels call; LLVM merges it into them. From Python it is Python."""
    _FUNCTIONS.append(function)
    return function


def operation(definition: Callable[..., object]) -> Callable[..., Any]:
    """An operation that kernels call and Python cannot, defined as numba.extending.intrinsic wants it."""
    _OPERATIONS.append(definition)
    return definition


def callback(function: Callable[..., object], *, returns: type[bool] | None = None) -> int:
    """The address of a C function, made from one in Python that takes an address and gives nothing or a truth."""

    def made() -> bytes:
        _introduce()
        from aobake.tracing import translate

        return translate.as_callback(function, returns=returns)

    with _COMPILING:
        return machine.loaded(Kept(function).code(f"callback {returns}", made))


def compile_alone() -> None:
    """Say that nobody else uses numba in this process, so that it may be hurried (translate.py).

    Where it has been imported already somebody does, and it stays as it is.
    """
    if "numba" not in sys.modules:
        _ALONE.append(True)


def _introduce() -> None:
    """Import numba, and tell it of all functions that kernels may call."""
    from aobake.tracing import translate

    if _ALONE:
        translate.hurry()
    while _OPERATIONS:
        translate.introduce_operation(_OPERATIONS.pop())
    while _FUNCTIONS:
        translate.introduce(_FUNCTIONS.pop())


def aligned(count: int, dtype: type[np.generic]) -> NDArray[np.generic]:
    """(count,) zeros that begin at a 64-byte boundary, a cache line and Embree's widest load."""
    size = np.dtype(dtype).itemsize
    memory = np.zeros(count * size + 64, np.uint8)
    first = -memory.ctypes.data % 64
    return memory[first : first + count * size].view(dtype)

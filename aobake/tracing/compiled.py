"""How kernels are compiled: with numba, once per machine, without the interpreter lock.

The compiled code is kept beside the source or, where that folder is read-only, in the user's cache
folder. Where neither can be written (a container without a home), kernels are compiled anew in each
process instead of failing.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = [
    "aligned",
    "callback",
    "import_without_blas",
    "inlined",
    "kernel",
    "read_only",
    "tight_kernel",
]

P = ParamSpec("P")
R = TypeVar("R")
ScalarT = TypeVar("ScalarT", bound=np.generic)


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function over arrays and numbers when it is first called; keep the code on disk."""
    return _kept_on_disk(function, counted=True)


def tight_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """A kernel that allocates nothing and counts no references.

    Every view of an array is a counted reference else, and threads that share the array fight over
    the counter: it made the placing of origins six times slower. Scratch memory is an argument.
    """
    return _kept_on_disk(function, counted=False)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """A function that kernels call; LLVM merges it into them. Allocates nothing."""
    return _compiled(function, kept=False, counted=False)


def _kept_on_disk(function: Callable[P, R], *, counted: bool) -> Callable[P, R]:
    try:
        return _compiled(function, kept=True, counted=counted)
    except RuntimeError:  # "no locator available": nowhere to keep it
        return _compiled(function, kept=False, counted=counted)


def _compiled(function: Callable[P, R], *, kept: bool, counted: bool) -> Callable[P, R]:
    # numpy's error model drops the zero-division checks, which would keep loops from being vectorised.
    compiler: Any = numba.njit(nogil=True, error_model="numpy", cache=kept, _nrt=counted)  # type: ignore[call-overload]
    return cast("Callable[P, R]", compiler(function))


def aligned(count: int, dtype: type[np.generic]) -> NDArray[np.generic]:
    """(count,) zeros that begin at a 64-byte boundary, a cache line and Embree's widest load."""
    size = np.dtype(dtype).itemsize
    memory = np.zeros(count * size + 64, np.uint8)
    first = -memory.ctypes.data % 64
    return memory[first : first + count * size].view(dtype)


def import_without_blas() -> None:
    """Import numba's array functions, which every kernel needs, but not scipy's linear algebra with them.

    They ask for it when they are first imported, for np.dot, which no kernel of ours calls: 0.17 s. For
    a process of our own only: in one that others share, their kernels may want np.dot.
    """
    blas = "scipy.linalg.cython_blas"
    if blas not in sys.modules:
        sys.modules[blas] = None  # type: ignore[assignment]  # Python's way to say: not there
        try:
            importlib.import_module("numba.np.arraymath")
        finally:
            del sys.modules[blas]


def read_only(array: NDArray[ScalarT]) -> NDArray[ScalarT]:
    """A read-only view, for kernels that only read: numba compiles anew for each mix of the two kinds."""
    view = array.view()
    view.flags.writeable = False
    return view


def callback(signature: object, function: Callable[..., object]) -> int:
    """The address of a C function made from a Python one. The code lives as long as the process."""
    try:
        compiled = _c_function(signature, function, kept=True)
    except RuntimeError:
        compiled = _c_function(signature, function, kept=False)
    _ALIVE.append(compiled)
    return int(compiled.address)


def _c_function(signature: object, function: Callable[..., object], *, kept: bool) -> Any:
    compiler: Any = numba.cfunc(signature, cache=kept, error_model="numpy")
    return compiler(function)


_ALIVE: list[object] = []  # a cfunc that is collected takes its machine code with it

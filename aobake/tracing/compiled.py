"""How kernels are compiled: with numba, once per machine, without the interpreter lock.

The compiled code is kept in the user's cache folder (kept.py); where that cannot be written, kernels are
compiled anew in each process. What made the first run of all short, in seconds of a vertex bake's 18:

- no wrappers for Python and C around functions that only kernels call: 4;
- arrays as arguments, where np.empty and np.zeros in a kernel bring numba's formatting of strings with
  them for the errors that they could raise, and np.argsort its quicksort: 7.

Tried and left: merging small functions before they are typed (numba's inline="always") took four times as
long for place_origins, since each copy is typed and lowered again.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numba.core.ccallback import CFunc
from numba.extending import register_jitable
from numpy.typing import NDArray

from aobake.tracing.kept import Kept

__all__ = [
    "aligned",
    "callback",
    "import_without_blas",
    "inlined",
    "is_kept",
    "kernel",
    "read_only",
    "routine",
    "tight_kernel",
]

# numpy's error model drops the zero-division checks, which would keep loops from being vectorised.
CALLED_BACK: Mapping[str, object] = {"error_model": "numpy"}
COUNTED = {"error_model": "numpy", "nogil": True, "_nrt": True, "no_cfunc_wrapper": True}
UNCOUNTED = COUNTED | {"_nrt": False}
INLINED, ROUTINE = UNCOUNTED | {"no_cpython_wrapper": True}, COUNTED | {"no_cpython_wrapper": True}

P = ParamSpec("P")
R = TypeVar("R")
ScalarT = TypeVar("ScalarT", bound=np.generic)


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function over arrays and numbers when it is first called; keep the code on disk."""
    return _compiled(function, COUNTED)


def tight_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """A kernel that allocates nothing and counts no references.

    Every view of an array is a counted reference else, and threads that share the array fight over
    the counter: it made the placing of origins six times slower. Scratch memory is an argument.
    """
    return _compiled(function, UNCOUNTED)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """A function that kernels call; LLVM merges it into them. Allocates nothing. From Python it is Python."""
    _UNKNOWN.append((function, INLINED))
    return function


def routine(function: Callable[P, R]) -> Callable[P, R]:
    """A function that kernels call and that allocates. From Python it is Python."""
    _UNKNOWN.append((function, ROUTINE))
    return function


# Functions that numba has not been told of. That takes 0.6 ms for each, and only compiling needs it.
_UNKNOWN: list[tuple[Callable[..., object], Mapping[str, object]]] = []


def _introduce() -> None:
    """Tell numba of all functions that kernels may call."""
    while _UNKNOWN:
        function, options = _UNKNOWN.pop()
        register_jitable(**options)(function)


def _compiled(function: Callable[P, R], options: Mapping[str, object]) -> Callable[P, R]:
    compiler: Any = numba.njit(**options)  # type: ignore[call-overload]
    compiled = compiler(function)
    compiled._cache = _kept(function, options)  # noqa: SLF001 - numba has no public way
    return cast("Callable[P, R]", compiled)


def _kept(function: Callable[..., object], options: Mapping[str, object]) -> Kept:
    return Kept(function, f"{options} {INLINED} {ROUTINE}", before_compiling=_introduce)


def is_kept(kernel: Callable[P, R]) -> bool:
    """Whether the code of a kernel, as it is now, is on disk for arguments of some types."""
    compiled: Any = kernel
    return bool(compiled._cache.known())  # noqa: SLF001 - as above


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


def callback(signature: Any, function: Callable[..., object]) -> int:
    """The address of a C function made from a Python one. The code lives as long as the process.

    signature : numba's, of the result called with the arguments
    """
    types = signature.args, signature.return_type
    compiled: Any = CFunc(function, types, {}, dict(CALLED_BACK))
    compiled._cache = _kept(function, CALLED_BACK)  # noqa: SLF001 - as above
    compiled.compile()
    _ALIVE.append(compiled)
    return int(compiled.address)


_ALIVE: list[object] = []  # a cfunc that is collected takes its machine code with it

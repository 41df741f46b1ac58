"""How kernels are compiled: with numba, once per machine, without the interpreter lock.

The compiled code is kept beside the source or, where that folder is read-only, in the user's cache
folder. Where neither can be written (a container without a home), kernels are compiled anew in each
process instead of failing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numba

__all__ = ["callback", "inlined", "kernel"]

P = ParamSpec("P")
R = TypeVar("R")

# numpy's error model drops the zero-division checks, which would keep loops from being vectorised.
OPTIONS = {"nogil": True, "error_model": "numpy"}


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function over arrays and numbers when it is first called; keep the code on disk."""
    try:
        return numba.njit(cache=True, **OPTIONS)(function)  # type: ignore[no-any-return]
    except RuntimeError:  # "no locator available": nowhere to keep it
        return numba.njit(**OPTIONS)(function)  # type: ignore[no-any-return]


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """A function that kernels call; LLVM merges it into them, and it needs no cache of its own."""
    return numba.njit(**OPTIONS)(function)  # type: ignore[no-any-return]


def callback(signature: object, function: Callable[P, R]) -> int:
    """The address of a C function made from a Python one. The code lives as long as the process."""
    try:
        compiled = numba.cfunc(signature, cache=True, **OPTIONS)(function)
    except RuntimeError:
        compiled = numba.cfunc(signature, **OPTIONS)(function)
    _ALIVE.append(compiled)
    return int(compiled.address)


_ALIVE: list[object] = []  # a cfunc that is collected takes its machine code with it

"""What a kernel's machine code is made from, as a digest: its bytecode, and all that it refers to.

Comments, docstrings of callees, line numbers, file names and dates are no part of it.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Iterator
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType

import numpy as np

__all__ = ["content"]


def content(function: object) -> str:
    """Hexadecimal digest of a Python function and of everything that it reaches by name.

    Followed are functions, compiled or not, constants, arrays and collections; modules, classes and what is
    built in count by their names, named tuples by their fields as well. What is none of this counts by its
    repr: where that differs from process to process, the kernel is compiled anew, which a test would notice.
    """
    digest, seen, waiting = hashlib.sha256(), set(), [function]
    while waiting:
        some = _python(waiting.pop())
        if isinstance(some, FunctionType) and some not in seen:
            seen.add(some)
            text, reached = _told(some)
            digest.update(text.encode())
            waiting += reached
    return digest.hexdigest()


@functools.cache
def _told(function: FunctionType) -> tuple[str, tuple[FunctionType, ...]]:
    """What a function itself says, and the functions that it names, in the order of their names."""
    reached: list[FunctionType] = []
    named = sorted(set(_names(function.__code__)) & function.__globals__.keys())
    values = {name: function.__globals__[name] for name in named}
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    parts = [function.__module__, function.__qualname__, *_words(_undocumented(function), reached)]
    held = (values, cells, function.__defaults__, function.__kwdefaults__)
    parts += _words(held, reached)
    return "\n".join(parts), tuple(reached)


def _undocumented(function: FunctionType) -> CodeType:
    """The code of a function without its docstring, which is its first constant."""
    code = function.__code__
    if function.__doc__ is None:
        return code
    return code.replace(co_consts=(None, *code.co_consts[1:]))


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _words(value: object, reached: list[FunctionType]) -> Iterator[str]:
    """What a value says; functions are named, and added to what is reached."""
    value = _python(value)
    match value:
        case FunctionType():
            reached.append(value)
            yield f"function {value.__module__}.{value.__qualname__}"
        case CodeType():
            yield value.co_code.hex()
            yield repr((value.co_names, value.co_varnames, value.co_freevars, value.co_flags))
            yield from _words(value.co_consts, reached)
        case np.ndarray():
            yield f"{value.dtype.str} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
        case dict():
            yield from _words(tuple(value.items()), reached)
        case tuple() | list():
            yield f"{type(value).__name__} {len(value)}"
            for held in value:
                yield from _words(held, reached)
        case frozenset() | set():
            yield from sorted(map(repr, value))
        case ModuleType() | BuiltinFunctionType() | type():
            yield f"{type(value).__name__} {value.__name__} {getattr(value, '_fields', '')}"
        case _:
            yield f"{type(value).__name__} {value!r}"


def _python(value: object) -> object:
    """The Python function behind a compiled one, or behind an intrinsic; anything else as it is."""
    if isinstance(value, FunctionType | type):
        return value
    return getattr(value, "py_func", None) or getattr(value, "__wrapped__", None) or value

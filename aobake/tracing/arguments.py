"""What a kernel is called with, as compiled code takes it: a row of 64-bit slots, and what kinds of things are in it.

The slots are those that numba passes the same arguments in: an array is its owner and its parent (for which
there is no need), its number of elements, the size of one, its address, its shape and its strides.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from numba.core.types import Type

__all__ = ["slotted", "types_of"]


def slotted(arguments: Sequence[object]) -> tuple[str, list[int]]:
    """The kinds of arguments, for which a kernel is compiled, and their slots.

    arguments : arrays, numbers, None, and tuples of these; raises TypeError for anything else
    """
    kinds: list[str] = []
    slots: list[int] = []
    for argument in arguments:
        _put(argument, kinds, slots)
    return " ".join(kinds), slots


def _put(value: object, kinds: list[str], slots: list[int]) -> None:
    match value:
        case np.ndarray():
            kinds.append(f"{value.dtype.str}{value.ndim}{_layout(value)}")
            where = value.__array_interface__["data"][0]
            slots += [0, 0, value.size, value.itemsize, where, *value.shape, *value.strides]
        case None:
            kinds.append("none")
            slots.append(0)
        case bool() | np.bool_():
            kinds.append("bool")
            slots.append(int(value))
        case float():  # numpy's float64 is one
            kinds.append("<f8")
            slots.append(int.from_bytes(struct.pack("=d", value), "little"))
        case int():
            kinds.append("<i8")
            slots.append(value)
        case np.generic():
            kinds.append(value.dtype.str)
            slots.append(int.from_bytes(value.tobytes(), "little"))
        case tuple():
            kinds.append(f"{type(value).__name__}{getattr(value, '_fields', '')}(")
            for held in value:
                _put(held, kinds, slots)
            kinds.append(")")
        case _:
            raise TypeError(f"a kernel takes arrays and numbers, not {type(value).__name__}.")


def _layout(array: NDArray[Any]) -> str:
    """How it lies in memory, as numba tells arrays apart: in rows, in columns, or in any way; on odd addresses."""
    flags = array.flags
    order = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
    return order if flags.aligned else f"{order}u"


def types_of(arguments: Sequence[object]) -> tuple[Type, ...]:
    """numba's types of arguments. Arrays that must not be written to are like any other: fewer kernels do."""
    return tuple(_type_of(argument) for argument in arguments)


def _type_of(value: object) -> Type:
    import numba

    kind: Type
    match value:
        case np.ndarray():
            kind = numba.typeof(value).copy(readonly=False)
        case tuple() if hasattr(value, "_fields"):
            kind = numba.types.NamedTuple(types_of(value), type(value))
        case tuple():
            kind = numba.types.Tuple(types_of(value))
        case _:
            kind = numba.typeof(value)
    return kind

"""Kernels as they are called: every kind of argument arrives whole, and what would not is refused."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.errors import EngineError
from aobake.tracing.arguments import slotted
from aobake.tracing.compiled import Kernel, kernel, operation
from aobake.tracing.foreign import array_at

FloatArray = NDArray[np.float64]


class Pair(NamedTuple):
    """A point and a weight."""

    point: FloatArray
    weight: float


@kernel
def write_down(array, numbers, pair, nothing, out):  # type: ignore[no-untyped-def]
    """Put all that was given into out."""
    for i in range(array.shape[0]):
        for k in range(array.shape[1]):
            out[i * array.shape[1] + k] = array[i, k]
    first = array.shape[0] * array.shape[1]
    out[first], out[first + 1] = numbers[0], numbers[1][0]
    out[first + 2], out[first + 3] = pair.point[1], pair.weight
    out[first + 4] = 1.0 if nothing is None else 0.0


@pytest.mark.parametrize("order", ["rows", "columns", "steps", "read-only", "half as wide"])
def test_arrays_of_any_layout_numbers_and_tuples_arrive_as_they_were_given(order: str) -> None:
    array = np.arange(12.0).reshape(3, 4)
    given = {
        "rows": array,
        "columns": np.asfortranarray(array),
        "steps": np.repeat(np.repeat(array, 2, 0), 3, 1)[::2, ::3],
        "read-only": array.copy(),
        "half as wide": array.astype(np.float32),
    }[order]
    given.flags.writeable = order != "read-only"
    out = np.zeros(17)
    write_down(given, (-7, (np.uint8(200),)), Pair(np.array([0.5, 1.5]), 2.5), None, out)
    assert out.tolist() == [*range(12), -7.0, 200.0, 1.5, 2.5, 1.0]


@kernel
def doubled(value):  # type: ignore[no-untyped-def]
    """Twice a number."""
    return value + value


@pytest.mark.parametrize(
    ("value", "expected"),
    [(-3, -6), (0.1, 0.2), (np.uint64(2**63 + 5), 10), (np.float64(np.inf), np.inf), (True, 2)],
)
def test_numbers_come_back_as_they_are(value: object, expected: object) -> None:
    assert doubled(value) == expected


def test_what_is_neither_an_array_nor_a_number_is_refused() -> None:
    with pytest.raises(TypeError, match="not list"):
        doubled([1.0])
    with pytest.raises(TypeError, match="by their places"):
        doubled(value=1.0)


def test_a_kernel_that_returns_an_array_is_refused() -> None:
    @kernel
    def same(array):  # type: ignore[no-untyped-def]
        return array

    with pytest.raises(EngineError, match="kernel same returns array"):
        same(np.zeros(3))


def test_kinds_tell_arguments_apart_that_are_compiled_differently() -> None:
    array = np.zeros((4, 4))
    kinds = [
        slotted((argument,))[0]
        for argument in (
            array, array[:, 0], array.astype(np.float32), np.zeros((2, 3)).T, array[0], array[::2, ::2],
            1, 1.0, np.float32(1.0), None, True, (1,), (1, 1), ((1,),), Pair(array[0], 1.0),
        )
    ]  # fmt: skip
    assert len(set(kinds)) == len(kinds)
    assert slotted((array,))[0] == slotted((np.ones((5, 7)),))[0]


def test_an_operation_is_what_its_definition_says() -> None:
    @operation
    def seven(typingctx, value):  # type: ignore[no-untyped-def]
        from numba import types

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            return builder.mul(arguments[0], context.get_constant(types.int64, 7))

        return types.int64(types.int64), generate

    def at(address, count):  # type: ignore[no-untyped-def]
        total = 0
        for value in array_at(address, count, np.int32):
            total += seven(value)
        return total

    values = np.array([1, 2, 30], np.int32)
    assert Kernel(at)(values.ctypes.data, len(values)) == 7 * 33

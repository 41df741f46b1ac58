"""Arrays of a scene: whatever is given becomes a checked array of one type that nobody can change."""

from __future__ import annotations

from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.errors import InputError

__all__ = [
    "FloatArray",
    "IntArray",
    "array_of",
    "frozen",
    "placement",
    "rows_of_three",
    "triangles_among",
]

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int32]
ScalarT = TypeVar("ScalarT", bound=np.generic)


def array_of(values: ArrayLike, what: str) -> NDArray[Any]:
    """An array of whatever is given. Raises InputError for rows of different lengths."""
    try:
        return np.asarray(values)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} are no array of numbers ({error}).") from error


def rows_of_three(values: ArrayLike, dtype: type[ScalarT], what: str) -> NDArray[ScalarT]:
    """(N, 3) C-ordered copy or view; (0, 3) for none; InputError for any other shape or kind.

    It is aligned: what lies at an odd place of a file is copied, for Embree would refuse it.
    """
    try:
        array: NDArray[ScalarT] = np.require(values, dtype, ["C", "A"])
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} are no array of numbers ({error}).") from error
    if array.size == 0:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{what} have the shape {array.shape}; (N, 3) is needed.")
    return array


def triangles_among(values: ArrayLike, vertices: int, where: str) -> IntArray:
    """(F, 3) int32 that point at so many vertices; InputError for any other shape, kind or number."""
    given = np.asarray(values)
    if given.size and given.dtype.kind not in "iu":
        raise InputError(f"{where}: faces are {given.dtype}; whole numbers are needed.")
    if given.size and not (int(given.min()) >= 0 and int(given.max()) < vertices):
        flat = given.reshape(-1)
        bad = int(np.argmax((flat < 0) | (flat >= vertices)))
        raise InputError(
            f"{where}: face {bad // 3} points at vertex {int(flat[bad])}; there are {vertices} vertices."
        )
    return rows_of_three(given, np.int32, f"{where}: faces")


def placement(values: ArrayLike, kind: str, name: str) -> FloatArray:
    """(4, 4) float64 of its own, read-only. Raises InputError for another shape."""
    transform = np.array(values, np.float64)
    if transform.shape != (4, 4):
        raise InputError(f"{kind} {name!r}: a transform is (4, 4), not {transform.shape}.")
    return frozen(transform)


def frozen(array: NDArray[ScalarT]) -> NDArray[ScalarT]:
    """A read-only view; the caller's own array stays as writable as it was."""
    view = array.view()
    view.flags.writeable = False
    return view

"""Directions as three arrays of components: what the models are written in.

A dot product over a last axis of three is several times slower in einsum or vecdot than three products
of columns, and the order of its sum is not the same on every machine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.errors import InputError

__all__ = ["Floats", "Vector", "as_floats", "as_vector", "cross", "dot", "plus"]

Floats = NDArray[np.floating]
Vector = tuple[Floats, Floats, Floats]


def as_floats(name: str, *values: ArrayLike) -> list[Floats]:
    """The values as arrays of one type: float32 where all of them are float32 arrays, else float64.

    Raises InputError for what is not real numbers; `name` says what they are.
    """
    arrays = []
    for value in values:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf":
            raise InputError(f"{name} of type {array.dtype} was given; real numbers are needed.")
        arrays.append(array)
    single = all(array.dtype == np.float32 for array in arrays)
    return [array.astype(np.float32 if single else np.float64, copy=False) for array in arrays]


def as_vector(name: str, array: Floats) -> Vector:
    """The components of (..., 3) vectors, each (...,). Raises InputError for another last axis."""
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(f"{name} has the shape {array.shape}; (..., 3) is needed.")
    return array[..., 0], array[..., 1], array[..., 2]


def dot(a: Vector, b: Vector) -> Floats:
    """The scalar product, (...,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def plus(a: Vector, b: Vector) -> Vector:
    """The sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]

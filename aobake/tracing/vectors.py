"""Three numbers as a vector, for kernels: tuples, which stay in registers; array rows are read into them.

Views of array rows would be counted references in compiled code, at three times the cost.
"""

from __future__ import annotations

import numpy as np

from aobake.tracing.compiled import inlined

__all__ = ["cross", "dot", "largest", "length", "minus", "row", "scaled"]


@inlined
def row(array, i):
    """Row i of an (N, 3) array, in float64."""
    return (float(array[i, 0]), float(array[i, 1]), float(array[i, 2]))


@inlined
def minus(a, b):
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inlined
def dot(a, b):
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """The vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inlined
def length(a):
    """The Euclidean length."""
    return np.sqrt(dot(a, a))


@inlined
def largest(a):
    """The largest coordinate, without its sign."""
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


@inlined
def scaled(a, size):
    """a / size."""
    return (a[0] / size, a[1] / size, a[2] / size)

"""Three numbers as a vector, for kernels: tuples, which stay in registers; array rows are read into them.

Views of array rows would be counted references in compiled code, at three times the cost.
"""

from __future__ import annotations

import numpy as np

from aobake.tracing.compiled import inlined

__all__ = ["cross", "dot", "length", "minus", "row"]


@inlined
def row(array, i):  # type: ignore[no-untyped-def]
    """Row i of an (N, 3) array, in float64."""
    return (float(array[i, 0]), float(array[i, 1]), float(array[i, 2]))


@inlined
def minus(a, b):  # type: ignore[no-untyped-def]
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inlined
def dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):  # type: ignore[no-untyped-def]
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inlined
def length(a):  # type: ignore[no-untyped-def]
    return np.sqrt(dot(a, a))

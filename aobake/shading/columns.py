"""Three rows of numbers as vectors, a picture's worth of them at a time: (3, N) float32.

numpy goes along the last axis: over one of three its loops would take several times as long.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["add_at", "dot", "some", "unit"]

Float32Array = NDArray[np.float32]


def dot(a: Float32Array, b: Float32Array) -> Float32Array:
    """(N,) scalar products of (3, N) vectors."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def some(vectors: Float32Array, chosen: NDArray[np.int64]) -> Float32Array:
    """(3, M) chosen ones of (3, N) vectors. vectors[:, chosen] takes three times as long."""
    return np.take(vectors, chosen, axis=1)


def add_at(vectors: Float32Array, chosen: NDArray[np.int64], more: Float32Array) -> None:
    """Add (3, M) to the chosen ones, all different, of (3, N) vectors."""
    for row, added in zip(vectors, more, strict=True):
        row[chosen] += added


def unit(vectors: Float32Array) -> Float32Array:
    """(3, N) vectors at length 1; zeros stay zeros."""
    length = np.sqrt(dot(vectors, vectors))
    return np.asarray(vectors / np.where(length > 0.0, length, np.float32(1.0)))

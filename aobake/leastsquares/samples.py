"""Samples inside triangles: how many each one gets, and where they lie.

Each triangle has a sequence of its own that goes on where it ended, so that a second round of samples
spreads between those of the first. Source of the sequence: M. Roberts, The unreasonable effectiveness of
quasirandom sequences, 2018 (R2); folded from the square onto the triangle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.scene import FloatArray

__all__ = ["more_samples", "places_in_triangles", "shares"]

IntArray = NDArray[np.int64]

PLASTIC = 1.32471795724474602596
STEPS = np.array([1.0 / PLASTIC, 1.0 / PLASTIC**2])
GOLDEN = np.array([0.6180339887498949, 0.4142135623730951])


def shares(weights: FloatArray, total: int) -> IntArray:
    """(N,) whole numbers in proportion to weights (N,) that add up to `total`; zeros for no weight at all.

    By rounding the running sum, so that no share is off by one or more.
    """
    whole = float(weights.sum())
    if len(weights) == 0 or not whole > 0.0:
        return np.zeros(len(weights), np.int64)
    ends = np.round(np.cumsum(weights) * (total / whole)).astype(np.int64)
    return np.diff(ends, prepend=0)


def more_samples(before: IntArray, added: IntArray) -> tuple[IntArray, IntArray]:
    """(triangle, number in the triangle's own sequence) of each new sample.

    before, added : (T,) samples that each triangle has, and gets
    """
    triangles = np.repeat(np.arange(len(added)), added)
    ends = np.cumsum(added)
    within = np.arange(len(triangles)) - np.repeat(ends - added, added)
    return triangles, within + before[triangles]


def places_in_triangles(triangles: IntArray, numbers: IntArray) -> FloatArray:
    """(S, 2) weights of the second and the third corner for samples of triangles' own sequences."""
    start = (triangles[:, None] * GOLDEN) % 1.0
    square = (0.5 + start + (numbers[:, None] + 1) * STEPS) % 1.0
    outside = square.sum(axis=1, keepdims=True) > 1.0
    return np.asarray(np.where(outside, 1.0 - square, square))

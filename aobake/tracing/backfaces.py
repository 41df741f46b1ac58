"""Hits from behind that do not count: decided by Embree's own traversal, on just the meshes that ask."""

from __future__ import annotations

import functools

import numpy as np

from aobake.tracing.compiled import callback
from aobake.tracing.embree import HitFilter
from aobake.tracing.foreign import array_at

__all__ = ["pass_through_backfaces"]


def _reject(arguments):
    """RTCFilterFunctionN: make hits invalid whose ray runs along the triangle's normal."""
    fields = array_at(arguments, 6, np.int64)
    count = np.int64(array_at(arguments, 12, np.int32)[10])
    valid = array_at(fields[0], count, np.int32)
    ray = array_at(fields[3], 12 * count, np.float32)
    hit = array_at(fields[4], 3 * count, np.float32)
    for k in range(count):
        along = 0.0
        for i in range(3):
            along += ray[(4 + i) * count + k] * hit[i * count + k]
        if valid[k] == -1 and along > 0.0:
            valid[k] = 0


@functools.cache
def pass_through_backfaces() -> HitFilter:
    """What lets rays through from behind; compiled when it is first needed."""
    return HitFilter(function=callback(_reject), sided=True)

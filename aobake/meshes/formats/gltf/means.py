"""One value for several: GPU instances of a node share what is kept at their vertices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.normals import unit_rows

__all__ = ["Values", "mean_direction", "mean_length", "mean_occlusion"]

Values = NDArray[np.float32]


def mean_occlusion(several: Sequence[Values]) -> Values:
    """(V,) within [0, 1]; 1 for what is no number."""
    mean = several[0]
    if len(several) > 1:
        mean = _mean([np.nan_to_num(values, nan=1.0) for values in several])
    return np.clip(np.nan_to_num(mean, nan=1.0), 0.0, 1.0).astype(np.float32, copy=False)


def mean_length(several: Sequence[Values]) -> Values:
    """(V,) from 0; 0 for what is no number."""
    mean = _mean([np.nan_to_num(values) for values in several])
    return np.maximum(mean, 0.0).astype(np.float32, copy=False)


def mean_direction(several: Sequence[Values]) -> Values:
    """(V, 3) at unit length."""
    total = np.nan_to_num(np.sum(several, axis=0, dtype=np.float64))
    return unit_rows(total).astype(np.float32)


def _mean(several: Sequence[Values]) -> Values:
    total = np.sum(several, axis=0, dtype=np.float64)
    return np.asarray(total / len(several), np.float32)

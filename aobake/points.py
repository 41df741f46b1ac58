"""Surface points: vertices or texels, the same thing from here on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["SurfacePoints"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfacePoints:
    """Where ambient occlusion is asked for.

    positions : (P, 3) float64, in the scene's space, finite
    normals : (P, 3) float64, unit length; the integral is taken over the hemisphere around them
    geometric : (P, 3) float64, unit length: directions below the surface itself do not count; or None
    numbers : (P,) int64, the index that makes a point's directions its own
    """

    positions: FloatArray
    normals: FloatArray
    geometric: FloatArray | None
    numbers: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.positions)

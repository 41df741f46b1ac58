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
    detail : (P,) float64, the size of what is to be told apart around each point; infinite: anything
    numbers : (P,) int64, the index that makes a point's directions its own
    """

    positions: FloatArray
    normals: FloatArray
    geometric: FloatArray | None
    detail: FloatArray
    numbers: NDArray[np.int64]

    def only(self, chosen: NDArray[np.int64]) -> SurfacePoints:
        """Some of the points, by their place in these arrays."""
        return SurfacePoints(
            positions=self.positions[chosen],
            normals=self.normals[chosen],
            geometric=None if self.geometric is None else self.geometric[chosen],
            detail=self.detail[chosen],
            numbers=self.numbers[chosen],
        )

    def __len__(self) -> int:
        return len(self.positions)

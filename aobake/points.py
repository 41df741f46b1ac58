"""Surface points: vertices or texels, the same thing from here on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.errors import InputError
from aobake.meshes.normals import unit_rows

__all__ = ["SurfacePoints", "given_points"]

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


def given_points(
    positions: ArrayLike, normals: ArrayLike, geometric_normals: ArrayLike | None
) -> tuple[SurfacePoints, int]:
    """The usable ones of points that a caller gives, numbered as given; and how many were given.

    positions, normals, geometric_normals : (P, 3) float; a point is usable where they are finite and
        the normals not zero
    Raises InputError for arrays of other shapes.
    """
    at = _rows("positions", positions)
    around = _matching("normals", normals, at)
    usable = np.isfinite(at).all(axis=1) & around.any(axis=1)
    above = None
    if geometric_normals is not None:
        above = _matching("geometric_normals", geometric_normals, at)
        usable &= above.any(axis=1)
    chosen = np.flatnonzero(usable)
    points = SurfacePoints(
        positions=at[chosen],
        normals=around[chosen],
        geometric=None if above is None else above[chosen],
        detail=np.full(len(chosen), np.inf),
        numbers=chosen,
    )
    return points, len(at)


def _rows(name: str, values: ArrayLike) -> FloatArray:
    try:
        array = np.ascontiguousarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} are no array of numbers ({error}).") from error
    if array.size == 0:
        return np.zeros((0, 3))
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{name} have the shape {array.shape}; (P, 3) is needed.")
    return array


def _matching(name: str, values: ArrayLike, positions: FloatArray) -> FloatArray:
    vectors = _rows(name, values)
    if len(vectors) != len(positions):
        raise InputError(
            f"there are {len(vectors)} {name} for {len(positions)} positions; one each is needed."
        )
    return unit_rows(vectors)

"""What rays tell besides how open a point is: where it is open, and how far one sees from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Gathered"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Gathered:
    """Sums over the rays of P points, those of one set weighed alike; None where nobody asked for them.

    directions : (P, 3) float64, of the directions of rays, each as much as it is open
    distances : (P,) float64, of how far rays got, none farther than `reach`, in units of the tree
    """

    directions: FloatArray | None
    distances: FloatArray | None
    reach: float

    @classmethod
    def blank(cls, count: int, *, bent: bool, reach: float | None) -> Gathered:
        """Nothing yet. reach : how far a ray counts at most, in units of the tree; None: distances are not asked for"""
        return cls(
            directions=np.zeros((count, 3)) if bent else None,
            distances=None if reach is None else np.zeros(count),
            reach=0.0 if reach is None else reach,
        )

    def part(self, count: int) -> Gathered:
        """The same kinds of sums for so many points, to be filled and then added."""
        reach = None if self.distances is None else self.reach
        return Gathered.blank(count, bent=self.directions is not None, reach=reach)

    def add(self, chosen: IntArray, part: Gathered, weights: FloatArray) -> None:
        """Add what a further set of each of the chosen points told. weights : (len(chosen),) of each ray of it"""
        if self.directions is not None and part.directions is not None:
            self.directions[chosen] += weights[:, None] * part.directions
        if self.distances is not None and part.distances is not None:
            self.distances[chosen] += weights * part.distances

    def for_kernel(self) -> tuple[FloatArray | None, tuple[float, FloatArray] | None]:
        """The last two arguments of kernels.trace."""
        if self.distances is None:
            return self.directions, None
        return self.directions, (self.reach, self.distances)

    def bent(self, traced: NDArray[np.bool_], normals: FloatArray) -> NDArray[np.float32] | None:
        """(P, 3) the mean open directions at unit length; the normals where nothing was open, or nothing traced.

        traced : (P,) which points were
        Source: H. Landis, Production-ready global illumination, SIGGRAPH course notes 16, 2002.
        """
        if self.directions is None:
            return None
        length = np.linalg.norm(self.directions, axis=1, keepdims=True)
        told = (length > 0.0) & traced[:, None]
        mean = self.directions / np.where(told, length, 1.0)
        return np.where(told, mean, normals).astype(np.float32)

    def mean_distance(self, weights: FloatArray) -> FloatArray | None:
        """(P,) how far one sees in the mean, in units of the tree; as far as counts where there was no ray.

        weights : (P,) of all rays that were added up
        """
        if self.distances is None:
            return None
        return np.where(weights > 0, self.distances / np.maximum(weights, 1.0), self.reach)

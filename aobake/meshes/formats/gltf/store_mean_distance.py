"""The mean distance to what is around as an attribute of its own, _MEAN_DISTANCE, in units of the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.means import mean_length
from aobake.meshes.formats.gltf.places import Key, Place

__all__ = ["MEAN_DISTANCE", "MeanDistanceStore"]

MEAN_DISTANCE = "_MEAN_DISTANCE"


class MeanDistanceStore:
    """_MEAN_DISTANCE, a float for each vertex; one that is there already is replaced."""

    normalized = False
    parts: tuple[slice, ...] = (slice(None),)
    mean = staticmethod(mean_length)

    def check(self, place: Place) -> None:
        """Every primitive can hold it."""

    def column(self, place: Place, values: NDArray[np.float32]) -> NDArray[np.generic]:  # noqa: ARG002
        """(V, 1) float32."""
        return values.reshape(-1, 1)

    def names(self, place: Place) -> tuple[str, ...]:  # noqa: ARG002
        """_MEAN_DISTANCE."""
        return (MEAN_DISTANCE,)

    def finish(self, edit: Edit, places: dict[Key, Place]) -> None:
        """Nothing else changes."""

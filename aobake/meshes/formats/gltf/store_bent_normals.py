"""Bent normals as an attribute of their own, _BENT_NORMAL, in the space of NORMAL."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.means import mean_direction
from aobake.meshes.formats.gltf.places import Key, Place

__all__ = ["BENT_NORMAL", "BentNormalStore"]

BENT_NORMAL = "_BENT_NORMAL"


class BentNormalStore:
    """_BENT_NORMAL, three floats for each vertex; one that is there already is replaced."""

    normalized = False
    parts: tuple[slice, ...] = (slice(None),)
    mean = staticmethod(mean_direction)

    def check(self, place: Place) -> None:
        """Every primitive can hold it."""

    def column(self, place: Place, values: NDArray[np.float32]) -> NDArray[np.generic]:  # noqa: ARG002
        """(V, 3) float32."""
        return values

    def names(self, place: Place) -> tuple[str, ...]:  # noqa: ARG002
        """_BENT_NORMAL."""
        return (BENT_NORMAL,)

    def finish(self, edit: Edit, places: dict[Key, Place]) -> None:
        """Nothing else changes."""

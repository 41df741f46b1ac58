"""Ambient occlusion as an attribute of its own, _AO: for programs that look for it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.means import mean_occlusion
from aobake.meshes.formats.gltf.places import Key, Place

__all__ = ["AO", "AttributeStore"]

AO = "_AO"


class AttributeStore:
    """_AO, a float for each vertex; one that is there already is replaced."""

    normalized = False
    parts: tuple[slice, ...] = (slice(None),)
    mean = staticmethod(mean_occlusion)

    def check(self, place: Place) -> None:
        """Every primitive can hold it."""

    def column(self, place: Place, ao: NDArray[np.float32]) -> NDArray[np.generic]:  # noqa: ARG002
        """(V, 1) float32."""
        return ao.reshape(-1, 1)

    def names(self, place: Place) -> tuple[str, ...]:  # noqa: ARG002
        """_AO: names of applications begin with an underscore."""
        return (AO,)

    def finish(self, edit: Edit, places: dict[Key, Place]) -> None:
        """Nothing else changes."""

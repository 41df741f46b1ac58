"""The ways to keep ambient occlusion in a primitive, behind one interface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.means import Values
from aobake.meshes.formats.gltf.places import Key, Place

__all__ = ["Store"]


class Store(Protocol):
    """One way to keep ambient occlusion."""

    normalized: bool
    """Whether the whole numbers of a column stand for [0, 1]."""

    parts: tuple[slice, ...]
    """Which components of a column each attribute reads."""

    def mean(self, several: Sequence[Values]) -> Values:
        """What is kept for GPU instances of one node, of the values of each."""

    def check(self, place: Place) -> None:
        """Raise OutputError where the primitive cannot hold it."""

    def column(self, place: Place, ao: NDArray[np.float32]) -> NDArray[np.generic]:
        """(V, components) as stored, of (V,) values in [0, 1]."""

    def names(self, place: Place) -> tuple[str, ...]:
        """The attributes that read the column, one for each of the parts."""

    def finish(self, edit: Edit, places: dict[Key, Place]) -> None:
        """What is to be changed beyond the attributes; places: (mesh, primitive) of the new JSON -> its place."""

"""Ambient occlusion multiplied into the vertex colours, COLOR_0: every viewer shows it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError, OutputError
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.formats.gltf.means import mean_occlusion
from aobake.meshes.formats.gltf.places import Key, Place

__all__ = ["ColorStore"]

NAME = "COLOR_0"
FULL = 65535  # 16 bits: in 8, a smooth gradient shows bands
TYPES = ("VEC3", "VEC4")


class ColorStore:
    """COLOR_0 times the occlusion, its alpha kept; grey with alpha one where there was none."""

    normalized = True
    parts: tuple[slice, ...] = (slice(None),)
    mean = staticmethod(mean_occlusion)

    def check(self, place: Place) -> None:
        """Raise OutputError where there are vertex colours that cannot be read."""
        self._existing(place)

    def column(self, place: Place, ao: NDArray[np.float32]) -> NDArray[np.generic]:
        """(V, 3) or (V, 4): float32 where the colours were, else uint16."""
        found = self._existing(place)
        if found is None:
            grey = np.full((len(ao), 4), FULL, np.uint16)
            grey[:, :3] = np.rint(ao * np.float32(FULL))[:, None]
            return grey
        if found.dtype == np.float32:
            colors = found.astype(np.float32)
            colors[:, :3] *= ao[:, None]
            return colors
        scale = 257 if found.dtype == np.uint8 else 1
        whole = found.astype(np.float64) * scale
        whole[:, :3] *= ao[:, None]
        return np.rint(whole).astype(np.uint16)

    def names(self, place: Place) -> tuple[str, ...]:  # noqa: ARG002
        """COLOR_0."""
        return (NAME,)

    def finish(self, edit: Edit, places: dict[Key, Place]) -> None:
        """Nothing else changes."""

    def _existing(self, place: Place) -> NDArray[np.generic] | None:
        """Colours as they are stored; None where there are none."""
        attributes = place.primitive.needed("attributes")
        if NAME not in attributes:
            return None
        cure = "Export it again, or keep the occlusion as an attribute (--store attribute)."
        try:
            values = place.reader.stored(place.primitive, NAME, TYPES)
            positions = place.reader.reader.accessor(attributes.integer("POSITION")).integer(
                "count"
            )
        except InputError as error:
            raise OutputError(str(error)) from error
        if values.dtype not in (np.uint8, np.uint16, np.float32):
            raise OutputError(
                f"{place.label}: {NAME} is {values.dtype}, which is no colour in glTF. {cure}"
            )
        if len(values) != positions:
            raise OutputError(
                f"{place.label}: {NAME} has {len(values)} values for {positions} vertices. {cure}"
            )
        accessor = place.reader.reader.accessor(attributes.integer(NAME))
        if values.dtype != np.float32 and not accessor.flag("normalized"):
            return values.astype(np.float32)  # such numbers mean themselves: 255 is no 1
        return values

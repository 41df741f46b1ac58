"""Ambient occlusion as an occlusion texture: an extra TEXCOORD set whose u looks it up in a gradient.

Stock viewers then darken ambient light only, which is what occlusionTexture means. Materials that are
also used without the new set are copied. The gradient does not change with v, so v is free to hold the
value itself, and _AO reads it there: programs find the same attribute as with the attribute store, and a
later bake finds the set that it may replace. Floats, since attributes start at multiples of four bytes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats.gltf.edit import NAME, Edit
from aobake.meshes.formats.gltf.gradient import coordinate, gradient_png
from aobake.meshes.formats.gltf.looks import Look, give_looks, with_occlusion
from aobake.meshes.formats.gltf.means import mean_occlusion
from aobake.meshes.formats.gltf.places import Key, Place
from aobake.meshes.formats.gltf.store_attribute import AO

__all__ = ["OcclusionStore", "free_set"]

MOST_SETS = 8
CLAMP_TO_EDGE, LINEAR = 33071, 9729


def free_set(place: Place) -> int:
    """The n of the TEXCOORD_n that an earlier bake has left, else the lowest one that is not there.

    Sets are numbered without a gap.
    """
    attributes = place.primitive.needed("attributes")
    ours = _view_of(place, AO)
    for n in range(len(attributes.value) + 1):
        name = f"TEXCOORD_{n}"
        if name not in attributes or (ours is not None and _view_of(place, name) == ours):
            return n
    raise OutputError(f"{place.label} has no texture coordinate set left.")


def _view_of(place: Place, name: str) -> int | None:
    """The buffer view that an attribute reads; None without one."""
    number = place.primitive.needed("attributes").maybe_integer(name)
    if number is None:
        return None
    return place.reader.reader.accessor(number).maybe_integer("bufferView")


class OcclusionStore:
    """TEXCOORD_n and a material that looks it up."""

    normalized = False
    parts: tuple[slice, ...] = (slice(None), slice(1, 2))
    mean = staticmethod(mean_occlusion)

    def check(self, place: Place) -> None:
        """Raise OutputError where the primitive has no texture coordinate set left."""
        if free_set(place) >= MOST_SETS:
            raise OutputError(
                f"{place.label} has {MOST_SETS} texture coordinate sets already, and the occlusion needs one "
                "more. Keep it in the vertex colours instead (--store color)."
            )

    def column(self, place: Place, ao: NDArray[np.float32]) -> NDArray[np.generic]:  # noqa: ARG002
        """(V, 2) float32: u looks the value up, v is the value itself."""
        return np.stack([coordinate(ao), ao], axis=1).astype(np.float32)

    def names(self, place: Place) -> tuple[str, ...]:
        """The first TEXCOORD_n that is free, and _AO."""
        return f"TEXCOORD_{free_set(place)}", AO

    def finish(self, edit: Edit, places: dict[Key, Place]) -> None:
        """Give every primitive a material whose occlusion texture reads its new set."""
        if not places:
            return
        texture = _texture(edit)
        looks = {key: Look(0, free_set(place)) for key, place in places.items()}
        give_looks(
            edit, looks, lambda material, look: with_occlusion(material, texture, look.uv_set)
        )


def _texture(edit: Edit) -> int:
    """The gradient as a new texture; its number."""
    view = edit.add_view(gradient_png())
    image = edit.append("images", {"bufferView": view, "mimeType": "image/png", "name": NAME})
    sampler = edit.append(
        "samplers",
        {"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE},
    )
    return edit.append("textures", {"sampler": sampler, "source": image})

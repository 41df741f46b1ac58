"""Sheets with alpha: a square overhead, the picture on it, the scene that they make."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from aobake.images import encode
from aobake.meshes.scene import Attribute, Image, Instance, Material, Mesh, Scene, Texture
from tests.scenes import FloatArray, Triangles, flipped, floor

__all__ = ["UNIT", "hole", "image_of", "overhead", "scene_of", "sheet"]

UNIT = Texture(image=0)


def image_of(alpha: NDArray[np.float64]) -> Image:
    """A white PNG with this alpha, (H, W) in [0, 1], 8 bits; no 16-bit rounding: values are used as they are."""
    pixels = np.ones((*alpha.shape, 4), np.float32)
    pixels[..., 3] = np.round(alpha * 255.0) / 255.0
    data = encode(pixels, "png")
    return Image(name="alpha.png", data=lambda: data)


def hole(size: int, radius: float, *, inside: float = 0.0, outside: float = 1.0) -> FloatArray:
    """(size, size) alpha of a disc in the middle of a square that reaches from -1 to 1, its edge a texel wide."""
    middle = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    x, y = np.meshgrid(middle, middle)
    share = np.clip(0.5 + (np.hypot(x, y) - radius) * size / 2.0, 0.0, 1.0)
    return np.asarray(inside + share * (outside - inside))


def sheet(
    half: float, height: float, cells: int = 1, material: int = 0, repeats: float = 1.0
) -> Mesh:
    """A square that looks down, [-half, half]^2 at a height, with the picture on it `repeats` times each way."""
    made: Triangles = flipped(floor(half, height, cells))
    uv = (made.vertices[:, :2] / half + 1.0) / 2.0 * repeats
    return Mesh(
        vertices=made.vertices,
        faces=made.faces,
        name="sheet",
        material=material,
        attributes={"TEXCOORD_0": Attribute(values=uv)},
    )


def overhead(
    alpha: FloatArray | None, half: float = 1.0, height: float = 0.5, **settings: object
) -> Scene:
    """One sheet above the origin; settings : of its material, MASK unless they say otherwise."""
    given: Mapping[str, object] = {
        "name": "leaf",
        "alpha_mode": "MASK",
        "double_sided": True,
        "base_color_texture": None if alpha is None else UNIT,
        **settings,
    }
    material = Material(**given)  # type: ignore[arg-type]
    images = () if alpha is None else (image_of(alpha),)
    return scene_of([sheet(half, height)], [material], images)


def scene_of(
    meshes: list[Mesh],
    materials: list[Material],
    images: tuple[Image, ...] = (),
    transforms: list[FloatArray] | None = None,
) -> Scene:
    """Each mesh once, or the first one at each of the transforms."""
    if transforms is not None:
        instances = tuple(Instance(mesh=0, transform=transform) for transform in transforms)
    else:
        instances = tuple(Instance(mesh=number) for number in range(len(meshes)))
    return Scene(
        meshes=tuple(meshes), instances=instances, materials=tuple(materials), images=images
    )

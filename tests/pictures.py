"""Scenes to take pictures of, and how to look at them."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.images import encode
from aobake.meshes.scene import Attribute, Camera, Image, Instance, Light, Material, Mesh, Scene
from aobake.render_settings import RenderSettings
from aobake.shading.preview import Preview
from tests.scenes import Triangles, affine, floor

Float32Array = NDArray[np.float32]

DIM = RenderSettings(size="32x32", samples=4, lights="none", ambient=1.0)  # ambient light alone
BEAUTY = dataclasses.replace(DIM, lights="auto", ambient=0.25)


def looking_down_z(height: float = 2.0, **more: object) -> Camera:
    """An orthographic camera at z = 10 that sees [-height/2, height/2] along y."""
    place = affine(1.0, (0.0, 0.0, 10.0))
    return Camera(transform=place, yfov_rad=None, height=height, **more)  # type: ignore[arg-type]


def sunlight(towards: ArrayLike, intensity: float = 1.0) -> Light:
    """A directional light that shines along a direction."""
    backward = -np.asarray(towards, np.float64)
    place = np.eye(4)
    place[:3, 2] = backward / np.linalg.norm(backward)
    return Light(kind="directional", transform=place, intensity=intensity)


def scene_of(*meshes: Mesh, materials: tuple[Material, ...] = (), **more: object) -> Scene:
    """Meshes where they are, seen by an orthographic camera along -z unless another is given."""
    given = {"cameras": (looking_down_z(),), **more}
    places = tuple(Instance(mesh=number) for number in range(len(meshes)))
    scene = Scene(meshes=meshes, instances=places, materials=materials)
    return dataclasses.replace(scene, **given)  # type: ignore[arg-type]


def card(z: float = 0.0, half: float = 1.0) -> Triangles:
    """A square that faces +z."""
    return floor(half, z)


CARD_UV = np.array([(0.0, 1.0), (0.0, 0.0), (1.0, 1.0), (1.0, 0.0)])  # of card's vertices


def attribute(values: ArrayLike) -> Attribute:
    """Values at vertices."""
    array = np.asarray(values, np.float64)
    return Attribute(values=array[:, None] if array.ndim == 1 else array)


def image(pixels: ArrayLike, name: str = "image") -> Image:
    """A PNG in memory."""
    data = encode(np.asarray(pixels, np.float32), "png", "8")
    return Image(name=name, data=lambda: data)


def middle(preview: Preview) -> Float32Array:
    """(4,) the pixel in the middle."""
    height, width = preview.pixels.shape[:2]
    return np.asarray(preview.pixels[height // 2, width // 2])


def one_sun(towards: tuple[float, float, float]) -> tuple[Light, ...]:
    """The lights of a scene that the sun alone shines on."""
    return (sunlight(towards),)

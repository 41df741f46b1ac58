"""Scenes to take pictures of, and how to look at them."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.images import encode
from aobake.meshes.scene import Attribute, Camera, Image, Instance, Light, Material, Mesh, Scene
from aobake.render_settings import RenderSettings
from tests.scenes import Triangles, patch

Float32Array = NDArray[np.float32]

DIM = RenderSettings(size="32x32", samples=4, lights="none", ambient=1.0)  # ambient light alone


def mesh(triangles: Triangles, **more: object) -> Mesh:
    """A mesh with whatever else is given."""
    return Mesh(vertices=triangles.vertices, faces=triangles.faces, **more)  # type: ignore[arg-type]


def looking_down_z(height: float = 2.0, **more: object) -> Camera:
    """An orthographic camera at z = 10 that sees [-height/2, height/2] along y."""
    place = np.eye(4)
    place[2, 3] = 10.0
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
    x = half
    return patch((-x, -x, z), (x, -x, z), (x, x, z), (-x, x, z))


CARD_UV = np.array([(0.0, 1.0), (0.0, 0.0), (1.0, 1.0), (1.0, 0.0)])  # of card's vertices


def attribute(values: ArrayLike) -> Attribute:
    """Values at vertices."""
    array = np.asarray(values, np.float64)
    return Attribute(values=array[:, None] if array.ndim == 1 else array)


def image(pixels: ArrayLike, name: str = "image") -> Image:
    """A PNG in memory."""
    data = encode(np.asarray(pixels, np.float32), "png", "8")
    return Image(name=name, data=lambda: data)

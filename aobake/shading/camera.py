"""Cameras: one that frames what is there, those of a file, and the rays that they send out.

Samples lie in the same places in every pixel of the left half of a picture, and in mirrored places in
the right half: a mirror-symmetric scene gives a mirror-symmetric picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.scene import Camera, Scene
from aobake.settings import GroundAxis
from aobake.shading.columns import unit
from aobake.tracing.conditioning import UnitFrame

__all__ = ["View", "axes_from", "extent", "framing", "of_file", "rays", "sample_places"]

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]

MARGIN = 1.12  # how much wider the frame is than what it frames
STAND_OFF = 0.25  # least distance, in depths of what is framed: else a nose may touch the lens
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
MANY = 1 << 22  # vertices beyond which boxes stand for meshes


@dataclass(frozen=True, eq=False, kw_only=True)
class View:
    """A camera in the scene's space.

    position : (3,) float64
    axes : (3, 3) float64, rows: right, up and backward, of length 1
    half_height : tangent of half the vertical angle, or half the height where it is orthographic
    orthographic : whether its rays are parallel
    """

    position: FloatArray
    axes: FloatArray
    half_height: float
    orthographic: bool = False


def extent(scene: Scene) -> list[FloatArray]:
    """Clouds of points, one per instance that has finite faces, that are as wide as the scene."""
    boxed = scene.vertices > MANY
    used: dict[int, FloatArray] = {}
    clouds = []
    for instance, mesh in scene.placed():
        if instance.mesh not in used:
            used[instance.mesh] = _used_points(mesh.vertices, mesh.faces, boxed)
        points = used[instance.mesh]
        if len(points) and np.isfinite(instance.transform).all():
            clouds.append(points @ instance.transform[:3, :3].T + instance.transform[:3, 3])
    return clouds


def _used_points(vertices: FloatArray, faces: NDArray[np.int32], boxed: bool) -> FloatArray:
    mask = np.zeros(len(vertices), bool)
    mask[faces.reshape(-1)] = True
    points = vertices[mask & np.isfinite(vertices).all(axis=1)]
    if boxed and len(points):
        low, high = points.min(axis=0), points.max(axis=0)
        bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
        return np.asarray(np.where(bits == 1, high, low))
    return np.asarray(points)


def axes_from(azimuth: float, elevation: float, up: GroundAxis) -> FloatArray:
    """(3, 3) rows right, up and backward of a camera that looks from there, in degrees.

    0, 0 looks at the front: from +z where +y is up, as glTF has it, and from -y where +z is up.
    """
    a, e = math.radians(azimuth), math.radians(elevation)
    right = np.array([math.cos(a), 0.0, -math.sin(a)])
    backward = np.array([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)])
    axes = np.stack([right, np.cross(backward, right), backward])
    if up == "+z":
        axes = np.stack([axes[:, 0], -axes[:, 2], axes[:, 1]], axis=1)
    return axes


def framing(
    clouds: Iterable[FloatArray], axes: FloatArray, half_height: float, aspect: float
) -> View:
    """The nearest perspective camera with these axes that sees all points, with a margin around them.

    clouds : (N, 3) float64 each; without a point, it looks at the origin from a distance of 1
    half_height : tangent of half the vertical angle; aspect : width by height of the picture
    """
    across = np.array([half_height * aspect, half_height]) / MARGIN
    high, low = np.full(2, -np.inf), np.full(2, np.inf)
    nearest, farthest = -np.inf, np.inf
    for cloud in clouds:
        local = cloud @ axes.T
        nearest = max(nearest, float(local[:, 2].max()))
        farthest = min(farthest, float(local[:, 2].min()))
        # |x - cx| <= t (cz - z) on both sides: x + t z is largest on one, x - t z smallest on the other.
        high = np.maximum(high, (local[:, :2] + across * local[:, 2:]).max(axis=0))
        low = np.minimum(low, (local[:, :2] - across * local[:, 2:]).min(axis=0))
    if not np.isfinite(high).all():
        return View(position=axes[2].copy(), axes=axes, half_height=half_height)
    back = float(((high - low) / (2.0 * across)).max())
    back = max(back, nearest + STAND_OFF * (nearest - farthest))
    center = (high + low) / 2.0
    position = np.array([*center, back]) @ axes
    return View(position=position, axes=axes, half_height=half_height)


def of_file(scene: Scene, name: str | None) -> View:
    """A camera of the scene, the first one where no name or number is given.

    Raises InputError where there is none of that name.
    """
    names = [camera.name for camera in scene.cameras]
    if name is None:
        return _placed(scene.cameras[0])
    if name in names:
        return _placed(scene.cameras[names.index(name)])
    if name.isascii() and name.isdigit() and int(name) < len(names):
        return _placed(scene.cameras[int(name)])
    known = ", ".join(
        f"{number} ({label})" if label else str(number) for number, label in enumerate(names)
    )
    there = f"there are {known}" if names else "the asset has none; leave it out to frame the asset"
    raise InputError(f"camera is {name!r}; {there}.")


def _placed(camera: Camera) -> View:
    linear = camera.transform[:3, :3].T
    lengths = np.linalg.norm(linear, axis=1)
    if not (np.isfinite(camera.transform).all() and (lengths > 0.0).all()):
        raise InputError(f"camera {camera.name!r} has no place; leave it out (camera frame).")
    if camera.yfov_rad is not None:
        half = math.tan(camera.yfov_rad / 2.0)
    else:
        half = (camera.height or 1.0) / 2.0 * float(lengths[1])
    return View(
        position=camera.transform[:3, 3],
        axes=linear / lengths[:, None],
        half_height=half,
        orthographic=camera.yfov_rad is None,
    )


def sample_places(count: int) -> FloatArray:
    """(count, 2) places in the unit square, spread evenly: a lattice turned by the golden ratio."""
    k = np.arange(count) + 0.5
    return np.stack([k / count, (k * GOLDEN) % 1.0], axis=1)


def rays(
    view: View, frame: UnitFrame, size: tuple[int, int], rows: range, places: FloatArray
) -> tuple[Float32Array, Float32Array]:
    """Origins and unit directions, (3, R S W) float32 in units of the frame, of rows of pixels.

    size : width and height of the picture; rows : from the top; places : of the S samples in a pixel
    Of each row the first samples of all pixels come first: neighbours in a packet are neighbours in the
    picture.
    """
    width, height = size
    pixel = 2.0 * view.half_height / height
    x = np.arange((width + 1) // 2) + places[:, :1] - width / 2
    x = np.concatenate([x, -x[:, : width // 2][:, ::-1]], axis=1)  # mirrored to the last bit
    y = height / 2 - (np.array(rows)[:, None] + places[:, 1])
    shape = (len(rows), len(places), width)
    across = np.broadcast_to((pixel * x).astype(np.float32), shape).reshape(-1)
    above = np.broadcast_to((pixel * y).astype(np.float32)[:, :, None], shape).reshape(-1)
    right, up, backward = view.axes.astype(np.float32)[:, :, None]
    position = frame.apply(view.position[None]).astype(np.float32).reshape(3, 1)
    if view.orthographic:
        scale = np.float32(frame.scale)
        origins = position + (scale * across) * right + (scale * above) * up
        return origins, np.repeat(-backward, len(across), axis=1)
    directions = unit(across * right + above * up - backward)
    return np.repeat(position, len(across), axis=1), directions

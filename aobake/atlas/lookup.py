"""Images looked up as a renderer does it: bilinear or nearest, repeated, mirrored or clamped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.scene import FloatArray, Texture, Wrap

__all__ = ["looked_up", "sample"]

AT_ONCE = 1 << 18  # places; what is in between stays in the cache and takes 50 MiB at the most


def looked_up(texture: Texture, pixels: NDArray[np.float32], uv: FloatArray) -> NDArray[np.float32]:
    """(N, C) values of a material's texture at (N, 2) coordinates of its set, transformed as it says.

    pixels : (H, W) or (H, W, C) float32, the decoded image, row 0 at the top. Raises as `sample`.
    """
    if texture.transform is not None:
        uv = uv @ texture.transform[:, :2].T + texture.transform[:, 2]
    return sample(pixels, uv, texture.wrap, texture.nearest)


def sample(
    pixels: NDArray[np.float32],
    uv: FloatArray,
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat"),
    nearest: bool = False,
) -> NDArray[np.float32]:
    """Values of an image between its pixels.

    pixels : (H, W) or (H, W, C) float32, row 0 at the top
    uv : (N, 2), the unit square spans the image, v runs down; what is not finite is looked up at 0
    wrap : what lies outside of the unit square, along u and along v
    nearest : take the pixel that the place is in, instead of the four around it
    Returns (N, C) float32, C = 1 for (H, W). Raises InputError for an image without pixels.
    """
    if pixels.size == 0:
        raise InputError(f"an image of the shape {pixels.shape} has no pixels to look up.")
    image = pixels if pixels.ndim == 3 else pixels[..., None]
    found = np.empty((len(uv), image.shape[2]), np.float32)
    look = _nearest if nearest else _bilinear
    for first in range(0, len(uv), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        found[part] = look(image, np.where(np.isfinite(uv[part]), uv[part], 0.0), wrap)
    return found


def _nearest(
    image: NDArray[np.float32], uv: FloatArray, wrap: tuple[Wrap, Wrap]
) -> NDArray[np.float32]:
    height, width = image.shape[:2]
    column = np.floor(_near(uv[:, 0], wrap[0]) * width).astype(np.int64)
    row = np.floor(_near(uv[:, 1], wrap[1]) * height).astype(np.int64)
    return image[_wrapped(row, height, wrap[1]), _wrapped(column, width, wrap[0])]


def _bilinear(
    image: NDArray[np.float32], uv: FloatArray, wrap: tuple[Wrap, Wrap]
) -> NDArray[np.float32]:
    left, right, x = _neighbours(uv[:, 0], image.shape[1], wrap[0])
    above, below, y = _neighbours(uv[:, 1], image.shape[0], wrap[1])
    upper = (1.0 - x) * image[above, left] + x * image[above, right]
    lower = (1.0 - x) * image[below, left] + x * image[below, right]
    return np.asarray((1.0 - y) * upper + y * lower, np.float32)


def _neighbours(
    along: FloatArray, count: int, wrap: Wrap
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
    """The two pixels on either side of each place along an axis, and (N, 1) the weight of the second."""
    place = _near(along, wrap) * count - 0.5
    first = np.floor(place)
    weight = (place - first).astype(np.float32)[:, None]
    number = first.astype(np.int64)
    return _wrapped(number, count, wrap), _wrapped(number + 1, count, wrap), weight


def _near(along: FloatArray, wrap: Wrap) -> FloatArray:
    """Coordinates that look up the same, near the unit square: a pixel's number must not overflow."""
    if wrap == "clamp":
        return np.clip(along, -1.0, 2.0)
    return np.mod(along, 2.0)


def _wrapped(number: NDArray[np.int64], count: int, wrap: Wrap) -> NDArray[np.int64]:
    """The pixels of a row of `count` that pixels of the endless row are."""
    if wrap == "clamp":
        return np.clip(number, 0, count - 1)
    if wrap == "repeat":
        return np.mod(number, count)
    turn = np.mod(number, 2 * count)
    return np.asarray(np.minimum(turn, 2 * count - 1 - turn))

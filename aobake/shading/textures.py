"""The textures of materials, decoded when a ray first meets one, and kept no finer than a picture shows."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.scene import Image, Material, Scene, Texture

__all__ = ["TextureStore", "used_images"]

Float32Array = NDArray[np.float32]

MOST_TEXELS = 1 << 26  # of all textures together, 0.8 GB
SMALLEST_SIDE = 256


class TextureStore:
    """Decoded images of a scene, for several threads at once.

    An image that cannot be decoded is left out, and `warnings` says so.
    """

    def __init__(self, scene: Scene, longest_side: int) -> None:
        """longest_side : of the picture in pixels: a texture is seldom seen finer than that."""
        self._images = scene.images
        self._side = _allowed_side(longest_side, len(used_images(scene)))
        self._pixels: dict[tuple[int, bool], Float32Array | None] = {}
        self._lock = threading.Lock()
        self._failed: dict[int, str] = {}

    def lookup(
        self, texture: Texture, uv: NDArray[np.float64], *, srgb: bool
    ) -> Float32Array | None:
        """(N, 4) float32 linear values at texture coordinates (N, 2); None where the image is unusable.

        srgb : whether colours are stored as sRGB; alpha never is
        """
        from aobake.atlas.lookup import looked_up

        pixels = self._decoded(texture.image, srgb)
        if pixels is None:
            return None
        return looked_up(texture, pixels, uv)

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line for each image that could not be used, in the order of the images."""
        return tuple(self._failed[number] for number in sorted(self._failed))

    def _decoded(self, number: int, srgb: bool) -> Float32Array | None:
        key = (number, srgb)
        if key not in self._pixels:
            with self._lock:
                if key not in self._pixels:
                    self._pixels[key] = self._read(number, srgb)
        return self._pixels[key]

    def _read(self, number: int, srgb: bool) -> Float32Array | None:
        try:
            return _read(self._images[number], self._side, srgb)
        except (InputError, IndexError) as error:
            name = self._images[number].name if 0 <= number < len(self._images) else str(number)
            self._failed[number] = f"image {name!r} is not shown: {error}"
            return None


def used_images(scene: Scene) -> set[int]:
    """Numbers of the images that a preview may look up."""
    pick: tuple[Callable[[Material], Texture | None], ...] = (
        lambda m: m.base_color_texture,
        lambda m: m.emissive_texture,
        lambda m: m.occlusion_texture,
    )
    found = (choose(material) for material in scene.materials for choose in pick)
    return {texture.image for texture in found if texture is not None}


def _allowed_side(longest: int, images: int) -> int:
    """The longest side of a kept image: a power of two."""
    side = SMALLEST_SIDE
    while side < longest:
        side *= 2
    while side > SMALLEST_SIDE and images * side * side > MOST_TEXELS:
        side //= 2
    return side


def _read(image: Image, longest: int, srgb: bool) -> Float32Array:
    """(H, W, 4) float32, linear. Colours are made linear before they are averaged."""
    from aobake.images import decode, resized
    from aobake.shading.tone import from_srgb

    stored = decode(image.data(), image.name)
    step = max(
        1, max(stored.shape[:2]) // (2 * longest)
    )  # far more pixels than show are not all read
    stored = stored[::step, ::step]
    pixels = np.ones((*stored.shape[:2], 4), np.float32)
    grey = stored.shape[2] < 3
    pixels[..., :3] = stored[..., :1] if grey else stored[..., :3]
    if stored.shape[2] in {2, 4}:
        pixels[..., 3] = stored[..., -1]
    if srgb:
        pixels[..., :3] = from_srgb(pixels[..., :3])
    height, width = pixels.shape[:2]
    while max(height, width) > longest:
        height, width = max(1, height // 2), max(1, width // 2)
    if (height, width) != pixels.shape[:2]:
        pixels = resized(pixels, width, height)
    return np.ascontiguousarray(pixels, np.float32)

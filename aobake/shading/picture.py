"""From a preview to an image file: background, tone, the display's curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.images import KINDS, encode
from aobake.render_settings import RenderSettings, color_of
from aobake.settings import Encoding
from aobake.shading.preview import Preview
from aobake.shading.tone import from_srgb, to_srgb, toned

__all__ = ["as_light", "displayed", "encoded", "encoded_sheet"]

Float32Array = NDArray[np.float32]

GRADIENT = ("#a9b4bf", "#e4e8ec")  # at the top, at the bottom
COLORS = {"beauty", "albedo"}  # channels that are light; the others are numbers


def displayed(preview: Preview) -> Float32Array:
    """(H, W, 3) float32 in [0, 1] as a display takes them; (H, W, 4) on a transparent background."""
    settings, pixels = preview.settings, preview.pixels
    alpha = pixels[..., 3:]
    color = (pixels[..., :3] / np.maximum(alpha, 1e-6)).astype(np.float32)
    if settings.channel == "beauty":
        color = toned(color, settings.tone, settings.exposure)
    color = np.clip(color, 0.0, 1.0).astype(np.float32)
    light = settings.channel in COLORS
    if settings.background == "transparent":
        shown = to_srgb(color) if light else color
        return np.concatenate([shown, alpha], axis=2)
    behind = _backdrop(settings, len(pixels))
    if not light:
        return np.asarray(color * alpha + (1.0 - alpha) * behind, np.float32)
    return to_srgb(np.asarray(color * alpha + (1.0 - alpha) * from_srgb(behind)))


def as_light(preview: Preview) -> Float32Array:
    """(H, W, 4) float32, linear and multiplied by alpha, for EXR; opaque unless the background is transparent."""
    settings, pixels = preview.settings, preview.pixels
    if settings.background == "transparent":
        return pixels
    behind = _backdrop(settings, len(pixels))
    if settings.channel in COLORS:
        behind = from_srgb(behind)
    result = np.ones_like(pixels)
    result[..., :3] = pixels[..., :3] + (1.0 - pixels[..., 3:]) * behind
    return result


def _backdrop(settings: RenderSettings, height: int) -> Float32Array:
    """(H, 1, 3) float32 of a background that is not transparent, as a display takes it."""
    if settings.background != "gradient":
        return np.broadcast_to(np.array(color_of(settings.background), np.float32), (height, 1, 3))
    top, bottom = (np.array(color_of(color), np.float32) for color in GRADIENT)
    share = ((np.arange(height, dtype=np.float32) + 0.5) / height)[:, None, None]
    return np.asarray(top + share * (bottom - top), np.float32)


def encoded(preview: Preview, suffix: str, encoding: Encoding | None = None) -> bytes:
    """The image file of a preview.

    suffix : '.png', '.tif', '.tiff' or '.exr', which holds linear light
    encoding : None: 8 bits, or half in EXR
    Raises OutputError for an encoding that the kind cannot hold.
    """
    if KINDS[suffix] == "exr":
        return encode(as_light(preview), "exr", encoding or "half")
    light = preview.settings.channel in COLORS
    return encode(displayed(preview), KINDS[suffix], encoding or "8", srgb=light)


def encoded_sheet(pixels: Float32Array, suffix: str, encoding: Encoding | None = None) -> bytes:
    """The image file of (H, W, 3 or 4) pixels as a display takes them; the rest as for encoded."""
    if KINDS[suffix] != "exr":
        return encode(pixels, KINDS[suffix], encoding or "8", srgb=True)
    light = pixels.copy()
    light[..., :3] = from_srgb(pixels[..., :3])
    if pixels.shape[2] == 4:
        light[..., :3] *= pixels[..., 3:]
    return encode(light, "exr", encoding or "half")

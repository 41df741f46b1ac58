"""From linear light to what a display is given, and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.render_settings import Tone

__all__ = ["from_srgb", "to_srgb", "toned"]

Float32Array = NDArray[np.float32]


def to_srgb(linear: Float32Array) -> Float32Array:
    """sRGB's curve over values of any shape; outside of [0, 1] they are cut off. Source: IEC 61966-2-1."""
    x = np.clip(linear, 0.0, 1.0)
    low = np.float32(12.92) * x
    high = np.float32(1.055) * x ** np.float32(1.0 / 2.4) - np.float32(0.055)
    return np.where(x <= 0.0031308, low, high).astype(np.float32)


def from_srgb(encoded: Float32Array) -> Float32Array:
    """The inverse of to_srgb, over values of any shape in [0, 1]."""
    x = np.asarray(encoded, np.float32)
    low = x / np.float32(12.92)
    high = ((x + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(x <= 0.04045, low, high).astype(np.float32)


def toned(linear: Float32Array, tone: Tone, exposure: float) -> Float32Array:
    """Linear light in [0, inf) brought into [0, 1], still linear, after so many stops of exposure.

    Filmic source: J. Hable, Filmic tonemapping operators, 2010 (Uncharted 2), with white at 4.
    """
    bright = linear * np.float32(2.0**exposure)
    if tone == "plain":
        return np.asarray(np.clip(bright, 0.0, 1.0))
    return np.asarray(np.clip(_filmic(2.0 * bright) / _filmic(np.float32(4.0)), 0.0, 1.0))


def _filmic(x: Float32Array | np.float32) -> Float32Array:
    a, b, c, d, e, f = (np.float32(v) for v in (0.15, 0.50, 0.10, 0.20, 0.02, 0.30))
    return np.asarray((x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f)

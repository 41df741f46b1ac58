"""The picture that turns a texture coordinate into its own value."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

__all__ = ["HEIGHT", "WIDTH", "coordinate", "gradient_png"]

WIDTH = 256
HEIGHT = 4  # texture compression works on blocks of four


def gradient_png() -> bytes:
    """An 8-bit grey PNG whose column k has the value k. Source: PNG, third edition."""
    row = b"\0" + bytes(range(WIDTH))
    head = struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 0, 0, 0, 0)
    body = zlib.compress(row * HEIGHT, 9)
    return (
        b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", head) + _chunk(b"IDAT", body) + _chunk(b"IEND", b"")
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def coordinate(values: NDArray[np.float32]) -> NDArray[np.float64]:
    """The u at which a linear filter gives the value: from the centre of the first texel to that of the last.

    values : (N,) in [0, 1]
    """
    return (values.astype(np.float64) * (WIDTH - 1) + 0.5) / WIDTH

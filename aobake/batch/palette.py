"""Small pictures as small PNG files: a palette of at most 256 colours."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

__all__ = ["png_of"]

ByteArray = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

MOST_COLORS = 256
LEVEL = 6  # of zlib


def png_of(pixels: ByteArray) -> bytes:
    """A PNG with a palette; the same bytes for the same pixels.

    pixels : (H, W, 3) uint8, as displays take them
    Colours that are nearly the same become one; where more than 256 are left, each becomes the nearest of 256.
    """
    height, width = pixels.shape[:2]
    colors, index = _quantised(pixels.reshape(-1, 3))
    rows = np.zeros((height, width + 1), np.uint8)  # each begins with its filter: none
    rows[:, 1:] = index.reshape(height, width)
    header = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        (
            _chunk(b"IHDR", header),
            _chunk(b"PLTE", colors.tobytes()),
            _chunk(b"IDAT", zlib.compress(rows.tobytes(), LEVEL)),
            _chunk(b"IEND", b""),
        )
    )


def _quantised(pixels: ByteArray) -> tuple[ByteArray, ByteArray]:
    """(K, 3) colours, K at most 256, and (N,) which of them each pixel is."""
    colors, counts, which = _cells(pixels)
    if len(colors) <= MOST_COLORS:
        return np.rint(colors).astype(np.uint8), which.astype(np.uint8)
    palette = _palette(colors, counts)
    # |a - b|^2 less |a|^2, which is the same for all colours of the palette
    far = (palette**2).sum(axis=1) - 2.0 * colors @ palette.T
    nearest = far.argmin(axis=1).astype(np.uint8)
    return np.rint(palette).astype(np.uint8), nearest[which]


def _palette(colors: FloatArray, counts: NDArray[np.int64]) -> FloatArray:
    """(256, 3) colours for more cells: half of them so that none is far from one, the others where most are."""
    side, coarse = 16, np.empty((0, 3))
    while not 0 < len(coarse) <= MOST_COLORS // 2:
        _, cube = np.unique(colors // side, axis=0, return_inverse=True)
        weight = np.bincount(cube, counts)
        bands = [np.bincount(cube, counts * band) / weight for band in colors.T]
        side, coarse = 2 * side, np.stack(bands, axis=1)
    most = np.argsort(-counts, kind="stable")[: MOST_COLORS - len(coarse)]
    return np.concatenate([coarse, colors[most]])


def _cells(pixels: ByteArray) -> tuple[FloatArray, NDArray[np.int64], NDArray[np.int64]]:
    """(K, 3) means of the cells of colours that occur, (K,) pixels in each, and (N,) the cell of each pixel.

    A cell is 6 bits of green, and 5 of how much redder and how much bluer it is: greys are told apart best.
    """
    bands = np.ascontiguousarray(pixels.T)
    red, green, blue = bands.astype(np.int16)
    keys = (green >> 2 << 10) | ((red - green + 256) >> 4 << 5) | ((blue - green + 256) >> 4)
    inside = np.bincount(keys.view(np.uint16))
    cells = np.flatnonzero(inside)
    number = np.empty(len(inside), np.int64)
    number[cells] = np.arange(len(cells))
    which, counts = number[keys.view(np.uint16)], inside[cells]
    sums = [np.bincount(which, band) for band in bands]
    return np.stack(sums, axis=1) / counts[:, None], counts, which


def _chunk(kind: bytes, content: bytes) -> bytes:
    check = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)

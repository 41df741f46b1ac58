"""Hits on what is not there: surfaces with holes cut by an alpha texture, or that let a share of light through.

Embree's own traversal asks, for each hit on a face that has a hole, whether it counts. Where alpha is a
share (glTF's BLEND), and anything in the way closes a ray, the ray carries what is left of it: shares multiply
in any order, so there is nothing random about it. Where the nearest hit is looked for, order does matter, and a
hit counts with that probability. What it is drawn by depends on the ray and the triangle alone.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import callback, inlined
from aobake.tracing.embree import HitFilter
from aobake.tracing.foreign import array_at
from aobake.tracing.kernels import DIRECTION, ORIGIN, RAY_NUMBER

__all__ = ["CUTOFF_SLACK", "CutOut", "Edge", "pass_through_holes"]

Edge = Literal["repeat", "mirror", "clamp"]

REPEAT, MIRROR, CLAMP = 0, 1, 2
EDGES: dict[Edge, int] = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP}
CUTOFF_SLACK = 1e-6  # alpha is interpolated in float32: a constant one must not fall below itself

# What the filter function finds at geometryUserPtr: 64-bit words, of which CUTOFF is a float64.
CORNERS, FACES, ALPHA, WIDTH, HEIGHT, BOUNDS, BLOCKS = range(7)
EDGE_U, EDGE_V, NEAREST, ONE_SIDED, CUTOFF, WORDS = range(7, 13)
BLOCK = 8  # pixels; the bounds of a 512 x 512 image take 8 KiB and stay in the first cache
# Rows of RTCHitN, N values each; the numbers of the geometry and the instance follow that of the primitive.
U, V, PRIMITIVE, HIT_ROWS = 3, 4, 5, 8
RAY_ROWS = 12
CORNER_NUMBERS = 9  # of a face
# What is left of a ray is a float32 in the place of its number, and none of it below this. Numbers, below 2^20, are
# tiny floats there, and tell the filter to draw.
LEAST_LEFT = 2.0**-16
SHUFFLE = (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6)


@dataclass(frozen=True, eq=False, kw_only=True)
class CutOut:
    """The alpha of some faces.

    corners : (F, 3, 3) float32, C-ordered; for each corner of each face the column and the row of its place
        in the image, in pixels from the middle of the first one, and what alpha is multiplied by
    alpha : (H, W) uint8, C-ordered, not empty; 255: opaque
    edges : what lies outside of the image, along its columns and its rows
    nearest : whether the pixel that a place is in counts, instead of the four around it
    cutoff : alpha below which a surface is not there; None: alpha is the share of light that it stops
    one_sided : whether hits from behind do not count either
    """

    corners: NDArray[np.float32]
    alpha: NDArray[np.uint8]
    edges: tuple[Edge, Edge] = ("repeat", "repeat")
    nearest: bool = False
    cutoff: float | None = 0.5
    one_sided: bool = False


def pass_through_holes(cutout: CutOut) -> HitFilter:
    """What lets rays through where the faces have holes; compiled when it is first needed."""
    data, bounds = np.zeros(WORDS, np.int64), _bounds(cutout)
    data[BOUNDS], data[BLOCKS] = bounds.ctypes.data, bounds.shape[1]
    data[CORNERS], data[ALPHA] = cutout.corners.ctypes.data, cutout.alpha.ctypes.data
    data[FACES], (data[HEIGHT], data[WIDTH]) = len(cutout.corners), cutout.alpha.shape
    data[EDGE_U], data[EDGE_V] = EDGES[cutout.edges[0]], EDGES[cutout.edges[1]]
    data[NEAREST], data[ONE_SIDED] = cutout.nearest, cutout.one_sided
    data.view(np.float64)[CUTOFF] = (
        -1.0 if cutout.cutoff is None else max(cutout.cutoff - CUTOFF_SLACK, 0.0)
    )
    return HitFilter(
        function=_function(),
        sided=cutout.one_sided,
        data=data,
        kept=(cutout.corners, cutout.alpha, bounds),
    )


def _bounds(cutout: CutOut) -> NDArray[np.uint8]:
    """(rows, columns, 2) the least and the most alpha that lookups in each block of pixels come to."""
    least, most = cutout.alpha, cutout.alpha
    for axis, edge in ((1, cutout.edges[0]), (0, cutout.edges[1])):
        if not cutout.nearest:
            after = np.arange(1, least.shape[axis] + 1)
            after[-1] = 0 if edge == "repeat" else after[-1] - 1
            least = np.minimum(least, least.take(after, axis))
            most = np.maximum(most, most.take(after, axis))
        starts = np.arange(0, least.shape[axis], BLOCK)
        least = np.minimum.reduceat(least, starts, axis)
        most = np.maximum.reduceat(most, starts, axis)
    return np.ascontiguousarray(np.stack([least, most], axis=2))


@functools.cache
def _function() -> int:
    return callback(_decide)


@inlined
def wrapped(i, count, edge):
    """The pixel of a row of `count` that pixel i of the endless row is."""
    if 0 <= i < count:
        return i
    if edge == CLAMP:
        return min(max(i, 0), count - 1)
    if edge == REPEAT:
        return i % count
    turn = i % (2 * count)
    return min(turn, 2 * count - 1 - turn)


@inlined
def within(i, count, edge):
    """The pixel that i is where a row is repeated; i where it ends some other way."""
    return i % count if edge == REPEAT and not 0 <= i < count else i


@inlined
def place_of(data, corners, face, u, v):
    """Column and row in the image, and the factor, at u and v, the weights of a face's second and third corner."""
    first, w = CORNER_NUMBERS * np.int64(face), np.float32(1.0) - u - v
    x = w * corners[first] + u * corners[first + 3] + v * corners[first + 6]
    y = w * corners[first + 1] + u * corners[first + 4] + v * corners[first + 7]
    factor = w * corners[first + 2] + u * corners[first + 5] + v * corners[first + 8]
    if data[NEAREST] != 0:
        x, y = x + np.float32(0.5), y + np.float32(0.5)
    return x, y, factor


@inlined
def looked_up(data, alpha, x, y):
    """The alpha of the image at a place, from 0 to 255."""
    width, height = data[WIDTH], data[HEIGHT]
    left, upper = np.floor(x), np.floor(y)
    i = within(np.int64(left), width, data[EDGE_U])
    j = within(np.int64(upper), height, data[EDGE_V])
    i0, j0 = wrapped(i, width, data[EDGE_U]), wrapped(j, height, data[EDGE_V]) * width
    if data[NEAREST] != 0:
        return float(alpha[j0 + i0])
    i1, j1 = wrapped(i + 1, width, data[EDGE_U]), wrapped(j + 1, height, data[EDGE_V]) * width
    right, down = x - left, y - upper
    above = alpha[j0 + i0] * (1.0 - right) + alpha[j0 + i1] * right
    below = alpha[j1 + i0] * (1.0 - right) + alpha[j1 + i1] * right
    return above * (1.0 - down) + below * down


@inlined
def stops(data, arrays, face, u, v, limit):
    """Whether the alpha of a face is at least `limit` at a place; told by its block alone where that is enough."""
    corners, alpha, bounds = arrays
    x, y, factor = place_of(data, corners, face, u, v)
    limit *= 255.0
    i = within(np.int64(np.floor(x)), data[WIDTH], data[EDGE_U])
    j = within(np.int64(np.floor(y)), data[HEIGHT], data[EDGE_V])
    if 0 <= i < data[WIDTH] and 0 <= j < data[HEIGHT]:
        block = 2 * ((j // BLOCK) * data[BLOCKS] + i // BLOCK)
        if factor * bounds[block] >= limit:
            return True
        if factor * bounds[block + 1] < limit:
            return False
    return factor * looked_up(data, alpha, x, y) >= limit


@inlined
def share_stopped(data, arrays, face, u, v):
    """The alpha of a face at a place, within [0, 1]."""
    corners, alpha, _ = arrays
    x, y, factor = place_of(data, corners, face, u, v)
    return min(max(factor * looked_up(data, alpha, x, y) / 255.0, 0.0), 1.0)


@inlined
def from_behind(ray, hit, count, k):
    """Whether ray k runs along the normal of the triangle that it hits."""
    along = 0.0
    for i in range(3):
        along += ray[(DIRECTION + i) * count + k] * hit[i * count + k]
    return along > 0.0


@inlined
def mixed_in(bits, word):
    """64 well-mixed bits of some bits and another word. Source: SplitMix64, Steele, Lea, Flood, 2014."""
    z = (bits + np.uint64(0x9E3779B97F4A7C15)) ^ np.uint64(word)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@inlined
def reversed_bits(word):
    """The 32 bits of a word in the opposite order."""
    word = ((word & 0x55555555) << 1) | ((word >> 1) & 0x55555555)
    word = ((word & 0x33333333) << 2) | ((word >> 2) & 0x33333333)
    word = ((word & 0x0F0F0F0F) << 4) | ((word >> 4) & 0x0F0F0F0F)
    word = ((word & 0x00FF00FF) << 8) | ((word >> 8) & 0x00FF00FF)
    return ((word & 0x0000FFFF) << 16) | (word >> 16)


@inlined
def drawn(rays, hits, count, k):
    """A number in [0, 1) for ray k and the triangle that it hits.

    rays, hits : the words of RTCRayN and RTCHitN
    Every 2^m neighbouring rays of a point draw one number from each of 2^m equal intervals, in an order that
    comes from a hash of the origin and the triangle: one sheet then has a fifth of the error of independent
    draws at 256 rays, and what lies behind a triangle is drawn independently of it.
    Source: van der Corput's sequence in an order shuffled as in B. Burley, Practical hash-based Owen
    scrambling, JCGT 9(4), 2020, 4 (the constants are those of S. Laine and T. Karras, 2011, there).
    """
    bits = np.uint64(0)
    for i in range(3):
        bits = mixed_in(bits, hits[(PRIMITIVE + i) * count + k])
        bits = mixed_in(bits, rays[(ORIGIN + i) * count + k])
    low = np.int64(0xFFFFFFFF)
    x = reversed_bits(np.int64(rays[RAY_NUMBER * count + k]))
    x = (x + np.int64(bits & np.uint64(low))) & low
    for factor in SHUFFLE:
        x = (x ^ (x * factor)) & low
    return float(x) * 2.0**-32


def _decide(arguments):
    """RTCFilterFunctionN: make hits invalid where the triangle has a hole, or lets some of the ray through."""
    fields = array_at(arguments, 6, np.int64)
    count = np.int64(array_at(arguments, 12, np.int32)[10])
    valid = array_at(fields[0], count, np.int32)
    data = array_at(fields[1], WORDS, np.int64)
    cutoff = array_at(fields[1], WORDS, np.float64)[CUTOFF]
    ray = array_at(fields[3], RAY_ROWS * count, np.float32)
    rays = array_at(fields[3], RAY_ROWS * count, np.uint32)
    hit = array_at(fields[4], HIT_ROWS * count, np.float32)
    hits = array_at(fields[4], HIT_ROWS * count, np.uint32)
    corners = array_at(data[CORNERS], CORNER_NUMBERS * data[FACES], np.float32)
    alpha = array_at(data[ALPHA], data[WIDTH] * data[HEIGHT], np.uint8)
    blocks = data[BLOCKS] * ((data[HEIGHT] + BLOCK - 1) // BLOCK)
    bounds = array_at(data[BOUNDS], 2 * blocks, np.uint8)
    for k in range(count):
        if valid[k] != -1:
            continue
        if data[ONE_SIDED] != 0 and from_behind(ray, hit, count, k):
            valid[k] = 0
            continue
        face, u, v = hits[PRIMITIVE * count + k], hit[U * count + k], hit[V * count + k]
        left = ray[RAY_NUMBER * count + k]
        if cutoff < 0.0 and left >= LEAST_LEFT:
            left *= 1.0 - share_stopped(data, (corners, alpha, bounds), face, u, v)
            if left >= LEAST_LEFT:
                ray[RAY_NUMBER * count + k] = left
                valid[k] = 0
            continue
        limit = cutoff if cutoff >= 0.0 else drawn(rays, hits, count, k)
        if not stops(data, (corners, alpha, bounds), face, u, v, limit):
            valid[k] = 0

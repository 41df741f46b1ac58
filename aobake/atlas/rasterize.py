"""Texels: where on which triangle each texel of a page takes its value.

A texel is covered where a bilinear lookup at any place of a chart reads it: where the square of two
texels around its centre meets a triangle. So a renderer never reads a texel that nobody baked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.raster_kernels import TOUCHING, cover, locate
from aobake.meshes.scene import FloatArray, IntArray

__all__ = ["PlacedFaces", "Texels", "placed_faces", "texels"]

LOOKUP = 1.0 + TOUCHING  # a bilinear lookup reads what is less than one texel away, along both axes
MOST_COORDINATE = 1e9  # times a page; what is farther out is nothing that a lookup could mean


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedFaces:
    """The triangles of several layouts on one page; those without a place are left out.

    width, height : of the page, in texels
    corners : (N, 6) float64, x and y of three corners, in texels from the page's top left corner
    owner : (N,) int32, which of the layouts; ascending
    face : (N,) int32, which face of that layout's mesh; ascending within an owner
    chart : (N,) int32
    """

    width: int
    height: int
    corners: FloatArray
    owner: IntArray
    face: IntArray
    chart: IntArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Texels:
    """Sample points of some rows of a page, in row-major order of their pixels.

    pixel : (T,) int64, row * width + column in the whole page; repeats where a texel has several samples
    owner, face, chart : (T,) int32, as in PlacedFaces
    weights : (T, 2) float64 of corners 1 and 2 at the point, which lies in the triangle; corner 0 has the rest
    inside : (T,) bool, whether the point is where the sample is; else it is the nearest one of the charts
    """

    pixel: NDArray[np.int64]
    owner: IntArray
    face: IntArray
    chart: IntArray
    weights: FloatArray
    inside: NDArray[np.bool_]


def placed_faces(
    corners: Sequence[FloatArray], charts: Sequence[IntArray], width: int, height: int
) -> PlacedFaces:
    """Gather the layouts of a page.

    corners : (F, 3, 2) texture coordinates of each layout; v runs down from the page's top
    charts : (F,) chart of each face, numbered over the whole page; -1: it has no place
    Faces whose coordinates are not finite, or beyond all reason, have no place either. No layouts give
    no faces.
    """
    texture_size = np.array([width, height], np.float64)
    kept, flat = [], []
    for uv, chart in zip(corners, charts, strict=True):
        largest = np.abs(uv).reshape(len(uv), 6).max(axis=1, initial=0.0)
        chosen = np.flatnonzero((chart >= 0) & (largest < MOST_COORDINATE))  # a NaN is not less
        kept.append(chosen)
        flat.append((uv[chosen] * texture_size).reshape(-1, 6))
    counts = [len(chosen) for chosen in kept]
    numbers = [chart[chosen] for chart, chosen in zip(charts, kept, strict=True)]
    return PlacedFaces(
        width=width,
        height=height,
        corners=np.concatenate([np.zeros((0, 6)), *flat]),
        owner=np.repeat(np.arange(len(kept), dtype=np.int32), counts),
        face=np.concatenate([np.zeros(0, np.int32), *kept]).astype(np.int32),
        chart=np.concatenate([np.zeros(0, np.int32), *numbers]).astype(np.int32),
    )


def texels(placed: PlacedFaces, rows: range, supersample: int = 1) -> Texels:
    """The sample points of all covered texels in some rows of a page.

    rows : successive rows of the page; what comes of a row does not depend on the others
    supersample : s x s places per texel; those within its chart are taken, or the middle of the texel
        where none is
    A place in several triangles belongs to the first of them. One that is outside of all of them is
    clamped onto the nearest triangle, and moved inward by up to a 16th of a texel, as a point on an edge
    is neither on this side of it nor on that. Pages without faces give no texels.
    Memory: 12 bytes for each place of the rows, and 60 for each that is covered.
    """
    middle = _nearest_faces(placed, rows, 1, LOOKUP)
    covered = middle >= 0
    if supersample == 1:
        row, column = np.nonzero(covered)
        x, y = column.astype(np.float64), row.astype(np.float64)
        number = middle[row, column]
    else:
        row, column, x, y, number = _spread(placed, rows, supersample, middle)
    y = y + rows.start
    weights = np.empty((len(number), 2))
    inside = np.empty(len(number), bool)
    locate(placed.corners, number, x, y, weights, inside)
    return Texels(
        pixel=(row + rows.start) * placed.width + column,
        owner=placed.owner[number],
        face=placed.face[number],
        chart=placed.chart[number],
        weights=weights,
        inside=inside,
    )


def _nearest_faces(placed: PlacedFaces, rows: range, scale: int, reach: float) -> IntArray:
    """(rows, width) int32 times scale: the nearest face at each place that one reaches; -1: none does."""
    shape = (scale * len(rows), scale * placed.width)
    nearest, face = np.full(shape, np.inf), np.full(shape, -1, np.int32)
    # What lies in triangles comes first, so that it is not measured against all those around it.
    for some in sorted({TOUCHING, reach}):
        cover(placed.corners, scale, scale * rows.start, some, nearest, face)
    return face


def _spread(
    placed: PlacedFaces, rows: range, scale: int, middle: IntArray
) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray, FloatArray, IntArray]:
    """Row, column, place and face of the samples of each texel: places in its chart, or its middle."""
    fine = _nearest_faces(placed, rows, scale, TOUCHING)
    fine = fine.reshape(len(rows), scale, placed.width, scale).transpose(0, 2, 1, 3)
    fine = fine.reshape(len(rows), placed.width, scale * scale)
    chart = np.append(placed.chart, np.int32(-1))  # where there is no face, -1, there is no chart
    same_chart = chart[fine] == chart[middle][..., None]
    taken = (fine >= 0) & (middle >= 0)[..., None] & same_chart
    alone = (middle >= 0) & ~taken.any(axis=2)
    row, column, part = np.nonzero(np.concatenate([taken, alone[..., None]], axis=2))
    number = np.concatenate([fine, middle[..., None]], axis=2)[row, column, part]
    steps = (np.arange(scale) + 0.5) / scale - 0.5
    x = column + np.append(np.tile(steps, scale), 0.0)[part]
    y = row + np.append(np.repeat(steps, scale), 0.0)[part]
    return row, column, x, y, number

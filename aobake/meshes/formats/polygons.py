"""Polygons and strips to triangles, with nothing outside of the polygon covered."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.earclip import clip_ears
from aobake.meshes.scene import FloatArray, IntArray

__all__ = ["strip_triangles", "triangle_corners"]

IndexArray = NDArray[np.int64]


def triangle_corners(vertices: FloatArray, corners: IndexArray, sizes: IndexArray) -> IntArray:
    """Split polygons into triangles of the same winding, and say which corners these have.

    vertices : (V, 3) float64; where they are not finite, the polygon becomes a fan
    corners : (sum of sizes,) vertices of all polygons, one polygon after the other
    sizes : (P,) corners of each polygon; one of fewer than three gives nothing
    Returns (T, 3) int32 into corners; (0, 3) where there is no polygon. A polygon is a fan from its first
    corner where that covers it, and is cut along its ears else (Meisters 1975); one that crosses itself is
    covered in some way that uses its corners alone.
    """
    counts = np.maximum(sizes - 2, 0)
    first = np.cumsum(counts) - counts
    begin = np.cumsum(sizes) - sizes
    found = np.empty((int(counts.sum()), 3), np.int32)
    for size in np.unique(sizes[sizes >= 3]).tolist():
        chosen = np.flatnonzero(sizes == size)
        polygons = corners[begin[chosen][:, None] + np.arange(size)]
        rows = first[chosen][:, None] + np.arange(size - 2)
        found[rows] = begin[chosen][:, None, None] + _of_one_size(vertices, polygons)
    return found


def _of_one_size(vertices: FloatArray, polygons: IndexArray) -> IndexArray:
    """(K, size - 2, 3) triangles of (K, size) polygons, as numbers of their corners from 0."""
    count, size = polygons.shape
    fan = np.array([[0, corner, corner + 1] for corner in range(1, size - 1)], np.int64)
    cut = np.broadcast_to(fan, (count, *fan.shape))
    if size == 3:
        return cut
    folded = np.flatnonzero(_folds(vertices, polygons))
    cut = cut.copy()
    if size == 4:
        cut[folded] = [[0, 1, 3], [1, 2, 3]]
        return cut
    for polygon in folded.tolist():
        cut[polygon] = clip_ears(vertices[polygons[polygon]])
    return cut


def _folds(vertices: FloatArray, polygons: IndexArray) -> NDArray[np.bool_]:
    """Whether the fan from the first corner leaves the polygon: one of its triangles is turned over."""
    with np.errstate(all="ignore"):
        spokes = vertices[polygons[:, 1:]] - vertices[polygons[:, :1]]
        normals = np.cross(spokes[:, :-1], spokes[:, 1:])
        whole = normals.sum(axis=1, keepdims=True)
        along = (normals * whole).sum(axis=2)
        length = np.sqrt((whole * whole).sum(axis=2))
        # Rounding of a flat corner is no fold: 1e-12 of the largest triangle is far below any real one.
        slack = 1e-12 * np.abs(along).max(axis=1, keepdims=True)
        folds: NDArray[np.bool_] = (along < -slack).any(axis=1) & (length[:, 0] > 0)
    return folds


def strip_triangles(rows: IndexArray, sizes: IndexArray) -> IntArray:
    """The triangles of triangle strips, every second one turned so that all wind alike.

    rows : (sum of sizes,) vertices of all rows, one row after the other; -1 starts a new strip
    sizes : (R,) numbers in each row; a row starts a new strip
    Returns (T, 3) int32, without triangles that use a vertex twice; (0, 3) for rows shorter than three.
    """
    if len(rows) < 3:
        return np.zeros((0, 3), np.int32)
    begins = np.zeros(len(rows) + 1, bool)
    begins[np.cumsum(sizes) - sizes] = True
    begins[1:][rows < 0] = True
    begins = begins[:-1]
    index = np.arange(len(rows))
    start = np.maximum.accumulate(np.where(begins, index, 0))
    at = index[:-2]
    a, b, c = rows[:-2], rows[1:-1], rows[2:]
    whole = (start[:-2] == start[2:]) & (a >= 0) & (b >= 0) & (c >= 0)
    whole &= (a != b) & (b != c) & (a != c)
    turned = (at - start[:-2]) % 2 == 1
    triangles: IndexArray = np.stack([a, np.where(turned, c, b), np.where(turned, b, c)], 1)[whole]
    return triangles.astype(np.int32)

"""Surfaces cut into square patches, each a chart of its own that is turned and laid somewhere on a page."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Surface = Callable[[FloatArray, FloatArray], FloatArray]


class Patched(NamedTuple):
    """A mesh with its page.

    vertices : (V, 3); faces : (F, 3); uv : (F, 3, 2); normals : (F, 3, 3) at corners
    chart : (H, W) int32, -1: none; position : (H, W, 3) of the surface, 0 where there is none
    """

    vertices: FloatArray
    faces: NDArray[np.int32]
    uv: FloatArray
    normals: FloatArray
    chart: NDArray[np.int32]
    position: FloatArray


def sphere(u: FloatArray, v: FloatArray) -> FloatArray:
    """A band of the unit sphere, from 70 degrees south to 70 north, closed around."""
    around, up = 2.0 * np.pi * (u % 1.0), np.radians(140.0) * (v - 0.5)
    return np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)


def cylinder(u: FloatArray, v: FloatArray) -> FloatArray:
    """The side of a cylinder, closed around."""
    around = 2.0 * np.pi * (u % 1.0)
    return np.stack([np.cos(around), np.sin(around), 2.0 * v], axis=-1)


def cube(u: FloatArray, v: FloatArray) -> FloatArray:
    """Four sides of a cube; its edges are at u = 0, 1/4, 1/2 and 3/4."""
    way = 4.0 * (u % 1.0)
    x = np.interp(way, [0, 1, 2, 3, 4], [0, 1, 1, 0, 0])
    y = np.interp(way, [0, 1, 2, 3, 4], [0, 0, 1, 1, 0])
    return np.stack([x, y, v], axis=-1)


def patched(
    surface: Surface, *, rows: int, columns: int, size: int, padding: int, quads: int = 4
) -> Patched:
    """The surface over [0, 1]^2 in rows x columns patches of quads x quads, on a page of size x size."""
    across = int(np.ceil(np.sqrt(rows * columns)))
    cell = size // across
    side = cell - padding - 1.0
    grid = np.linspace(0.0, 1.0, quads + 1)
    s, t = (axis.reshape(-1) for axis in np.meshgrid(grid, grid))
    rows_and_columns = np.mgrid[0:size, 0:size]
    chart = np.full((size, size), -1, np.int32)
    position = np.zeros((size, size, 3))
    vertices, faces, uv, normals = [], [], [], []
    for number in range(rows * columns):
        row, column = divmod(number, columns)
        turn = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), number % 4)
        shift = np.array([(0.37 * number) % 1.0, (0.61 * number) % 1.0])
        low = np.array([number % across, number // across]) * cell + padding / 2.0 + shift

        def domain(s: FloatArray, t: FloatArray, row: int = row, column: int = column):  # type: ignore[no-untyped-def]
            return (column + s) / columns, (row + t) / rows

        place = ((np.stack([s, t], axis=-1) - 0.5) @ turn + 0.5) * side + low
        quad = _quads(quads)
        vertices.append(surface(*domain(s, t)))
        faces.append(quad + number * len(s))
        uv.append((place / size)[quad])
        inner = 1e-6
        normals.append(
            _normals(surface, *domain(s + (0.5 - s) * inner, t + (0.5 - t) * inner))[quad]
        )
        left, top = np.maximum(low.astype(int) - 2, 0).tolist()
        here = np.s_[top : top + cell + 2, left : left + cell + 2]
        y, x = rows_and_columns[:, *here]
        centre = np.stack([x, y], axis=-1) + 0.5
        near = ((centre > low - 1.0) & (centre < low + side + 1.0)).all(axis=-1)
        local = ((np.clip((centre[near] - low) / side, 0.0, 1.0) - 0.5) @ turn.T) + 0.5
        chart[here][near] = number
        position[here][near] = surface(*domain(local[:, 0], local[:, 1]))
    return Patched(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(uv),
        np.concatenate(normals),
        chart,
        position,
    )


def lookup(image: NDArray[np.float32], uv: FloatArray) -> FloatArray:
    """Bilinear lookup, clamped at the borders, as a renderer does it."""
    height, width = image.shape
    at = uv * (width, height) - 0.5
    corner = np.floor(at).astype(int)
    part = at - corner
    total = np.zeros(uv.shape[:-1])
    for dy in (0, 1):
        for dx in (0, 1):
            column = np.clip(corner[..., 0] + dx, 0, width - 1)
            row = np.clip(corner[..., 1] + dy, 0, height - 1)
            share = (part[..., 0] if dx else 1 - part[..., 0]) * (
                part[..., 1] if dy else 1 - part[..., 1]
            )
            total += share * image[row, column]
    return total


def _quads(n: int) -> NDArray[np.int32]:
    first = (np.arange(n)[:, np.newaxis] * (n + 1) + np.arange(n)).reshape(-1)
    lower = np.stack([first, first + 1, first + n + 2], axis=-1)
    upper = np.stack([first, first + n + 2, first + n + 1], axis=-1)
    return np.concatenate([lower, upper]).astype(np.int32)


def _normals(surface: Surface, u: FloatArray, v: FloatArray) -> FloatArray:
    h = 1e-7
    along = surface(u + h, v) - surface(u - h, v)
    up = surface(u, v + h) - surface(u, v - h)
    cross = np.cross(along, up)
    return np.asarray(cross / np.linalg.norm(cross, axis=-1, keepdims=True))

"""A ground that cannot be seen but for the shadow and the occlusion on it.

It takes away from the background what it would reflect less than an open ground: so it meets any
background without a seam, and on a transparent one the shadow alone is left. Occlusion is found at the
points of three nested grids, fine under the asset and coarse around it.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.settings import GroundAxis
from aobake.tracing import embree
from aobake.tracing.conditioning import UnitFrame
from aobake.tracing.kernels import SUMS, scratch, trace
from aobake.tracing.sampling import direction_sets
from aobake.tracing.sized_sets import SizedSets

__all__ = ["Ground", "across", "ground_of", "openness"]

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]

RAYS = 192
LEVELS = ((1.15, 256), (3.0, 128), (9.0, 96))  # width in footprints, points along a side
LIFT = 2.0**-18  # of the footprint, above the ground
ROWS_AT_ONCE = 16


@dataclass(frozen=True, eq=False, kw_only=True)
class Ground:
    """An endless plane, in units of the frame.

    axis : that points up; height : along it
    center : (2,) of the grids, along the two other axes; half : (levels,) half their widths
    grids : openness on each, (n, n) float32, nested
    """

    axis: int
    height: float
    center: FloatArray
    half: FloatArray
    grids: tuple[Float32Array, ...]


def ground_of(
    clouds: Sequence[FloatArray], up: GroundAxis, tree: embree.Tree, frame: UnitFrame, threads: int
) -> Ground:
    """The ground under the lowest of the points, and how open it is.

    clouds : (N, 3) float64 each, in the scene's space, as wide as the scene; at least one point
    """
    axis = "xyz".index(up[1])
    low = np.min([cloud.min(axis=0) for cloud in clouds], axis=0)
    high = np.max([cloud.max(axis=0) for cloud in clouds], axis=0)
    low, high = frame.apply(low[None])[0], frame.apply(high[None])[0]
    flat = _flat_axes(axis)
    height = float(low[axis])
    width = max(float((high - low)[flat].max()), 0.5 * float(high[axis] - low[axis]), 1e-12)
    center = (low + high)[flat] / 2.0
    grids = []
    for share, count in LEVELS:
        steps = np.linspace(-0.5, 0.5, count) * share * width
        points = np.empty((count, count, 3))
        points[..., flat[0]] = center[0] + steps[None, :]
        points[..., flat[1]] = center[1] + steps[:, None]
        points[..., axis] = height + LIFT * width
        grids.append(_without_insides(_traced(tree, points, axis, threads)))
    half = np.array([share * width / 2.0 for share, _ in LEVELS])
    return Ground(axis=axis, height=height, center=center, half=half, grids=tuple(grids))


def _flat_axes(axis: int) -> list[int]:
    return [other for other in range(3) if other != axis]


def _traced(tree: embree.Tree, points: FloatArray, axis: int, threads: int) -> Float32Array:
    """(n, n) openness at (n, n, 3) points of a grid; the same for any number of threads."""
    count = len(points)
    up = np.zeros((ROWS_AT_ONCE * count, 3), np.float32)
    up[:, axis] = 1.0
    result = np.empty((count, count), np.float32)
    sets = SizedSets.of({RAYS: direction_sets(RAYS)})

    def rows(first: int) -> None:
        part = points[first : first + ROWS_AT_ONCE].reshape(-1, 3).astype(np.float32)
        sums = np.empty((len(part), SUMS))
        trace(
            embree.packets(),
            tree.address,
            part,
            up[: len(part)],
            None,
            np.arange(len(part)) + first * count,
            np.uint64(0),
            sets,
            np.zeros(len(part), np.int64),
            np.float32(np.inf),
            None,
            None,
            scratch(),
            sums,
            None,
            None,
        )
        result[first : first + ROWS_AT_ONCE] = (sums[:, 0] / sums[:, 2]).reshape(-1, count)

    rows(0)  # compiles in this thread
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(rows, range(ROWS_AT_ONCE, count, ROWS_AT_ONCE)))
    return result


def _without_insides(grid: Float32Array) -> Float32Array:
    """The grid with what is all closed, and so inside of things, continued from what is around them.

    Else the ground would be dark in steps as wide as a cell around all that stands on it.
    """
    from aobake.images import fill_holes

    return fill_holes(grid[:, :, None], grid > 0.0)[:, :, 0]


def across(
    ground: Ground, origins: Float32Array, directions: Float32Array
) -> tuple[NDArray[np.int64], Float32Array]:
    """Which rays meet the ground from above, and (3, M) float32 where, a little above it."""
    sinking = -directions[ground.axis]
    height = origins[ground.axis] - np.float32(ground.height)
    met = np.flatnonzero((sinking > 1e-6) & (height > 0.0))
    distance = height[met] / sinking[met]
    points = origins[:, met] + distance * directions[:, met]
    points[ground.axis] = ground.height + LIFT * 2.0 * ground.half[0] / LEVELS[0][0]
    return met, points


def openness(ground: Ground, points: Float32Array) -> Float32Array:
    """(N,) how open the ground is at points (3, N) of it, from the finest grid that holds each.

    At the rim of the coarsest grid it fades to open.
    """
    offset = points[_flat_axes(ground.axis)] - ground.center.astype(np.float32)[:, None]
    reach = np.abs(offset).max(axis=0)
    result = np.ones(len(reach), np.float32)
    for half, grid in reversed(list(zip(ground.half, ground.grids, strict=True))):
        rows = np.flatnonzero(reach < half)
        found = _bilinear(grid, offset[:, rows] / np.float32(half))
        # Near its rim a grid gives way to the one around it.
        share = np.clip((1.0 - reach[rows] / np.float32(half)) * 8.0, 0.0, 1.0)
        result[rows] += share * (found - result[rows])
    return result


def _bilinear(grid: Float32Array, place: Float32Array) -> Float32Array:
    """(N,) values of a grid at places (2, N) of [-1, 1]^2, whose outermost points lie on the rim."""
    last = len(grid) - 1
    at = (place + np.float32(1.0)) * np.float32(last / 2.0)
    cell = np.clip(at.astype(np.int64), 0, last - 1)
    x, y = at - cell
    column, row = cell
    upper = (1 - x) * grid[row, column] + x * grid[row, column + 1]
    lower = (1 - x) * grid[row + 1, column] + x * grid[row + 1, column + 1]
    return np.asarray((1 - y) * upper + y * lower, np.float32)

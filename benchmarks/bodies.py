"""Generated assets, each hard in its own way: what studies and fits are measured on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scan import scan

import aobake
from aobake.demo import hall

__all__ = ["bodies", "coarse_bodies", "twigs_above_ground"]

FloatArray = NDArray[np.float64]
CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
SIDES = np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4],
                  [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]])  # fmt: skip


def bodies() -> dict[str, aobake.Scene]:
    """Name -> scene, six of them."""
    return {
        "demo hall": hall(),
        "scan, 20,000 faces": _scene(*scan(20_000)),
        "soft body": _scene(*_soft(12_000, 0.25, 2.0)),
        "town of boxes": _scene(*_town(14)),
        "terrain": _scene(*_terrain(100)),
        "leaves": _scene(*_leaves(3000)),
    }


def coarse_bodies() -> dict[str, aobake.Scene]:
    """Name -> scene of 500 to 5,000 faces, five of them."""
    return {
        "scan, 2,000 faces": _scene(*scan(2000)),
        "soft body, 700 faces": _scene(*_soft(700, 0.35, 3.0)),
        "soft body, 2,800 faces": _scene(*_soft(2800, 0.3, 6.0)),
        "terrain, 1,250 faces": _scene(*_terrain(25)),
        "town, 1,180 faces": _scene(*_town(7)),
    }


def _scene(vertices: FloatArray, faces: NDArray[np.int32]) -> aobake.Scene:
    return aobake.Scene.from_arrays(vertices, faces)


def _soft(faces: int, depth: float, waves: float) -> tuple[FloatArray, NDArray[np.int32]]:
    """A body with wide bulges, as characters have."""
    vertices, triangles = scan(faces)
    ball = vertices / np.linalg.norm(vertices, axis=1)[:, None]
    x, y, z = waves * ball.T
    radius = 1.0 + depth * np.sin(x + 0.3) * np.cos(1.3 * y) + depth * np.sin(1.7 * z + x)
    return ball * radius[:, None], triangles


def _town(side: int) -> tuple[FloatArray, NDArray[np.int32]]:
    """Boxes of many heights on a ground of squares, each with its own corners on every side."""
    rng = np.random.default_rng(1)
    parts, count, triangles = [], 0, []
    for i in range(side):
        for j in range(side):
            size = np.array([0.6, 0.6, 0.2 + 1.8 * rng.random()])
            corners = CORNERS * size + [i + 0.2, j + 0.2, 0.001]
            parts.append(corners[SIDES].reshape(-1, 3))
            triangles.append(np.arange(36).reshape(-1, 3) + count)
            count += 36
    ground, cells = _terrain(2 * side, 0.0)
    parts.append(ground * [side / 2.0, side / 2.0, 1.0] + [side / 2.0, side / 2.0, 0.0])
    triangles.append(cells + count)
    return np.concatenate(parts), np.concatenate(triangles).astype(np.int32)


def _terrain(cells: int, height: float = 0.15) -> tuple[FloatArray, NDArray[np.int32]]:
    """Hills and ravines over a square."""
    line = np.linspace(-1.0, 1.0, cells + 1)
    x, y = (grid.reshape(-1) for grid in np.meshgrid(line, line, indexing="ij"))
    z = (
        np.abs(np.sin(7 * x + 2 * np.sin(3 * y)))
        + 0.5 * np.sin(11 * y + x)
        + 0.2 * np.sin(31 * x + 17 * y)
    )
    k = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    lower = np.stack([k, k + cells + 1, k + cells + 2], axis=1)
    upper = np.stack([k, k + cells + 2, k + 1], axis=1)
    return np.stack([x, y, height * z], axis=1), np.concatenate([lower, upper]).astype(np.int32)


def _leaves(count: int) -> tuple[FloatArray, NDArray[np.int32]]:
    """Small squares that lie anyhow in a ball: all edges and no surface."""
    rng = np.random.default_rng(2)
    middle = rng.standard_normal((count, 3))
    middle *= (rng.random(count) ** (1 / 3) / np.linalg.norm(middle, axis=1))[:, None]
    u, v = np.linalg.qr(rng.standard_normal((count, 3, 2)))[0].transpose(2, 0, 1) * 0.05
    corners = np.stack([middle - u - v, middle + u - v, middle + u + v, middle - u + v], axis=1)
    first = 4 * np.arange(count)[:, None, None]
    return corners.reshape(-1, 3), (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(
        np.int32
    )


def twigs_above_ground(count: int = 600) -> tuple[FloatArray, NDArray[np.int32]]:
    """A square of 30 x 30 vertices below thin prisms that lie anyhow in a ball, before an open sky."""
    rng = np.random.default_rng(7)
    ground, cells = _terrain(29, 0.0)
    middle = rng.standard_normal((count, 3))
    middle *= (rng.random(count) ** (1 / 3) / np.linalg.norm(middle, axis=1))[:, None]
    u, v, along = np.linalg.qr(rng.standard_normal((count, 3, 3))).Q.transpose(2, 0, 1)
    corners = [
        middle + end * 0.25 * along + 0.006 * (np.cos(turn) * u + np.sin(turn) * v)
        for end in (-1.0, 1.0)
        for turn in (0.0, 2.1, 4.2)
    ]
    prism = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]])
    twigs = (len(ground) + 6 * np.arange(count)[:, None, None] + prism).reshape(-1, 3)
    vertices = np.concatenate([ground - [0.0, 0.0, 1.05], np.stack(corners, axis=1).reshape(-1, 3)])
    return vertices, np.concatenate([cells, twigs]).astype(np.int32)

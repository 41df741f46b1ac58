"""A scan-like body of any size: smooth on a large scale, rough on two smaller ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["scan"]


def scan(faces: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """(V, 3) vertices and (F, 3) faces of a closed body of about `faces` triangles."""
    rings = max(3, round((faces / 4) ** 0.5))
    around = 2 * rings
    theta = np.pi * np.arange(1, rings) / rings
    phi = 2 * np.pi * np.arange(around) / around
    t, p = np.meshgrid(theta, phi, indexing="ij")
    grid = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    sphere = np.concatenate([[[0.0, 0.0, 1.0]], grid.reshape(-1, 3), [[0.0, 0.0, -1.0]]])
    x, y, z = sphere.T
    radius = 1.0 + 0.15 * np.sin(9 * x) * np.sin(8 * y + 1) * np.sin(10 * z)
    radius += 0.03 * np.sin(23 * x + 2 * y) * np.sin(31 * z) + 0.004 * np.sin(90 * x) * np.sin(
        80 * y
    )
    return sphere * radius[:, None], _sphere_faces(rings, around)


def _sphere_faces(rings: int, around: int) -> NDArray[np.int32]:
    j = np.arange(around)
    following = (j + 1) % around
    last = 1 + (rings - 2) * around
    parts = [
        np.stack([np.zeros(around, int), 1 + j, 1 + following], axis=1),
        np.stack([np.full(around, last + around), last + following, last + j], axis=1),
    ]
    for ring in range(rings - 2):
        a, b = 1 + ring * around, 1 + (ring + 1) * around
        parts += [
            np.stack([a + j, b + j, b + following], axis=1),
            np.stack([a + j, b + following, a + following], axis=1),
        ]
    return np.concatenate(parts).astype(np.int32)

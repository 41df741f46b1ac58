"""Points that everything lies below, told without a ray."""

from __future__ import annotations

import numpy as np
import pytest

from aobake.tracing.support import hull_of, open_sky
from tests.scenes import FloatArray, box, icosphere, joined, moved, rotation


def cloud(seed: int, count: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 3))


def by_brute_force(points: FloatArray, normals: FloatArray, corners: FloatArray) -> np.ndarray:
    height = corners @ normals.T
    return np.asarray(height.max(axis=0) <= np.einsum("ij,ij->i", points, normals))


@pytest.mark.parametrize("seed", range(4))
def test_climbing_finds_what_going_through_all_corners_finds(seed: int) -> None:
    corners = cloud(seed, 200)
    hull = hull_of(corners)
    assert hull is not None
    points = np.concatenate([1.6 * cloud(seed + 10, 2000), corners])
    normals = cloud(seed + 20, len(points))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = open_sky(points, normals, None, hull)
    expected = by_brute_force(points, normals, corners)
    assert 0 < expected.sum() < len(points)
    assert np.array_equal(found, expected)


def test_the_surface_itself_is_enough() -> None:
    """What lies above a turned normal but below the surface does not count."""
    hull = hull_of(box().vertices)
    assert hull is not None
    up, turned = np.array([[0.0, 0.0, 1.0]]), np.array([[0.6, 0.0, 0.8]])
    at = np.array([[0.0, 0.0, 0.5]])
    assert open_sky(at, up, None, hull).all()
    assert not open_sky(at, turned, None, hull).any()
    assert open_sky(at, turned, up, hull).all()


def test_the_hull_of_what_is_flat_is_none() -> None:
    flat = np.column_stack([cloud(0, 30)[:, :2], np.zeros(30)])
    assert hull_of(flat) is None
    assert hull_of(np.zeros((0, 3))) is None
    assert hull_of(np.zeros((1, 3))) is None


def test_a_corner_knows_its_neighbours() -> None:
    mesh = joined(icosphere(2), moved(icosphere(1), 0.5, (0.1, 0.0, 0.0)))
    hull = hull_of(mesh.vertices @ rotation((1, 2, 3), 0.4).T)
    assert hull is not None
    assert len(hull.corners) == len(icosphere(2).vertices)
    degrees = np.diff(hull.starts)
    assert degrees.min() >= 3
    assert degrees.sum() == len(hull.neighbours) == 2 * (3 * len(hull.corners) - 6)  # Euler
    rows = np.repeat(np.arange(len(hull.corners)), degrees)
    there = {(int(a), int(b)) for a, b in zip(rows, hull.neighbours, strict=True)}
    assert there == {(b, a) for a, b in there}

"""Polygons become triangles that cover them, and nothing outside of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from aobake.meshes.formats.polygons import strip_triangles, triangle_corners

Points = NDArray[np.float64]
ARROW = [[0, 0], [2, 1], [0, 2], [0.5, 1]]
L_SHAPE = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]
COMB = [[0, 0], [7, 0], [7, 3], [6, 1], [5, 3], [4, 1], [3, 3], [2, 1], [1, 3], [0, 1]]
SPIRAL = [
    *([0, 0], [6, 0], [6, 6], [1, 6], [1, 2], [4, 2], [4, 4]),
    *([3, 4], [3, 3], [2, 3], [2, 5], [5, 5], [5, 1], [0, 1]),
]
FLAT_CORNERS = [[0, 0], [1, 0], [2, 0], [2, 2], [1, 2], [0, 2], [0, 1]]


def placed(outline: Sequence[Sequence[float]], start: int) -> Points:
    """The outline on a tilted plane, beginning at another of its corners."""
    flat = np.roll(np.array(outline, float), -start, axis=0)
    u, v = np.array([1.0, 2.0, 2.0]) / 3, np.array([2.0, 1.0, -2.0]) / 3
    return flat[:, :1] * u + flat[:, 1:] * v + [5.0, -3.0, 11.0]


def areas(points: Points, faces: NDArray[np.int32]) -> Points:
    """Areas of triangles, signed by the polygon's own normal."""
    normal = np.cross([1, 2, 2], [2, 1, -2]) / 9
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    signed: Points = np.cross(b - a, c - a) @ normal / 2
    return signed


@pytest.mark.parametrize("outline", [ARROW, L_SHAPE, COMB, SPIRAL, FLAT_CORNERS])
@pytest.mark.parametrize("turned", [False, True])
def test_a_polygon_is_covered_exactly_once_from_any_first_corner(
    outline: Sequence[Sequence[float]], turned: bool
) -> None:
    """No triangle is turned over and the areas add up: together no overlap, and nothing outside."""
    outline = outline[::-1] if turned else outline
    x, y = np.array(outline, float).T
    shoelace = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)
    for start in range(len(outline)):
        points = placed(outline, start)
        faces = triangle_corners(points, np.arange(len(points)), np.array([len(points)]))
        signed = areas(points, faces) * (-1 if turned else 1)
        assert len(faces) == len(points) - 2
        assert signed.min() > -1e-12
        assert_allclose(signed.sum(), abs(shoelace), rtol=1e-12)


def test_polygons_of_many_sizes_keep_their_order() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [-1, 0.5, 0]], float)
    corners = np.array([0, 1, 2, 3, 0, 1, 0, 1, 2, 0, 1, 2, 3, 4])
    found = triangle_corners(points, corners, np.array([4, 2, 3, 5]))
    assert_array_equal(
        corners[found], [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 4]]
    )
    assert found.dtype == np.int32


def test_no_polygon_gives_no_triangle() -> None:
    none = np.zeros(0, np.int64)
    assert triangle_corners(np.zeros((0, 3)), none, none).shape == (0, 3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_corners_that_are_not_finite_give_triangles_of_the_polygon(bad: float) -> None:
    points = placed(COMB, 3)
    points[4] = bad
    faces = triangle_corners(points, np.arange(10), np.array([10]))
    assert faces.shape == (8, 3)
    assert set(faces.reshape(-1).tolist()) <= set(range(10))


def test_a_polygon_that_crosses_itself_still_ends() -> None:
    star = [[np.sin(4 * np.pi * k / 7), np.cos(4 * np.pi * k / 7)] for k in range(7)]
    faces = triangle_corners(placed(star, 0), np.arange(7), np.array([7]))
    assert faces.shape == (5, 3)


def test_a_strip_winds_all_triangles_alike_and_restarts_at_minus_one() -> None:
    rows = np.array([0, 1, 2, 3, -1, 4, 5, 6, 6, 7, 8, 0, 1, 2])
    faces = strip_triangles(rows, np.array([11, 3]))
    assert_array_equal(faces, [[0, 1, 2], [1, 3, 2], [4, 5, 6], [6, 8, 7], [0, 1, 2]])


@pytest.mark.parametrize("rows", [[], [0], [0, 1], [-1, -1, -1], [0, 1, -1, 2, 3]])
def test_a_strip_without_a_whole_triangle_is_empty(rows: list[int]) -> None:
    assert strip_triangles(np.array(rows, np.int64), np.array([len(rows)])).shape == (0, 3)

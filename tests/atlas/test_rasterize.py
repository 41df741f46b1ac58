"""Texels: every one that a lookup reads is there, at a point of the triangle that is nearest to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from aobake.atlas.rasterize import Texels, placed_faces, texels
from tests.scenes import FloatArray, IntArray

SIZE = 32
Point = tuple[Fraction, Fraction]


def baked(
    corners: FloatArray, *, chart: IntArray | None = None, size: int = SIZE, supersample: int = 1
) -> Texels:
    """The texels of one layout on a square page; without chart numbers, all of it is one chart."""
    charts = np.zeros(len(corners), np.int32) if chart is None else chart
    placed = placed_faces([corners], [charts], size, size)
    return texels(placed, range(size), supersample)


def places(corners: FloatArray, found: Texels, size: int = SIZE) -> FloatArray:
    """(T, 2) where on the page the points are, in texels."""
    b, c = found.weights.T
    a = 1.0 - b - c
    weights = np.stack([a, b, c], axis=1)
    return np.asarray(np.einsum("tc,tcx->tx", weights, corners[found.face]) * size)


def centres(found: Texels, size: int = SIZE) -> FloatArray:
    return np.asarray(np.stack([found.pixel % size, found.pixel // size], axis=1) + 0.5, np.float64)


def random_triangles(count: int, reach: float, seed: int = 0) -> FloatArray:
    """Triangles whose corners are multiples of 2^-12, exact in float64 and on the page's grid of texels."""
    rng = np.random.default_rng(seed)
    middles = rng.uniform(0.0, 1.0, (count, 1, 2))
    corners = middles + rng.uniform(-reach, reach, (count, 3, 2))
    return np.asarray(np.round(corners * 4096.0) / 4096.0)


def clipped(polygon: list[Point], axis: int, bound: Fraction, sign: int) -> list[Point]:
    """The part of a convex polygon where sign x[axis] <= sign bound, exactly."""
    kept: list[Point] = []
    for one, other in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        p, q = sign * (one[axis] - bound), sign * (other[axis] - bound)
        if p <= 0:
            kept.append(one)
        if p * q < 0:
            t = p / (p - q)
            kept.append((one[0] + t * (other[0] - one[0]), one[1] + t * (other[1] - one[1])))
    return kept


def read_by_lookups(corners: FloatArray) -> set[tuple[int, int]]:
    """(column, row) of all texels that bilinear lookups on triangles read, in exact arithmetic."""
    read = set()
    for triangle in corners * SIZE:
        polygon = [(Fraction(float(x)), Fraction(float(y))) for x, y in triangle]
        low, high = np.floor(triangle.min(0)).astype(int), np.ceil(triangle.max(0)).astype(int)
        for x in range(max(low[0] - 1, 0), min(high[0] + 1, SIZE)):
            for y in range(max(low[1] - 1, 0), min(high[1] + 1, SIZE)):
                part = polygon
                for axis, centre in ((0, x), (1, y)):
                    middle = Fraction(2 * centre + 1, 2)
                    part = clipped(part, axis, middle + 1, 1)
                    part = clipped(part, axis, middle - 1, -1)
                if part:
                    read.add((x, y))
    return read


@pytest.mark.parametrize("reach", [0.3, 0.05, 0.005])
@pytest.mark.parametrize("mirrored", [False, True])
def test_what_lookups_read_is_covered_and_nothing_else(reach: float, mirrored: bool) -> None:
    for seed in range(6):
        corners = random_triangles(3, reach, seed)
        corners = corners[:, ::-1] if mirrored else corners
        found = baked(corners)
        covered = {(int(p % SIZE), int(p // SIZE)) for p in found.pixel}
        assert covered == read_by_lookups(corners)
        assert len(covered) == len(found.pixel)


def test_needles_and_lines_and_dots_are_covered_as_well() -> None:
    needle = np.array([[0.1, 0.2], [0.9, 0.2 + 2**-20], [0.9, 0.2]])
    line = np.array([[0.125, 0.5], [0.5, 0.75], [0.25, 7 / 12]])
    dot = np.full((3, 2), 0.3125)
    for corners in (needle, line, dot):
        found = baked(corners[None])
        covered = {(int(p % SIZE), int(p // SIZE)) for p in found.pixel}
        assert read_by_lookups(corners[None]) <= covered
        assert np.isfinite(found.weights).all()


def nearest_distance(point: FloatArray, triangle: FloatArray) -> float:
    """From a point to a triangle of the plane, edge by edge."""
    a, b, c = triangle
    turns = [
        (q[0] - p[0]) * (point[1] - p[1]) - (q[1] - p[1]) * (point[0] - p[0])
        for p, q in ((a, b), (b, c), (c, a))
    ]
    if min(turns) >= 0.0 or max(turns) <= 0.0:
        return 0.0
    distances = []
    for p, q in ((a, b), (b, c), (c, a)):
        t = np.clip((point - p) @ (q - p) / ((q - p) @ (q - p)), 0.0, 1.0)
        distances.append(float(np.linalg.norm(p + t * (q - p) - point)))
    return min(distances)


def test_each_texel_goes_to_the_nearest_triangle_and_the_first_of_those() -> None:
    corners = random_triangles(12, 0.15, 3)
    found = baked(corners)
    at, where = centres(found), places(corners, found)
    assert (found.weights >= 0.0).all()
    assert (found.weights.sum(axis=1) <= 1.0 + 1e-15).all()
    for i in range(len(at)):
        distances = np.array([nearest_distance(at[i], triangle) for triangle in corners * SIZE])
        assert distances[found.face[i]] <= distances.min() + 1e-9
        assert bool(found.inside[i]) == (distances.min() == 0.0)
        if found.inside[i]:
            assert found.face[i] == int(np.flatnonzero(distances == 0.0)[0])
            assert np.abs(where[i] - at[i]).max() < 1e-9
        else:
            off = float(np.linalg.norm(where[i] - at[i]))
            assert distances.min() - 1e-9 <= off <= distances.min() + 1.0 / 16.0


def test_a_clamped_point_is_off_the_edge_of_its_triangle() -> None:
    corners = random_triangles(6, 0.2, 8)
    found = baked(corners)
    outside = ~found.inside
    least = np.minimum(found.weights.min(axis=1), 1.0 - found.weights.sum(axis=1))
    assert outside.any()
    assert (least[outside] > 0.0).all()


def test_a_centre_on_a_shared_edge_belongs_to_the_first_face() -> None:
    a, b, c, d = np.array([(4.5, 4.5), (12.5, 4.5), (12.5, 12.5), (4.5, 12.5)]) / SIZE
    for faces in ([(a, b, c), (a, c, d)], [(a, c, d), (a, b, c)]):
        corners = np.array(faces)
        found = baked(corners)
        x, y = centres(found).T
        diagonal = (x == y) & found.inside
        assert int(diagonal.sum()) == 9
        assert (found.face[diagonal] == 0).all()


def test_between_charts_the_nearer_one_wins() -> None:
    left = np.array([(4.0, 4.0), (10.25, 4.0), (10.25, 20.0)]) / SIZE
    right = np.array([(11.0, 4.0), (18.0, 4.0), (11.0, 20.0)]) / SIZE
    corners, chart = np.stack([right, left]), np.array([1, 0], np.int32)
    found = baked(corners, chart=chart)
    of = dict(zip(found.pixel.tolist(), found.chart.tolist(), strict=True))
    assert (
        of[8 * SIZE + 9] == of[8 * SIZE + 10] == 0
    )  # 10.5 is 0.25 from it, and 0.5 from the other
    assert of[8 * SIZE + 11] == of[8 * SIZE + 12] == 1
    assert 8 * SIZE + 30 not in of


def test_amid_two_charts_the_first_face_wins() -> None:
    left = np.array([(4.0, 4.0), (10.0, 4.0), (10.0, 20.0)]) / SIZE
    right = np.array([(11.0, 4.0), (18.0, 4.0), (11.0, 20.0)]) / SIZE
    for corners in (np.stack([left, right]), np.stack([right, left])):
        found = baked(corners)
        assert found.face[found.pixel == 8 * SIZE + 10].tolist() == [0]


def test_what_is_off_the_page_or_has_no_place_is_left_out() -> None:
    wide = np.array([(-3.0, -2.0), (4.0, 0.5), (0.5, 5.0)])
    nan = np.array([(0.1, 0.1), (math.nan, 0.5), (0.5, 0.1)])
    beyond = np.array([(0.1, 0.1), (1e300, 0.5), (0.5, 0.1)])
    away = np.array([(2.0, 2.0), (3.0, 2.0), (2.0, 3.0)])
    unplaced = np.array([(0.1, 0.1), (0.2, 0.1), (0.1, 0.2)])
    corners = np.stack([nan, beyond, away, unplaced])
    chart = np.array([0, 1, 2, -1], np.int32)
    assert len(baked(corners, chart=chart).pixel) == 0
    assert len(baked(wide[None]).pixel) == SIZE * SIZE
    empty = texels(placed_faces([], [], SIZE, SIZE), range(SIZE), 2)
    assert len(empty.pixel) == 0


@pytest.mark.parametrize("supersample", [1, 2, 4])
@pytest.mark.parametrize("cuts", [[0, 32], [0, 1, 2, 31, 32], [0, 7, 20, 32]])
def test_bands_of_rows_give_what_the_whole_page_gives(
    supersample: int, cuts: Sequence[int]
) -> None:
    layouts = [random_triangles(20, 0.1, 1), random_triangles(20, 0.02, 2)]
    charts = [np.arange(20, dtype=np.int32), np.arange(20, 40, dtype=np.int32)]
    placed = placed_faces(layouts, charts, SIZE, SIZE)
    whole = texels(placed, range(SIZE), supersample)
    parts = [texels(placed, range(low, high), supersample) for low, high in pairwise(cuts)]
    assert (np.diff(whole.pixel) >= 0).all()
    for name in ("pixel", "owner", "face", "chart", "weights", "inside"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert np.array_equal(getattr(whole, name), joined)


def test_owners_and_faces_are_those_of_the_layouts() -> None:
    first, second = np.zeros((3, 3, 2)), random_triangles(4, 0.1, 5)
    charts = [np.full(3, -1, np.int32), np.array([7, -1, 8, 9], np.int32)]
    found = texels(placed_faces([first, second], charts, SIZE, SIZE), range(SIZE))
    assert set(found.owner.tolist()) == {1}
    assert set(found.face.tolist()) <= {0, 2, 3}
    assert set(zip(found.face.tolist(), found.chart.tolist(), strict=True)) <= {
        (0, 7),
        (2, 8),
        (3, 9),
    }


@pytest.mark.parametrize("supersample", [2, 4])
def test_supersampling_takes_places_in_the_chart_or_else_the_clamped_middle(
    supersample: int,
) -> None:
    corners = random_triangles(3, 0.3, 4)
    once, found = baked(corners), baked(corners, supersample=supersample)
    assert set(found.pixel.tolist()) == set(once.pixel.tolist())
    counts = np.bincount(found.pixel, minlength=SIZE * SIZE)
    clamped = ~found.inside
    assert (counts[found.pixel[clamped]] == 1).all()
    off = np.abs(places(corners, found) - centres(found)).max(axis=1)
    assert (off[found.inside] < 0.5).all()
    steps = (places(corners, found) * supersample - 0.5)[found.inside]
    assert np.abs(steps - np.round(steps)).max() < 1e-9
    deep = counts[once.pixel[once.inside]]
    assert int(deep.max()) == supersample**2


def test_supersamples_do_not_stray_into_another_chart() -> None:
    left = np.array([(4.0, 4.0), (10.4, 4.0), (10.4, 20.0)]) / SIZE
    right = np.array([(10.6, 4.0), (18.0, 4.0), (10.6, 20.0)]) / SIZE
    chart = np.array([0, 1], np.int32)
    found = baked(np.stack([left, right]), chart=chart, supersample=4)
    first = np.unique(found.pixel, return_index=True)[1]
    of_pixel = dict(zip(found.pixel[first].tolist(), found.chart[first].tolist(), strict=True))
    assert [of_pixel[pixel] for pixel in found.pixel.tolist()] == found.chart.tolist()

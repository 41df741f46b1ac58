"""Texture coordinates that are there: which can hold a lightmap, what is wrong with the others, their charts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from aobake.atlas.existing import Unfolded, Verdict, chart_numbers, face_areas, judge
from tests.scenes import FloatArray, IntArray, icosphere, patch

SIZE = 1024


def grid(cells: int, low: float = 0.01, high: float = 0.99) -> FloatArray:
    """(2 cells^2, 3, 2) a square of triangles."""
    mesh = patch((low, low, 0), (high, low, 0), (high, high, 0), (low, high, 0), cells, cells)
    return mesh.vertices[mesh.faces][..., :2]


def unfolded(
    corners: FloatArray, name: str = "mesh 'seat'", areas: FloatArray | None = None
) -> Unfolded:
    """Coordinates of a mesh whose faces all have the same area, if nothing else is said."""
    surface = np.ones(len(corners)) if areas is None else areas
    return Unfolded(name=name, corners=corners, areas=surface)


def verdict(*corners: FloatArray) -> Verdict:
    return judge([unfolded(uv) for uv in corners], 0, SIZE)


# -- what can be kept ------------------------------------------------------------------------------


def test_a_sound_layout_is_without_fault() -> None:
    found = verdict(grid(12))
    assert found.fault is None
    assert found.uv_set == 0
    assert found.sentence == "TEXCOORD_0 is in range and free of overlaps"


def test_mirrored_charts_and_meshes_side_by_side_are_sound() -> None:
    left, right = grid(5, 0.0, 0.5), grid(5, 0.0, 0.5)[:, ::-1] + np.array([0.5, 0.0])
    assert verdict(left, right).fault is None


def test_nothing_is_without_fault() -> None:
    assert judge([], 0, SIZE).fault is None
    assert verdict(np.zeros((0, 3, 2))).fault is None
    assert judge([unfolded(np.full((2, 3, 2), np.nan), areas=np.zeros(2))], 0, SIZE).fault is None


def test_half_a_texel_beyond_the_border_is_in_range() -> None:
    assert verdict(grid(3, -0.49 / SIZE, 1.0 + 0.49 / SIZE)).fault is None
    assert verdict(grid(3, 0.0, 1.0 + 0.51 / SIZE)).fault == "out of range"


# -- what is wrong ---------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_is_named(bad: float) -> None:
    corners = grid(3)
    corners[7, 1, 0] = bad
    found = verdict(grid(2), corners)
    assert found.fault == "not finite"
    assert found.triangles == ((1, 7),)
    assert found.sentence == (
        "TEXCOORD_0: 1 of 26 triangles have coordinates that are not finite, "
        "triangle 7 of mesh 'seat' among them"
    )


def test_a_whole_unit_aside_is_out_of_range() -> None:
    found = verdict(grid(3) + np.array([1.0, 0.0]))
    assert (found.fault, found.count) == ("out of range", 18)


def test_faces_with_a_surface_but_without_a_place_are_collapsed() -> None:
    corners = grid(10)
    corners[4] = corners[4, 0]
    found = verdict(corners)
    assert (found.fault, found.count, found.triangles) == ("collapsed", 1, ((0, 4),))


def test_a_set_that_holds_values_instead_of_places_is_collapsed() -> None:
    values = np.random.default_rng(0).random((50, 3, 1))
    found = verdict(np.concatenate([values, np.full_like(values, 0.5)], axis=2))
    assert (found.fault, found.count) == ("collapsed", 50)


def test_faces_too_small_for_a_texel_may_collapse() -> None:
    corners, areas = grid(10), np.ones(200)
    corners[4], areas[4] = corners[4, 0], 1e-9
    assert judge([unfolded(corners, areas=areas)], 0, SIZE).fault is None


def test_meshes_in_one_place_overlap() -> None:
    layouts = [unfolded(grid(4)), unfolded(grid(4), "mesh 'leg'")]
    found = judge(layouts, 1, SIZE)
    assert (found.fault, found.count) == ("overlapping", 64)
    assert found.triangles[0][0] == 0
    assert found.sentence.startswith(
        "TEXCOORD_1: 64 of 64 triangles overlap others, triangle 0 of "
    )
    assert "overlaps triangle" in found.sentence
    assert found.sentence.endswith("among them")


def test_a_neighbour_that_is_folded_back_overlaps() -> None:
    a, b, c = np.array([(0.1, 0.1), (0.5, 0.1), (0.1, 0.5)])
    assert verdict(np.array([(a, b, c), (c, b, (0.5, 0.5))])).fault is None
    found = verdict(np.array([(a, b, c), (c, b, (0.2, 0.2))]))
    assert (found.fault, found.triangles) == ("overlapping", ((0, 0), (0, 1)))


@pytest.mark.parametrize(("texels", "fault"), [(0.4, None), (0.6, "overlapping")])
def test_charts_may_overlap_by_half_a_texel(texels: float, fault: str | None) -> None:
    left, right = grid(4, 0.0, 0.25), grid(4, 0.0, 0.25)
    right[..., 0] += 0.25 - texels / SIZE
    assert verdict(left, right).fault == fault


def test_fine_meshes_in_one_place_overlap_though_no_triangle_is_a_texel_high() -> None:
    fine = grid(60, 0.5, 0.52)
    assert verdict(fine).fault is None
    assert verdict(fine, fine[:, ::-1]).fault == "overlapping"


def test_coordinates_of_few_bits_are_sound() -> None:
    """Rounded to 12 bits, triangles of half a texel fold over their neighbours or collapse here and there."""
    rng = np.random.default_rng(2)
    mesh = patch((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), 40, 40)
    jitter = rng.uniform(-0.5, 0.5, (len(mesh.vertices), 2)) / 40
    uv = 0.1 + 0.02 * (mesh.vertices[:, :2] + jitter)
    folded = unfolded((np.round(uv * 4095.0) / 4095.0)[mesh.faces], areas=np.full(3200, 0.0002))
    assert judge([folded], 0, SIZE).fault is not None  # were that all there is
    assert judge([unfolded(grid(10, 0.2)), folded], 0, SIZE).fault is None


def depth(one: FloatArray, other: FloatArray) -> float:
    """The least shift that parts two triangles: from 0 to the edge of the hull of their differences."""
    hull = ConvexHull((one[:, None] - other[None]).reshape(-1, 2))
    return float((-hull.equations[:, -1]).min())


@pytest.mark.parametrize("reach", [0.02, 0.08])
@pytest.mark.parametrize("count", [30, 80])
def test_overlaps_are_those_of_every_pair_compared(reach: float, count: int) -> None:
    rng = np.random.default_rng(count)
    corners = rng.uniform(0.1, 0.9, (count, 1, 2)) + rng.uniform(-reach, reach, (count, 3, 2))
    flat = corners * SIZE
    deepest = np.array(
        [max(depth(flat[i], flat[j]) for j in range(count) if j != i) for i in range(count)]
    )
    sides = np.linalg.norm(flat - np.roll(flat, 1, axis=1), axis=2).max(axis=1)
    u, v = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    height = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / sides
    expected = deepest > np.minimum(0.5, 0.5 * height)
    found = verdict(corners)
    assert found.count == int(expected.sum())
    if expected.any():
        (_, first), (_, other) = found.triangles
        assert first == int(np.argmax(expected))
        assert depth(flat[first], flat[other]) > 0.0


def test_thousands_in_one_place_are_found_without_comparing_all() -> None:
    """20,000 triangles have 2e8 pairs."""
    found = verdict(np.tile(grid(1), (10_000, 1, 1)))
    assert found.count == 20_000


# -- areas and charts ------------------------------------------------------------------------------


def test_areas_are_those_of_the_surface_and_zero_where_it_is_not_finite() -> None:
    sphere = icosphere(5)
    assert abs(face_areas(sphere.vertices, sphere.faces).sum() - 4.0 * np.pi) < 0.01
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (np.nan, 0, 0), (1e200, 1e200, 0)])
    faces = np.array([(0, 1, 2), (0, 1, 3), (0, 1, 1), (0, 2, 4)])
    assert face_areas(vertices, faces)[:3].tolist() == [0.5, 0.0, 0.0]
    assert np.isfinite(face_areas(vertices, faces)).all()


def charts(corners: FloatArray, faces: IntArray, usable: list[bool] | None = None) -> list[int]:
    chosen = np.ones(len(faces), bool) if usable is None else np.array(usable)
    return [int(number) for number in chart_numbers(corners, faces, chosen)]


def test_a_chart_ends_where_coordinates_or_vertices_part() -> None:
    strip = np.array([(0, 1, 2), (2, 1, 3), (2, 3, 4), (4, 3, 5)], np.int32)
    uv = np.array([(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1.0)]) / 2.0
    whole = uv[strip]
    assert charts(whole, strip) == [0, 0, 0, 0]
    parted = whole.copy()
    parted[2:] += 0.001
    assert charts(parted, strip) == [0, 0, 1, 1]
    apart = strip.copy()
    apart[2:] += 10  # the same place on the image, but not on the surface
    assert charts(whole, apart) == [0, 0, 1, 1]


def test_charts_that_meet_in_a_corner_are_two_and_unusable_faces_join_nothing() -> None:
    fan = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4)], np.int32)
    uv = np.array([(0.5, 0.5), (1, 0.5), (1, 1), (0.5, 1), (0, 1)])
    assert charts(uv[fan], fan) == [0, 0, 0]
    assert charts(uv[fan], fan, [True, False, True]) == [0, -1, 1]
    assert charts(uv[fan], fan, [False] * 3) == [-1, -1, -1]
    assert charts(np.zeros((0, 3, 2)), np.zeros((0, 3), np.int32)) == []


def test_three_faces_at_an_edge_are_one_chart() -> None:
    fins = np.array([(0, 1, 2), (1, 0, 3), (0, 1, 4)], np.int32)
    uv = np.random.default_rng(0).random((5, 2))
    assert charts(uv[fins], fins) == [0, 0, 0]

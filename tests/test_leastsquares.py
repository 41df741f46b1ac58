"""Least-squares vertex baking: constants and planes come back, triangles that are too large are made good."""

from __future__ import annotations

import numpy as np
import pytest

from aobake import BakeSettings, Scene, bake_vertices, plan
from aobake.leastsquares.samples import more_samples, places_in_triangles, shares
from aobake.leastsquares.system import jump_matrix, mass_matrix, right_side, solver
from aobake.leastsquares.triangles import FittedTriangles, fitted_triangles
from aobake.meshes.surfaces import surfaces_of
from aobake.prepare import build
from aobake.study.bench import Bench, Surface, bench_of, surface_of_bench
from tests.scenes import (
    TURNED,
    FloatArray,
    Triangles,
    box,
    flipped,
    floor,
    icosphere,
    moved,
    subdivided,
    unwelded,
)


def triangles_of(mesh: Triangles) -> FittedTriangles:
    scene, settings = Scene.from_arrays(*mesh), BakeSettings()
    return fitted_triangles(scene, build(scene, surfaces_of(scene, settings), settings))


def bumpy(subdivisions: int, depth: float, waves: float) -> Triangles:
    """A body with hollows about as wide as its triangles are long, or a few times that."""
    ball = icosphere(subdivisions)
    x, y, z = waves * ball.vertices.T
    radius = 1.0 + depth * np.sin(x) * np.sin(0.9 * y + 1.0) * np.sin(1.1 * z)
    return Triangles(ball.vertices * radius[:, None], ball.faces)


def coarse_scenes() -> list[Scene]:
    """Bodies of 320 to 1,280 faces, and a pit of 40, whose corners say little of what lies between them."""
    pit = unwelded(flipped(subdivided(box((-1.0, -1.0, 0.0), (1.0, 1.0, 1.5), without=("+z",)))))
    bodies = (bumpy(3, 0.3, 9.0), bumpy(2, 0.3, 5.0), bumpy(3, 0.2, 7.0), pit)
    return [Scene.from_arrays(*mesh) for mesh in bodies]


def error_between(bench: Bench, surface: Surface, *, fitted: bool) -> float:
    """Root mean square error of what vertices interpolate to, against a dense bake inside the faces."""
    found = surface.run(bench.fixed(256, 1), fitted=fitted)[0]
    return float(np.sqrt(np.mean(np.square(found - surface.truth))))


def test_fitted_values_are_closer_to_the_truth_between_the_vertices() -> None:
    gains = []
    for scene in coarse_scenes():
        bench = bench_of(scene, BakeSettings(), 1)
        surface = surface_of_bench(bench, 3000, 512)
        assert surface is not None
        point, fitted = (error_between(bench, surface, fitted=fitted) for fitted in (False, True))
        gains.append(1.0 - fitted / point)
    assert float(np.median(gains)) >= 0.35
    assert min(gains) > 0.0


def test_an_open_body_is_open_and_a_closed_room_is_closed() -> None:
    ball, room = Scene.from_arrays(*icosphere(2)), Scene.from_arrays(*flipped(subdivided(box())))
    settings = BakeSettings(rays=64, method="lsq")
    assert float(bake_vertices(ball, settings).ao[0].min()) > 1.0 - 1e-6
    assert float(bake_vertices(room, settings).ao[0].max()) < 1e-6


def test_values_and_errors_stay_in_range_and_do_not_depend_on_threads() -> None:
    scene = coarse_scenes()[3]
    one, two = (
        bake_vertices(scene, BakeSettings(rays=128, method="lsq", threads=threads))
        for threads in (1, 3)
    )
    assert one.ao[0].tobytes() == two.ao[0].tobytes()
    assert one.standard_error[0].tobytes() == two.standard_error[0].tobytes()
    assert float(one.ao[0].min()) >= 0.0
    assert float(one.ao[0].max()) <= 1.0
    assert one.rays == two.rays > 0


def test_the_error_of_fitted_values_is_what_other_seeds_show() -> None:
    scene = coarse_scenes()[2]
    found = [
        bake_vertices(scene, BakeSettings(rays=64, method="lsq", seed=seed)) for seed in range(12)
    ]
    spread = np.std([each.ao[0].astype(float) for each in found], axis=0, ddof=1)
    told = np.mean([each.standard_error[0].astype(float) for each in found], axis=0)
    ratio = np.sqrt(np.mean(told**2) / np.mean(spread**2))
    assert 0.6 < ratio < 1.6


def test_a_hard_edge_parts_what_it_divides() -> None:
    """Corners of a box with faces of their own keep values of their own."""
    apart = triangles_of(unwelded(moved(box(), TURNED)))
    welded = triangles_of(icosphere(1))
    assert apart.unknowns == 24  # three faces at each corner; the two triangles of one share
    assert welded.unknowns == 42


def test_scenes_without_anything_to_fit_are_baked_as_well() -> None:
    nothing = Scene.from_arrays(np.zeros((3, 3)), [(0, 1, 2)])
    assert bake_vertices(nothing, BakeSettings(method="lsq")).ao[0].tolist() == [1.0, 1.0, 1.0]
    empty = Scene.from_arrays(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert bake_vertices(empty, BakeSettings(method="lsq")).ao[0].shape == (0,)


# -- the system -----------------------------------------------------------------------------------


def fitted(mesh: Triangles, constant: float, gradient: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What the fit makes of a linear function, and the function at the vertices, by unknown."""
    triangles = triangles_of(mesh)
    chosen, numbers = more_samples(
        np.zeros(len(triangles), np.int64), np.full(len(triangles), 6, np.int64)
    )
    weights = places_in_triangles(chosen, numbers)
    basis = np.column_stack([1.0 - weights.sum(axis=1), weights])
    values = np.einsum("ij,ijk,k->i", basis, triangles.places[chosen], gradient) + constant
    areas = triangles.areas[chosen] / 6.0
    corners = triangles.corners[chosen]
    solve = solver(mass_matrix(corners, basis, areas, triangles.unknowns), jump_matrix(triangles))
    truth = np.zeros(triangles.unknowns)
    truth[triangles.corners] = triangles.places @ gradient + constant
    return solve(right_side(corners, basis, areas * values, triangles.unknowns)), truth


def test_a_constant_comes_back_to_the_last_digits() -> None:
    found, truth = fitted(icosphere(2), 0.37, np.zeros(3))
    assert np.abs(found - truth).max() < 1e-10


def test_a_plane_over_a_flat_mesh_costs_nothing_and_comes_back() -> None:
    """The gradient does not jump there, however the triangles lie."""
    mesh = moved(floor(1.0, 0.0, 5), TURNED)
    triangles = triangles_of(mesh)
    plane = np.zeros(triangles.unknowns)
    plane[triangles.corners] = triangles.places @ np.array([0.3, -0.7, 0.2])
    jumps = jump_matrix(triangles)
    assert abs(float(plane @ (jumps @ plane))) < 1e-15
    bent = plane**2
    assert float(bent @ (jumps @ bent)) > 1e-6
    found, truth = fitted(mesh, 0.5, np.array([0.1, 0.2, 0.0]))
    assert np.abs(found - truth).max() < 0.01  # a share of each vertex's mass is its own


def test_shares_add_up_and_samples_go_on_where_they_ended() -> None:
    dealt = shares(np.array([1.0, 0.0, 2.0, 3.0]), 10)
    assert dealt.sum() == 10
    assert dealt[1] == 0
    assert np.abs(dealt - np.array([1.0, 0.0, 2.0, 3.0]) * 10 / 6).max() < 1.0
    triangles, numbers = more_samples(np.array([2, 0]), np.array([1, 3]))
    assert triangles.tolist() == [0, 1, 1, 1]
    assert numbers.tolist() == [2, 0, 1, 2]
    inside = places_in_triangles(np.repeat(np.arange(50), 40), np.tile(np.arange(40), 50))
    assert float(inside.min()) >= 0.0
    assert float(inside.sum(axis=1).max()) <= 1.0
    assert np.allclose(inside.mean(axis=0), 1.0 / 3.0, atol=0.01)


# -- which one ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("subdivisions", "limit", "on"), [(1, None, True), (5, None, False), (5, 0.01, True)]
)
def test_auto_fits_where_triangles_are_large_and_says_why(
    subdivisions: int, limit: float | None, on: bool
) -> None:
    settings = BakeSettings(method="auto", max_distance=limit)
    effect = plan(Scene.from_arrays(*icosphere(subdivisions)), settings).effects["method"]
    assert effect.on is on
    assert "long" in effect.reason


def test_the_method_that_was_asked_for_is_the_one_that_is_planned() -> None:
    scene = Scene.from_arrays(*icosphere(1))
    assert plan(scene, BakeSettings(method="lsq")).effects["method"].on
    assert not plan(scene, BakeSettings(method="point")).effects["method"].on

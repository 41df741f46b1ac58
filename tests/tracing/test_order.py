"""Points in no order are traced along a curve, and come out as if they had one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake import BakeSettings, Scene
from aobake.meshes.surfaces import surfaces_of
from aobake.points import vertex_points
from aobake.prepare import build
from aobake.tracing import estimate as estimating
from aobake.tracing.estimate import Estimates, Request, estimate
from aobake.tracing.order import along, path
from aobake.tracing.world import World
from tests.scenes import icosphere

FloatArray = NDArray[np.float64]
RANDOM = np.random.default_rng(6)


def rough() -> tuple[World, Request]:
    """A sphere with dents, 2,562 vertices, as it is traced."""
    vertices, faces = icosphere(4, 1.0, (0.0, 0.0, 0.0))
    dents = 1.0 + 0.1 * np.sin(9.0 * vertices).prod(axis=1, keepdims=True)
    scene = Scene.from_arrays(vertices * dents, faces)
    prepared = build(scene, surfaces_of(scene, BakeSettings()), BakeSettings())
    points = vertex_points(scene, prepared)
    request = Request(
        positions=points.positions,
        normals=points.normals,
        geometric=points.normals,
        numbers=points.numbers,
        open=np.arange(len(points)) % 50 == 0,
    )
    return prepared.world, request


def content(found: Estimates) -> bytes:
    assert found.bent is not None
    arrays = (found.mean, found.standard_error, found.rays, found.states, found.bent)
    return b"".join(array.tobytes() for array in arrays)


def grid(count: int) -> FloatArray:
    """Points of a square, line by line."""
    y, x = np.divmod(np.arange(float(count * count)), count)
    return np.stack([x, y, np.zeros(count * count)], axis=1)


def mean_step(points: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).mean())


@pytest.mark.parametrize("tolerance", [None, 0.02])
def test_points_in_random_order_get_the_values_of_points_in_order(tolerance: float | None) -> None:
    world, request = rough()
    settings = BakeSettings(rays=40, tolerance=tolerance, max_rays=256, bent_normals=True)
    inside = np.argsort(request.positions[:, 2], kind="stable")  # rings, as a file may have them
    shuffled = RANDOM.permutation(len(request.positions))
    assert path(request.positions[shuffled]) is not None
    rings = estimate(world, request.only(inside), settings)
    mixed = estimate(world, request.only(shuffled), settings)
    assert content(mixed.only(np.argsort(shuffled))) == content(rings.only(np.argsort(inside)))


def test_sorting_changes_no_byte(monkeypatch: pytest.MonkeyPatch) -> None:
    world, request = rough()
    request = request.only(RANDOM.permutation(len(request.positions)))
    settings = BakeSettings(rays=40, bent_normals=True)
    in_order = content(estimate(world, request, settings))
    monkeypatch.setattr(estimating, "path", lambda _: None)
    assert in_order == content(estimate(world, request, settings))


@pytest.mark.parametrize("tolerance", [None, 0.02, "rms:0.02"])
def test_points_in_any_order_have_the_same_bytes_with_any_number_of_threads(
    tolerance: float | str | None,
) -> None:
    world, request = rough()
    request = request.only(RANDOM.permutation(len(request.positions)))
    asked: dict[str, Any] = {"tolerance": tolerance}
    settings = BakeSettings(rays=40, max_rays=256, bent_normals=True, **asked)
    found = {
        content(estimate(world, request, replace(settings, threads=threads)))
        for threads in (1, 2, 3)
    }
    assert len(found) == 1


def test_a_path_visits_every_point_once_and_neighbours_in_turn() -> None:
    points = RANDOM.permutation(grid(60))
    order = path(points)
    assert order is not None
    assert np.array_equal(np.sort(order), np.arange(len(points)))
    assert mean_step(points[order]) < 2.0
    assert mean_step(points) > 20.0


def test_what_has_an_order_is_left_in_it() -> None:
    assert path(grid(60)) is None
    several = [grid(20) + np.array([x, 0.0, 0.0]) for x in (0.0, 900.0, 30.0, 500.0)]
    assert path(np.concatenate(several)) is None


@pytest.mark.parametrize("scale", [1e-300, 1e-3, 1e9, 1e300])
def test_units_do_not_matter(scale: float) -> None:
    points = RANDOM.permutation(grid(32))
    order, scaled = path(points), path(points * scale)
    assert order is not None
    assert scaled is not None
    assert mean_step(points[scaled]) < 2.0


def test_few_points_or_points_at_one_place_need_no_path() -> None:
    far = np.array([[-1.7e308, 0.0, 0.0], [1.7e308, 0.0, 0.0]] * 500)
    for points in (np.zeros((0, 3)), np.ones((1, 3)), np.ones((900, 3)), far):
        assert path(points) is None


def test_some_points_follow_the_path_of_all() -> None:
    order = np.array([3, 0, 4, 1, 2])
    assert along(order, np.array([0, 2, 3])).tolist() == [3, 0, 2]
    assert along(None, np.array([0, 2, 3])).tolist() == [0, 2, 3]

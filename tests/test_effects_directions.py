"""Distribution, cone and distance against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from aobake import BakeSettings, Scene, SettingsError, bake_vertices, plan, visibility
from tests.known import disc_factor
from tests.scenes import (
    FAR,
    ORIGIN,
    UP,
    Triangles,
    box,
    disc,
    flipped,
    floor,
    icosphere,
    joined,
    moved,
)

COPIES = 32
RADIUS, HEIGHT = 0.8, 1.0
ALPHA = math.atan(RADIUS / HEIGHT)  # half the angle that the disc is seen under


def mean_under(mesh: Triangles, settings: BakeSettings) -> float:
    places, normals = np.tile(ORIGIN, (COPIES, 1)), np.tile(UP, (COPIES, 1))
    return float(visibility(Scene.from_arrays(*mesh), places, normals, settings).mean.mean())


def test_under_a_disc_uniform_counts_solid_angle_and_cosine_its_projection() -> None:
    above = disc(RADIUS, HEIGHT, 512)
    uniform = mean_under(above, BakeSettings(rays=4096, distribution="uniform"))
    cosine = mean_under(above, BakeSettings(rays=4096))
    assert uniform == pytest.approx(math.cos(ALPHA), abs=1e-3)  # 1 - 2 pi (1 - cos) / 2 pi
    assert cosine == pytest.approx(1.0 - disc_factor(RADIUS, HEIGHT), abs=1e-3)
    assert uniform - cosine > 0.1


@pytest.mark.parametrize("spread", [162.0, 100.0])
def test_in_a_cone_the_disc_takes_a_larger_share(spread: float) -> None:
    above, half = disc(RADIUS, HEIGHT, 512), math.radians(spread) / 2.0
    cosine = mean_under(above, BakeSettings(rays=4096, spread=spread))
    uniform = mean_under(above, BakeSettings(rays=4096, spread=spread, distribution="uniform"))
    assert cosine == pytest.approx(1.0 - (math.sin(ALPHA) / math.sin(half)) ** 2, abs=1e-3)
    expected = 1.0 - (1.0 - math.cos(ALPHA)) / (1.0 - math.cos(half))
    assert uniform == pytest.approx(expected, abs=1e-3)


def test_a_cone_inside_of_the_disc_sees_nothing_else() -> None:
    spread = 2.0 * math.degrees(ALPHA) - 2.0
    assert mean_under(disc(RADIUS, HEIGHT, 512), BakeSettings(rays=64, spread=spread)) == 0.0


def test_under_a_plane_a_limit_keeps_what_is_lower_by_either_distribution() -> None:
    ceiling, ratio = flipped(floor(height=1.0)), 0.4
    cosine = BakeSettings(rays=4096, max_distance=1.0 / ratio)
    assert mean_under(ceiling, cosine) == pytest.approx(ratio**2, abs=1e-3)
    uniform = replace(cosine, distribution="uniform")
    assert mean_under(ceiling, uniform) == pytest.approx(ratio, abs=1e-3)


def test_the_error_of_a_uniform_cone_is_honest() -> None:
    above = Scene.from_arrays(*disc(RADIUS, HEIGHT, 64, (0.5, 0.2, 0.0)))
    # Many points: 256 of them scatter by chance as much as the bound allows. And the errors of narrow cones lean to
    # one side, so that it takes the mean over as many to tell.
    places, normals = np.tile(ORIGIN, (4096, 1)), np.tile(UP, (4096, 1))
    cone = BakeSettings(rays=256, distribution="uniform", spread=150.0)
    truth = visibility(above, places[:64], normals[:64], replace(cone, rays=8192)).mean.mean()
    found = visibility(above, places, normals, cone)
    wrong = found.mean - truth
    assert np.mean(np.abs(wrong) <= 2.0 * found.standard_error) >= 0.93
    assert found.standard_error.mean() < 2.0 * float(np.sqrt(np.mean(wrong**2)))


def test_a_distance_in_per_cent_is_one_of_the_diagonal() -> None:
    mesh = joined(box(), box((0.1, 0.1, 0.6), (0.4, 0.4, 0.9)))
    scene = Scene.from_arrays(*mesh)
    length = 0.05 * math.hypot(1.0, 1.0, 1.4)
    given = bake_vertices(scene, BakeSettings(rays=64, max_distance="5%"))  # type: ignore[arg-type]
    same = bake_vertices(scene, BakeSettings(rays=64, max_distance=length))
    assert given.settings.max_distance == pytest.approx(length, rel=1e-12)
    assert np.array_equal(given.ao[0], same.ao[0])
    reason = plan(scene, BakeSettings(max_distance="5%")).effects["max_distance"].reason  # type: ignore[arg-type]
    assert f"{length:g}" in reason


@pytest.mark.parametrize("given", ["%", "5", "five%", "0%", "-1%", "nan%", "inf%"])
def test_a_distance_that_is_no_share_is_refused(given: str) -> None:
    with pytest.raises(SettingsError, match="max_distance is"):
        BakeSettings(max_distance=given)  # type: ignore[arg-type]


def test_a_share_of_nothing_is_refused() -> None:
    empty = Scene.from_arrays(np.zeros((0, 3)), np.zeros((0, 3), int))
    with pytest.raises(SettingsError, match="the scene has no size"):
        bake_vertices(empty, BakeSettings(max_distance="5%"))  # type: ignore[arg-type]


@pytest.mark.parametrize("spread", [0.0, -1.0, 180.1, math.nan])
def test_a_cone_that_is_none_is_refused(spread: float) -> None:
    with pytest.raises(SettingsError, match="spread is"):
        BakeSettings(spread=spread)


def test_a_ball_on_the_ground_is_dark_where_it_stands() -> None:
    """A point of the ball sees the endless ground as (1 - cos theta) / 2, theta from straight up."""
    ball = icosphere(3, 1.0, (0.0, 0.0, 1.0))
    found = bake_vertices(Scene.from_arrays(*ball), BakeSettings(rays=1024, ground="+z"))
    height = ball.vertices[:, 2] - 1.0
    above = height > -0.95
    assert np.abs(found.ao[0] - (1.0 + height) / 2.0)[above].max() < 0.01


def test_a_ground_under_a_huge_scene_is_as_good_as_under_a_small_one() -> None:
    ball = icosphere(2, 1.0, (0.0, 0.0, 1.0))
    wide = moved(floor(FAR, 5.0, 2), 1.0, (3.0 * FAR, 0.0, 0.0))  # far off, and seen edge-on
    mesh = joined(ball, wide)
    found = bake_vertices(Scene.from_arrays(*mesh), BakeSettings(rays=1024, ground="+z")).ao[0]
    height = ball.vertices[:, 2] - 1.0
    above = height > -0.95
    assert np.abs(found[: len(height)] - (1.0 + height) / 2.0)[above].max() < 0.01

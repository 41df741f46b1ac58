"""Cameras, tone, the ambient term's formulas, sheets: the parts of a picture by themselves."""

from __future__ import annotations

import dataclasses
import itertools
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aobake.errors import SettingsError
from aobake.render_settings import RenderSettings, Tone, size_of
from aobake.settings import GroundAxis
from aobake.shading.ambient import multi_bounce, specular_occlusion
from aobake.shading.camera import axes_from, framing, rays, sample_places
from aobake.shading.picture import as_light, displayed
from aobake.shading.preview import Preview
from aobake.shading.sheet import Sheet, check_room, sheet
from aobake.shading.tone import from_srgb, to_srgb, toned
from aobake.tracing.conditioning import UnitFrame

HERE = UnitFrame(np.zeros(3), 1.0)
SHARES = np.linspace(0.0, 1.0, 65, dtype=np.float32)


def srgb(linear: float) -> float:
    return float(to_srgb(np.array([linear], np.float32))[0])


@pytest.mark.parametrize("up", ["+y", "+z"])
@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (30, 20), (200, -70), (-90, 90)])
def test_axes_are_right_handed_and_upright(
    azimuth: float, elevation: float, up: GroundAxis
) -> None:
    axes = axes_from(azimuth, elevation, up)
    assert np.allclose(axes @ axes.T, np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[0]["xyz".index(up[1])] == pytest.approx(0.0)
    assert axes[1]["xyz".index(up[1])] >= -1e-12


def test_the_front_of_an_asset_is_seen_from_plus_z_or_from_minus_y() -> None:
    assert np.allclose(axes_from(0, 0, "+y")[2], (0, 0, 1))
    assert np.allclose(axes_from(0, 0, "+z")[2], (0, -1, 0))
    assert np.allclose(axes_from(90, 0, "+y")[2], (1, 0, 0))


@given(st.integers(0, 2**32 - 1), st.floats(0.3, 3.0), st.floats(0.05, 2.0))
def test_a_framing_camera_sees_everything_and_stands_no_farther_than_it_must(
    seed: int, aspect: float, half_height: float
) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(20, 3)) * random.uniform(0.1, 10.0, 3) + random.normal(size=3) * 5
    axes = axes_from(random.uniform(-80, 80), random.uniform(-80, 80), "+y")
    view = framing([points[:7], points[7:]], axes, half_height, aspect)
    local = (points - view.position) @ axes.T
    assert (local[:, 2] < 0.0).all()
    across = np.abs(local[:, :2] / -local[:, 2:]) / (half_height * aspect, half_height)
    assert across.max() <= 1.0
    depth = np.ptp(local[:, 2])
    assert across.max() >= 0.89 or -local[:, 2].max() == pytest.approx(depth / 4)


def test_rays_of_the_right_half_mirror_those_of_the_left_to_the_last_bit() -> None:
    view = framing([np.eye(3)], axes_from(0, 0, "+y"), 0.3, 1.5)
    for width in (6, 7):
        _, directions = rays(view, HERE, (width, 4), range(4), sample_places(5))
        grid = directions.reshape(3, 4, 5, width)
        assert np.array_equal(grid[0], -grid[0, ..., ::-1]) or width % 2
        assert np.array_equal(grid[1:], grid[1:, ..., ::-1]) or width % 2
        half = width // 2
        assert np.array_equal(grid[0, ..., :half], -grid[0, ..., : -half - 1 : -1])
        assert np.array_equal(grid[1:, ..., :half], grid[1:, ..., : -half - 1 : -1])


@pytest.mark.parametrize("count", [1, 4, 16, 100])
def test_samples_of_a_pixel_lie_in_it_in_rows_and_columns_of_their_own(count: int) -> None:
    places = sample_places(count)
    assert ((places > 0.0) & (places < 1.0)).all()
    assert len(np.unique(np.floor(places[:, 0] * count))) == count
    assert len(np.unique(places[:, 1])) == count


def test_srgb_and_back_is_where_it_began() -> None:
    assert np.abs(from_srgb(to_srgb(SHARES)) - SHARES).max() < 1e-6
    assert srgb(0.5) == pytest.approx(0.735357, abs=1e-6)


def test_a_tone_keeps_black_and_order_and_ends_at_white() -> None:
    light = np.linspace(0.0, 20.0, 500, dtype=np.float32)
    for tone in get_args(Tone):
        shown = toned(light, tone, 0.0)
        assert shown[0] == pytest.approx(0.0, abs=1e-6)
        assert shown[-1] == 1.0
        assert (np.diff(shown) >= 0.0).all()
    assert np.allclose(toned(light, "plain", 1.0), np.minimum(2.0 * light, 1.0))


def test_bounces_brighten_by_colour_and_leave_black_and_open_places_alone() -> None:
    for albedo in (0.0, 0.3, 0.8, 1.0):
        colour = np.array([[albedo], [0.0], [0.0]], np.float32) * np.ones_like(SHARES)
        shown = multi_bounce(SHARES, colour)
        assert (shown >= SHARES - 1e-6).all()
        assert (shown <= 1.0).all()
        assert shown[:, -1] == pytest.approx(1.0, abs=1e-3)
        assert (shown[0] >= shown[1] - 1e-6).all()
    # equation 9 of the paper, at albedo 1 and occlusion one half
    a, b, c = 2.0404 - 0.3324, -4.7951 + 0.6417, 2.7552 + 0.6903
    one = multi_bounce(np.array([0.5], np.float32), np.ones((3, 1), np.float32))
    assert one[0, 0] == pytest.approx(((0.5 * a + b) * 0.5 + c) * 0.5, rel=1e-6)


@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
def test_the_highlight_is_open_where_the_surface_is_and_closed_where_it_is_closed(
    roughness: float,
) -> None:
    for cosine in (0.05, 0.5, 1.0):
        facing = np.full_like(SHARES, cosine)
        share = specular_occlusion(SHARES, facing, roughness)
        assert share[-1] == 1.0
        assert share[0] == pytest.approx(0.0, abs=1e-6)
        assert (np.diff(share) >= -1e-6).all()


def picture(background: str, channel: str = "beauty") -> Preview:
    """Two pixels: half covered by light of 0.5, and nothing."""
    pixels = np.zeros((1, 2, 4), np.float32)
    pixels[0, 0] = (0.25, 0.25, 0.25, 0.5)
    settings = RenderSettings(background=background, channel=channel)  # type: ignore[arg-type]
    return Preview(pixels=pixels, settings=settings, effects={}, seconds={}, warnings=())


def test_light_is_laid_over_the_background_before_the_displays_curve() -> None:
    shown, light = displayed(picture("#800000")), as_light(picture("#800000"))
    red = ((128 / 255 + 0.055) / 1.055) ** 2.4
    assert shown.shape == (1, 2, 3)
    assert shown[0, 0] == pytest.approx((srgb(0.25 + 0.5 * red), srgb(0.25), srgb(0.25)), abs=1e-6)
    assert shown[0, 1] == pytest.approx((128 / 255, 0.0, 0.0), abs=1e-6)
    assert light[0, 0] == pytest.approx((0.25 + 0.5 * red, 0.25, 0.25, 1.0), abs=1e-6)


def test_a_transparent_picture_keeps_alpha_and_is_not_multiplied_by_it() -> None:
    shown = displayed(picture("transparent"))
    assert shown[0, 0] == pytest.approx((*[srgb(0.5)] * 3, 0.5), abs=1e-6)
    assert shown[0, 1, 3] == 0.0


def test_occlusion_is_shown_as_the_number_that_it_is() -> None:
    assert displayed(picture("transparent", "ao"))[0, 0, 0] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(
    ("size", "count"), list(itertools.product(["1280x720", "500x900"], [1, 2, 5, 13]))
)
def test_a_sheet_has_the_size_asked_for_and_room_for_all(size: str, count: int) -> None:
    settings = RenderSettings(size=size)
    page = sheet(settings, [f"picture {number}" for number in range(count)])
    width, height = size_of(settings)
    assert page.pixels.shape == (height, width, 3)
    taken = np.zeros((height, width), int)
    for number, (left, top) in enumerate(page.corners):
        taken[top : top + page.cell[1], left : left + page.cell[0]] += 1
        assert left + page.cell[0] <= width
        assert top + page.cell[1] <= height
        page = page.filled(number, np.zeros((page.cell[1], page.cell[0], 3), np.float32))
    assert taken.max() == 1
    assert taken.mean() > 0.4
    assert (page.pixels[taken == 0] < 0.5).any(), "labels are drawn outside of the pictures"


def test_a_sheet_that_is_too_small_is_refused() -> None:
    with pytest.raises(SettingsError, match="too small for 13 pictures"):
        check_room(RenderSettings(size="60x40"), ["name"] * 13)
    check_room(dataclasses.replace(RenderSettings(), size="1280x720"), ["name"] * 13)


def test_a_sheet_whose_labels_could_not_be_read_is_refused() -> None:
    check_room(RenderSettings(size="400x100"), ["few", "letters"])
    with pytest.raises(SettingsError, match="labels that can be read"):
        check_room(RenderSettings(size="400x100"), ["few", "a very long label " * 8])


def test_a_long_label_makes_all_of_them_small_and_none_runs_into_the_next() -> None:
    settings = RenderSettings(size="900x700")
    apart = sheet(settings, ["HH", "HH"])
    beside = sheet(settings, ["HH", "W" * 60])

    def ink(page: Sheet, number: int) -> tuple[int, int]:
        """Width of the label of a picture, and how much is drawn outside of the pictures' columns."""
        dark = np.flatnonzero(page.pixels.min(axis=(0, 2)) < 0.7)
        starts = [left for left, _ in page.corners]
        within = [(dark >= left) & (dark < left + page.cell[0]) for left in starts]
        return int(np.ptp(dark[within[number]])), int((~np.any(within, axis=0)).sum())

    assert ink(beside, 0)[0] < ink(apart, 0)[0]
    assert ink(beside, 1)[1] == 0

"""Values of the local models that are known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

import aobake
from aobake import shading
from tests.hemisphere import UP, direction, unit

SIDE = direction(60.0)
ACROSS = direction(60.0, 180.0)  # the mirrored light of SIDE
GRAZING = direction(89.9)


def test_lambert_is_one_over_pi() -> None:
    assert shading.lambert(UP, SIDE, GRAZING) == 1.0 / math.pi


def test_phong_and_blinn_are_one_along_the_mirrored_light() -> None:
    for exponent in (0.0, 1.0, 50.0, 1e4):
        assert shading.phong(UP, SIDE, ACROSS, exponent) == pytest.approx(1.0, rel=1e-11)
        assert shading.blinn_phong(UP, SIDE, ACROSS, exponent) == pytest.approx(1.0, rel=1e-11)


def test_phong_is_the_cosine_to_the_mirrored_light_and_blinn_to_the_half_vector() -> None:
    """Light at 60 degrees, view at 20: 80 from each other in one plane, or 40 beside the mirror."""
    view = direction(20.0, 180.0)
    assert shading.phong(UP, SIDE, view, 3.0) == pytest.approx(math.cos(math.radians(40)) ** 3)
    assert shading.blinn_phong(UP, SIDE, view, 3.0) == pytest.approx(
        math.cos(math.radians(20)) ** 3
    )


def test_phong_is_zero_where_the_mirrored_light_is_behind() -> None:
    assert shading.phong(UP, SIDE, direction(60.0), 1.0) == 0.0


def test_large_exponents_keep_their_digits_in_float32() -> None:
    """0.5 degrees off, cos^10000 is 0.683: 1 - cos is 3.8e-5, which a float32 knows to 0.2 percent."""
    n, wi = UP.astype(np.float32), direction(1.0).astype(np.float32)
    exact = math.cos(math.radians(0.5)) ** 1e4
    assert shading.blinn_phong(n, wi, n, 1e4) == pytest.approx(exact, rel=1e-4)


def test_the_half_vector_of_opposite_directions_gives_nothing() -> None:
    across = np.array([1.0, 0.0, 1e-30])
    for value in (
        shading.blinn_phong(UP, across, unit([-1.0, 0.0, 1e-30]), 0.0),
        shading.cook_torrance(UP, across, unit([-1.0, 0.0, 1e-30]), 0.3, 1.5),
        shading.v_cavity_masking(UP, across, unit([-1.0, 0.0, 1e-30])),
    ):
        assert value == 0.0


@pytest.mark.parametrize("roughness", [1e-3, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("ior", [0.5, 1.0, 1.5, 2.4])
def test_cook_torrance_along_the_normal(roughness: float, ior: float) -> None:
    """n = l = v: D = 1/(pi m^2), G = 1, F = ((ior - 1)/(ior + 1))^2, over 4."""
    expected = ((ior - 1.0) / (ior + 1.0)) ** 2 / (4.0 * math.pi * roughness**2)
    assert shading.cook_torrance(UP, UP, UP, roughness, ior) == pytest.approx(expected, rel=1e-12)


def test_cook_torrance_along_the_mirrored_light() -> None:
    """At 60 degrees, ior sqrt(3): Brewster's angle, F is half of the perpendicular part, ((1-3)/(1+3))^2."""
    value = shading.cook_torrance(UP, SIDE, ACROSS, 0.3, math.sqrt(3.0))
    assert value == pytest.approx(0.125 / (4 * math.pi * 0.09 * 0.25), rel=1e-12)


def test_cook_torrance_of_metal_along_the_normal() -> None:
    """Silver-like 0.2 + 3.9i: F = ((eta - 1)^2 + k^2)/((eta + 1)^2 + k^2)."""
    f = (0.8**2 + 3.9**2) / (1.2**2 + 3.9**2)
    for form in ("exact", "schlick"):
        value = shading.cook_torrance(UP, UP, UP, 0.5, 0.2, extinction=3.9, fresnel_form=form)
        assert value == pytest.approx(f / math.pi, rel=1e-12)


def test_schlicks_form_takes_its_place() -> None:
    """Light at 60 degrees, mirrored: v.h = 1/2, so F is 0.04 + 0.96/32 instead of 0.0892."""
    exact = shading.cook_torrance(UP, SIDE, ACROSS, 0.3, 1.5)
    schlick = shading.cook_torrance(UP, SIDE, ACROSS, 0.3, 1.5, fresnel_form="schlick")
    f = float(shading.fresnel_dielectric(0.5, 1.5))
    assert f == pytest.approx(0.0892, abs=1e-4)
    assert schlick / exact == pytest.approx(0.07 / f, rel=1e-12)


def test_an_unknown_form_of_fresnel_is_answered_with_the_nearest() -> None:
    with pytest.raises(aobake.SettingsError, match=r'fresnel_form is .* Did you mean "schlick"'):
        shading.cook_torrance(UP, UP, UP, 0.3, 1.5, fresnel_form="shlick")  # type: ignore[arg-type]


def test_a_roughness_of_zero_is_a_mirror_as_sharp_as_numbers_hold() -> None:
    mirrored = shading.cook_torrance(UP, SIDE, ACROSS, 0.0, 1.5)
    assert mirrored == shading.cook_torrance(UP, SIDE, ACROSS, 1e-4, 1.5)
    assert shading.cook_torrance(UP, SIDE, direction(59.0, 180.0), 0.0, 1.5) == 0.0


def test_torrance_sparrow_is_brightest_beyond_the_mirrored_light() -> None:
    """The paper's finding: off-specular peaks; at 45 degrees of incidence c = 3 puts it at 75."""
    angles = np.arange(30.0, 89.0, 0.5)
    light, views = direction(45.0), direction(angles, 180.0)
    peak = angles[int(np.argmax(shading.torrance_sparrow(UP, light, views, 3.0, 1.5)))]
    assert peak == pytest.approx(75.0, abs=1.0)
    assert angles[int(np.argmax(shading.phong(UP, light, views, 20.0)))] == 45.0


def test_torrance_sparrow_and_cook_torrance_agree_on_smooth_surfaces() -> None:
    """exp(-(c a)^2) is exp(-tan^2 a/m^2) for small angles with c = 1/m."""
    view = direction(61.0, 180.0)
    ts = shading.torrance_sparrow(UP, SIDE, view, 50.0, 1.5)
    assert ts == pytest.approx(float(shading.cook_torrance(UP, SIDE, view, 0.02, 1.5)), rel=1e-3)


@pytest.mark.parametrize("sigma", [0.0, 0.3, 1.0, math.pi / 2])
def test_oren_nayar_on_the_side_of_the_light_and_opposite(sigma: float) -> None:
    """v = l at 60 degrees: sin a tan b = 1.5; opposite: the cosine of the azimuth is negative."""
    s2 = sigma * sigma
    a, b = 1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    assert shading.oren_nayar(UP, SIDE, SIDE, sigma) == pytest.approx((a + 1.5 * b) / math.pi)
    assert shading.oren_nayar(UP, SIDE, ACROSS, sigma) == pytest.approx(a / math.pi)
    assert shading.oren_nayar(UP, UP, SIDE, sigma) == pytest.approx(a / math.pi)


@pytest.mark.parametrize("view", [UP, SIDE, ACROSS, direction(30.0, 70.0), GRAZING])
def test_without_roughness_diffuse_facets_are_lambert(view: np.ndarray) -> None:
    flat = 0.5 / math.pi
    assert shading.oren_nayar(UP, SIDE, view, 0.0) == pytest.approx(2.0 * flat)
    for brdf in (shading.oren_nayar_full, shading.oren_nayar_fujii, shading.fon, shading.eon):
        assert brdf(UP, SIDE, view, 0.0, 0.5) == pytest.approx(flat, rel=1e-12)
    assert shading.minnaert(UP, SIDE, view, 1.0) == pytest.approx(2.0 * flat, rel=1e-12)


@pytest.mark.parametrize("dphi", [0.0, 40.0, 90.0, 130.0, 180.0])
def test_oren_nayar_full_is_the_papers_formula(dphi: float) -> None:
    """Light at 70, view at 40 degrees, written with angles as printed."""
    sigma, rho, a, b = 0.6, 0.8, math.radians(70.0), math.radians(40.0)
    s2, c = sigma**2, math.cos(math.radians(dphi))
    c1, c3 = 1 - 0.5 * s2 / (s2 + 0.33), 0.125 * s2 / (s2 + 0.09) * (4 * a * b / math.pi**2) ** 2
    c2 = 0.45 * s2 / (s2 + 0.09) * (math.sin(a) - (0.0 if c >= 0 else (2 * b / math.pi) ** 3))
    once = c1 + c * c2 * math.tan(b) + (1 - abs(c)) * c3 * math.tan((a + b) / 2)
    twice = 0.17 * rho * s2 / (s2 + 0.13) * (1 - c * (2 * b / math.pi) ** 2)
    value = shading.oren_nayar_full(UP, direction(70.0), direction(40.0, dphi), sigma, rho)
    assert value == pytest.approx(rho / math.pi * (once + twice), rel=1e-12)


def test_oren_nayar_full_is_cut_off_where_the_papers_fit_is_negative() -> None:
    assert shading.oren_nayar_full(UP, direction(89.0), direction(89.0, 180.0), 1.5, 0.5) == 0.0


def test_minnaert_is_a_power_of_both_cosines() -> None:
    """(n.l)(n.v) = 1/4: its power k - 1, and radiance, with one n.l more, is (n.l)^k (n.v)^(k - 1)."""
    assert shading.minnaert(UP, SIDE, SIDE, 0.5) == pytest.approx(2.0 / math.pi)
    assert shading.minnaert(UP, SIDE, SIDE, 2.0) == pytest.approx(0.25 / math.pi)
    full_moon = shading.minnaert(
        UP, direction([0.0, 30.0, 85.0]), direction([0.0, 30.0, 85.0]), 0.5
    )
    radiance = full_moon * np.cos(np.radians([0.0, 30.0, 85.0]))
    assert np.allclose(radiance, 1.0 / math.pi)


def test_shares_of_two_lobes_add_up_to_one() -> None:
    assert shading.mixed(1.0, 1.0, 0.3) == 1.0
    assert shading.mixed(2.0, 10.0, 0.25) == 4.0
    assert shading.mixed(2.0, 10.0, 0.0) == 2.0
    assert shading.mixed(2.0, 10.0, 1.0) == 10.0
    single = np.ones(3, np.float32)
    assert shading.mixed(single, single, np.array([0.0, 0.5, 1.0])).dtype == np.float32
    for wrong in (-0.1, 1.1, math.nan):
        with pytest.raises(aobake.SettingsError, match="ks is"):
            shading.mixed(1.0, 1.0, wrong)

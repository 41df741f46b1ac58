"""Fresnel reflectance, distributions of facets, and what they hide of each other."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

import aobake
from aobake import shading
from tests.hemisphere import UP, direction

FloatArray = NDArray[np.float64]
Density = Callable[[FloatArray, float], NDArray[np.floating]]
COSINES = np.linspace(0.0, 1.0, 101)


def snell(cosine: FloatArray, index: complex) -> FloatArray:
    """Unpolarised reflectance by Snell's law and the amplitudes in terms of both angles' cosines."""
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / index**2 + 0j)
    s = (cosine - index * inside) / (cosine + index * inside)
    p = (index * cosine - inside) / (index * cosine + inside)
    return np.asarray(0.5 * (np.abs(s) ** 2 + np.abs(p) ** 2))


@pytest.mark.parametrize("ior", [0.4, 0.6667, 0.99, 1.33, 1.5, 2.4, 10.0])
def test_a_dielectric_follows_from_snells_law(ior: float) -> None:
    assert np.allclose(shading.fresnel_dielectric(COSINES, ior), snell(COSINES, ior), atol=1e-13)


@pytest.mark.parametrize("index", [0.2 + 3.9j, 1.5 + 7.6j, 2.5 + 3.0j, 0.05 + 4.2j])
def test_a_metal_follows_from_snells_law_with_a_complex_index(index: complex) -> None:
    got = shading.fresnel_conductor(COSINES, index.real, index.imag)
    assert np.allclose(got, snell(COSINES, index), atol=1e-13)
    single = shading.fresnel_conductor(COSINES.astype(np.float32), index.real, index.imag)
    assert single.dtype == np.float32
    assert np.allclose(single, got, rtol=1e-5)


@pytest.mark.parametrize("ior", [0.001, 0.5, 1.0, 1.5, 100.0])
def test_a_metal_without_extinction_is_a_dielectric(ior: float) -> None:
    metal = shading.fresnel_conductor(COSINES, ior, 0.0)
    assert np.allclose(metal, shading.fresnel_dielectric(COSINES, ior), rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("ior", [0.001, 0.9999999, 1.0, 1.0000001, 100.0])
@pytest.mark.parametrize("extinction", [0.0, 1e-30, 1e-8, 1.0, 100.0])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_reflectance_is_a_share_for_any_index(
    ior: float, extinction: float, dtype: type[np.floating]
) -> None:
    cosines = np.array([0.0, 1e-40, 1e-23, 1e-9, 1e-4, 0.044, 0.5, 1.0, 1.0 + 1e-6], dtype)
    for value in (
        shading.fresnel_conductor(cosines, ior, extinction),
        shading.fresnel_dielectric(cosines, ior),
    ):
        assert value.dtype == dtype
        assert ((value >= 0.0) & (value <= 1.0)).all()


def test_known_angles_of_glass() -> None:
    """4 percent at a right angle; Brewster's angle; all of it at grazing, and beyond the critical angle."""
    assert shading.fresnel_dielectric(1.0, 1.5) == pytest.approx(0.04, rel=1e-12)
    brewster = 1.0 / math.sqrt(1.0 + 1.5**2)
    perpendicular = ((1.0 - 1.5**2) / (1.0 + 1.5**2)) ** 2
    assert shading.fresnel_dielectric(brewster, 1.5) == pytest.approx(perpendicular / 2.0)
    assert shading.fresnel_dielectric(0.0, 1.5) == pytest.approx(1.0)
    critical = math.sqrt(1.0 - (1.0 / 1.5) ** 2)
    assert shading.fresnel_dielectric(critical - 1e-9, 1.0 / 1.5) == 1.0
    assert shading.fresnel_dielectric(critical + 1e-3, 1.0 / 1.5) < 0.8
    assert shading.fresnel_dielectric(0.0, 1.0) == 0.0


def test_nearly_equal_media_keep_their_digits() -> None:
    """At a right angle ((ior - 1)/(ior + 1))^2 is 2.5e-13; a difference of amplitudes would leave four digits."""
    ior = 1.000001
    exact = ((ior - 1.0) / (ior + 1.0)) ** 2
    assert shading.fresnel_dielectric(1.0, ior) == pytest.approx(exact, rel=1e-9)
    assert shading.fresnel_dielectric(np.float32(1.0), ior) == pytest.approx(exact, rel=1e-5)


def test_schlick_is_exact_at_both_ends_and_close_between() -> None:
    f0 = 0.04
    assert shading.fresnel_schlick(1.0, f0) == pytest.approx(f0, rel=1e-15)
    assert shading.fresnel_schlick(0.0, f0) == 1.0
    assert shading.fresnel_schlick(0.5, 0.0) == 0.5**5
    gap = shading.fresnel_schlick(COSINES, f0) - shading.fresnel_dielectric(COSINES, 1.5)
    assert np.abs(gap).max() < 0.036


WIDTHS: tuple[tuple[Density, tuple[float, ...]], ...] = (
    (shading.beckmann, (1e-3, 0.05, 0.3, 1.0, 3.0)),
    (shading.trowbridge_reitz, (0.05, 0.3, 1.0, 3.0)),
    (shading.cosine_power, (0.0, 1.0, 30.0, 1e4)),
    (shading.gaussian_angles, (0.0, 1.0, 2.9, 40.0, 1e3)),
)
DENSITIES = [(density, width) for density, widths in WIDTHS for width in widths]


@pytest.mark.parametrize(("density", "width"), DENSITIES)
def test_facets_cover_the_surface_that_they_make_up(density: Density, width: float) -> None:
    """The integral of D cos over the hemisphere is 1, by substitution of t = log tan."""

    def integrand(t: float) -> float:
        angle = math.atan(math.exp(t))
        value = float(density(np.asarray(math.cos(angle)), width))
        return 2.0 * math.pi * value * (math.cos(angle) * math.sin(angle)) ** 2

    points = [math.log(1e-3), math.log(0.05), 0.0]
    area, _ = quad(integrand, -20.0, 16.0, points=points, epsabs=1e-11, epsrel=1e-11, limit=500)
    assert area == pytest.approx(1.0, abs=2e-7)  # arcs below 1e-4 lose digits to cos


@pytest.mark.parametrize("density", [shading.beckmann, shading.trowbridge_reitz])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_density_is_finite_for_any_cosine(
    density: Callable[[NDArray[np.floating], float], NDArray[np.floating]],
    dtype: type[np.floating],
) -> None:
    cosines = np.array([-1.0, -1e-12, 0.0, 1e-40, 1e-12, 1e-7, 0.5, 1.0, 1.0 + 1e-6], dtype)
    for m in (0.0, 1e-3, 1.0, 10.0):
        value = density(cosines, m)
        assert value.dtype == dtype
        assert np.isfinite(value).all()
        assert (value >= 0.0).all()
        assert (value[:2] == 0.0).all()


def test_narrow_densities_keep_their_digits_in_float32() -> None:
    """cos = 1 - 2^-20 in m = 1e-3; Trowbridge and Reitz as printed are 2.6 percent off at cos = 1."""
    cosine = np.float32(1.0 - 2.0**-20)
    exact = shading.beckmann(float(cosine), 1e-3)
    assert shading.beckmann(cosine, 1e-3) == pytest.approx(float(exact), rel=1e-5)
    assert shading.trowbridge_reitz(np.float32(1.0), 1e-3) == pytest.approx(1e6 / math.pi, rel=1e-5)


def test_trowbridge_and_reitz_in_blinns_form() -> None:
    """D3 = (c3^2/(cos^2 (c3^2 - 1) + 1))^2 is pi m^2 times the density."""
    c3, cosine = 0.35, 0.8
    printed = (c3**2 / (cosine**2 * (c3**2 - 1.0) + 1.0)) ** 2
    assert math.pi * c3**2 * shading.trowbridge_reitz(cosine, c3) == pytest.approx(printed)


def test_grooves_hide_nothing_from_above_and_all_at_grazing() -> None:
    assert shading.v_cavity_masking(UP, UP, UP) == 1.0
    assert shading.v_cavity_masking(UP, direction(60.0), direction(60.0, 180.0)) == 1.0
    assert shading.v_cavity_masking(UP, UP, direction(89.9999)) < 1e-5


def test_grooves_by_their_formula() -> None:
    """v = l at 60 degrees: n.h = n.l = 1/2, v.h = 1, so G = 2/4. With l = n, n.h = v.h, so G = 2 n.v."""
    side = direction(60.0)
    assert shading.v_cavity_masking(UP, side, side) == pytest.approx(0.5)
    low = direction(75.0)
    assert shading.v_cavity_masking(UP, UP, low) == pytest.approx(2.0 * math.cos(math.radians(75)))


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: shading.beckmann(1.0, -0.1), "roughness"),
        (lambda: shading.trowbridge_reitz(1.0, math.nan), "roughness"),
        (lambda: shading.cosine_power(1.0, -1.0), "exponent"),
        (lambda: shading.gaussian_angles(1.0, -1.0), "c"),
        (lambda: shading.fresnel_dielectric(1.0, 0.0), "ior"),
        (lambda: shading.fresnel_conductor(1.0, 1.5, -1.0), "extinction"),
        (lambda: shading.fresnel_schlick(1.0, 1.5), "f0"),
    ],
)
def test_a_part_refuses_what_has_no_meaning(call: Callable[[], object], name: str) -> None:
    with pytest.raises(aobake.SettingsError, match=rf"^{name} is "):
        call()

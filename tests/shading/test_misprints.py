"""What the formulas do as the lecture prints them, and that the models do not (docs/models.md).

Each test writes the printed formula out, finds its known effect, and the right value in the model.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from aobake import shading
from tests.hemisphere import UP, albedo, direction


def area(density: np.ndarray, cosine: np.ndarray, weight: np.ndarray) -> float:
    """The integral of D cos over the hemisphere, nodes in the cosine."""
    return float(2.0 * math.pi * (density * cosine * weight).sum())


@pytest.mark.parametrize(("m", "printed"), [(0.01, 3.14), (0.3, 2.90), (1.0, 1.87)])
def test_1_the_distribution_lacks_pi_and_two_powers_of_the_cosine(m: float, printed: float) -> None:
    tangent = m * (np.arange(200_000) + 0.5) * (8.0 / 200_000)  # beyond 8 m there is nothing
    cosine = 1.0 / np.hypot(1.0, tangent)
    weight = tangent * cosine**3 * (8.0 * m / 200_000)  # d cos = tan cos^3 d tan
    tan2 = (1.0 - cosine**2) / cosine**2
    as_printed = np.exp(-tan2 / m**2) / (m**2 * cosine**2)
    assert area(as_printed, cosine, weight) == pytest.approx(printed, abs=0.006)
    assert area(shading.beckmann(cosine, m), cosine, weight) == pytest.approx(1.0, abs=1e-6)


def test_2_without_a_quarter_facets_give_back_four_times_the_light() -> None:
    def right(n: np.ndarray, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        f = shading.cook_torrance(n, wi, wo, 0.1, 0.001, extinction=100.0)
        return np.asarray(f)

    given = albedo(right, 0.0, 200, 4)
    assert given == pytest.approx(1.0, abs=0.01)
    assert 4.0 * given == pytest.approx(4.0, abs=0.05)


def test_3_half_of_the_shadowing_makes_light_and_view_unequal() -> None:
    light, view = direction(70.0), direction(20.0, 180.0)
    h = (light + view) / np.linalg.norm(light + view)
    nh, vh = float(h[2]), float(h @ view)

    def printed(wi: np.ndarray, wo: np.ndarray) -> float:
        return float(min(1.0, 2.0 * nh * wo[2] / vh, nh * wi[2] / vh))

    assert printed(light, view) != pytest.approx(printed(view, light))
    right = shading.v_cavity_masking(UP, light, view)
    assert right == shading.v_cavity_masking(UP, view, light)
    assert printed(light, view) == pytest.approx(float(right) / 2.0)


@pytest.mark.parametrize(
    ("square", "sign", "printed"), [(-1.0, 1.0, 0.0237), (1.0, 1.0, 0.0756), (-1.0, -1.0, 0.04)]
)
def test_4_and_5_signs_in_fresnels_equations(square: float, sign: float, printed: float) -> None:
    """sign: of g in the denominator c (g -+ c) + 1; square: of 1 in g^2; the last row is the right one."""
    c, eta = 1.0, 1.5
    g = math.sqrt(eta**2 + c**2 + square)
    ratio = (c * (g + c) - 1.0) / (c * (g + sign * c) + 1.0)
    value = 0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + ratio**2)
    assert value == pytest.approx(printed, abs=6e-5)
    assert shading.fresnel_dielectric(c, eta) == pytest.approx(0.04)


def test_6_schlick_with_the_surfaces_normal_whitens_what_is_lit_from_the_eye() -> None:
    """v = l at 80 degrees: light falls onto the facets at a right angle, whatever the surface does."""
    cosine = math.cos(math.radians(80.0))
    assert shading.fresnel_schlick(cosine, 0.04) == pytest.approx(0.410, abs=1e-3)
    assert shading.fresnel_schlick(1.0, 0.04) == pytest.approx(0.04)


def test_7_half_a_sum_is_no_half_vector() -> None:
    light, view = direction(60.0), direction(60.0, 180.0)
    assert ((light + view) / 2.0)[2] ** 10 == pytest.approx(0.00098, abs=1e-5)
    assert shading.blinn_phong(UP, light, view, 10.0) == pytest.approx(1.0)


@pytest.mark.parametrize(("theta", "printed"), [(10.0, 0.030), (30.0, 0.25), (60.0, 0.75)])
def test_8_projections_have_to_be_unit_vectors_too(theta: float, printed: float) -> None:
    """v = l: the azimuths are the same, so the cosine is 1, not sin^2."""
    light = direction(theta)
    flat = light - light[2] * UP
    assert flat @ flat == pytest.approx(printed, abs=2e-4)
    s2, tilt = 0.25, math.radians(theta)
    a, b = 1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    right = (a + b * math.sin(tilt) * math.tan(tilt)) / math.pi
    assert shading.oren_nayar(UP, light, light, 0.5) == pytest.approx(right)


def test_9_minnaerts_radiance_has_one_more_cosine() -> None:
    """k = 1/2, seen from the light: without it the limb is ten times as bright as the centre at 84 degrees."""
    centre, limb = UP, direction(84.26)
    brdf = shading.minnaert(UP, np.stack([centre, limb]), np.stack([centre, limb]), 0.5)
    assert brdf[1] / brdf[0] == pytest.approx(10.0, rel=1e-3)
    radiance = brdf * np.array([1.0, limb[2]])
    assert radiance[1] / radiance[0] == pytest.approx(1.0)

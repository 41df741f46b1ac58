"""How much light the models give back: never more than came, where they promise that."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from aobake import shading
from tests.hemisphere import albedo, rule

ANGLES = (0.0, 30.0, 60.0, 80.0, 89.0)


def test_the_rule_of_the_tests_integrates_the_cosine() -> None:
    around, weights = rule(50, 50)
    assert weights.sum() == pytest.approx(math.pi, rel=1e-12)
    assert (around[:, 2] * weights).sum() == pytest.approx(2.0 * math.pi / 3.0, rel=1e-12)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 5.0, 60.0])
def test_normalised_lobes_give_all_light_back_at_a_right_angle(exponent: float) -> None:
    for brdf in (shading.phong_normalised, shading.blinn_phong_normalised):
        given = albedo(partial(brdf, exponent=exponent), 0.0, 200, 4)
        assert given == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("theta", ANGLES)
@pytest.mark.parametrize("exponent", [0.0, 1.0, 20.0, 100.0])
def test_normalised_lobes_add_no_light(exponent: float, theta: float) -> None:
    for brdf in (shading.phong_normalised, shading.blinn_phong_normalised):
        assert albedo(partial(brdf, exponent=exponent), theta) < 1.001


@pytest.mark.parametrize("exponent", [1.0, 10.0, 1e4])
def test_paper_lobes_differ_from_normalised_ones_by_a_constant(exponent: float) -> None:
    rng = np.random.default_rng(1)
    around = rule(7, 9)[0]
    light = around[rng.permutation(len(around))]
    n = np.array([0.0, 0.0, 1.0])
    phong = shading.phong(n, light, around, exponent)
    constant = (exponent + 2.0) / (2.0 * math.pi)
    assert np.allclose(shading.phong_normalised(n, light, around, exponent), constant * phong)


@pytest.mark.parametrize("theta", ANGLES)
@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.6, 1.0])
def test_facets_that_mirror_everything_add_no_light(roughness: float, theta: float) -> None:
    """F is 1 to four digits for an index of 0.001 + 100 i; grooves lose light between them, and never add any."""
    given = albedo(
        lambda n, wi, wo: shading.cook_torrance(n, wi, wo, roughness, 0.001, extinction=100.0),
        theta, 200, 400,
    )  # fmt: skip
    assert given < 1.002
    assert given > 0.2


@pytest.mark.parametrize("theta", ANGLES)
@pytest.mark.parametrize("c", [1.0, 3.0, 8.0])
def test_torrance_sparrow_adds_no_light(c: float, theta: float) -> None:
    given = albedo(
        lambda n, wi, wo: shading.torrance_sparrow(n, wi, wo, c, 0.001, extinction=100.0),
        theta, 200, 400,
    )  # fmt: skip
    assert 0.2 < given < 1.002


@pytest.mark.parametrize("theta", ANGLES)
@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
def test_eon_gives_all_light_back_and_fon_some_of_it(roughness: float, theta: float) -> None:
    full = albedo(lambda n, wi, wo: shading.eon(n, wi, wo, roughness, 1.0), theta)
    once = albedo(lambda n, wi, wo: shading.fon(n, wi, wo, roughness, 1.0), theta)
    assert full == pytest.approx(1.0, abs=2e-5)  # t has a kink where l.v = (n.l)(n.v)
    assert once < full + 1e-12
    assert once > 0.77


def test_what_oren_nayar_and_minnaert_add_is_what_is_known() -> None:
    """The paper's fits are not bounded by 1: 1.005 for sigma 0.3, and a tenfold limb for k = 1/2."""
    rough = [
        albedo(lambda n, wi, wo: shading.oren_nayar(n, wi, wo, 0.3), t, 200, 400) for t in ANGLES
    ]
    assert max(rough) == pytest.approx(1.005, abs=2e-3)
    limb = albedo(lambda n, wi, wo: shading.minnaert(n, wi, wo, 0.5), 89.0)
    assert limb == pytest.approx(4.0 / 3.0 / math.sqrt(math.cos(math.radians(89.0))), rel=1e-3)


@pytest.mark.parametrize("ks", [0.0, 0.4, 1.0])
def test_two_lobes_that_add_no_light_add_none_together(ks: float) -> None:
    given = albedo(
        lambda n, wi, wo: shading.mixed(
            shading.lambert(n, wi, wo), shading.phong_normalised(n, wi, wo, 20.0), ks
        ),
        40.0,
    )
    assert given < 1.0 + 1e-9

"""What holds for every local model: finite, never negative, reciprocal, the same however it is turned."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import aobake
from aobake import shading
from aobake.shading import MODELS, Model, evaluate, model
from tests.hemisphere import UP, unit

FloatArray = NDArray[np.float64]
Case = tuple[Model, dict[str, float]]
TOUGH = {
    "exponent": (0.0, 1.0, 1e4),
    "c": (0.0, 3.0, 1e4),
    "ior": (0.001, 0.5, 1.0, 1.0000001, 1.5, 100.0),
    "extinction": (0.0, 4.0),
    "roughness": (0.0, 1e-3, 1.0),
    "sigma": (0.0, 0.3, math.pi / 2),
    "albedo": (0.0, 1.0),
    "k": (0.0, 0.5, 1.0, 2.0),
}


def cases() -> Iterator[Case]:
    """Every model with each of its parameters at its worst, the others at their defaults."""
    for each in MODELS.values():
        yield each, {}
        for parameter in each.parameters:
            for value in TOUGH[parameter.name]:
                yield each, {parameter.name: value}


CASES = tuple(cases())
IDS = [f"{each.name} {values}" for each, values in CASES]


def random_directions(count: int, seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    n, wi, wo = (unit(rng.standard_normal((count, 3))) for _ in range(3))
    return n, unit(wi + 1.1 * n), unit(wo + 1.1 * n)


component = st.sampled_from(
    [0.0, 1.0, -1.0, 1e-3, -1e-3, 1e-7, -1e-7, 1e-12, 1e-23, -1e-23, 1e-40, 5e-324, 0.6, -0.8]
) | st.floats(-1.0, 1.0)
vector = st.tuples(component, component, component).filter(lambda wo: max(map(abs, wo)) > 1e-3)
length = st.sampled_from([1.0, 1.0 - 1e-6, 1.0 + 1e-6])


@st.composite
def tough_directions(draw: st.DrawFn) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Any three directions, and often those where formulas break: v = -l, l = n, the mirrored light."""
    n, wi = unit(draw(vector)), unit(draw(vector))
    mirrored = 2.0 * float(n @ wi) * n - wi
    nudge = draw(st.sampled_from([0.0, 1e-9, 1e-7, 1e-4])) * np.asarray(draw(vector))
    wo = draw(st.sampled_from([-wi, wi, n, mirrored, unit(draw(vector))])) + nudge
    return n * draw(length), wi * draw(length), unit(wo) * draw(length)


@settings(max_examples=150, deadline=None)
@given(tough_directions(), st.sampled_from([np.float32, np.float64]))
def test_a_value_is_finite_and_never_negative(
    directions: tuple[FloatArray, FloatArray, FloatArray], dtype: type[np.floating]
) -> None:
    n, wi, wo = (direction.astype(dtype) for direction in directions)
    for each, values in CASES:
        value = evaluate(each, n, wi, wo, values)
        assert value.dtype == dtype
        assert np.isfinite(value), (each.name, values)
        assert value >= 0.0, (each.name, values)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_grazing_by_any_hair_is_finite(dtype: type[np.floating]) -> None:
    """Cosines from 1 down to where numbers end, light and view on the same and on opposite sides."""
    hair = np.concatenate([[0.0], 10.0 ** np.arange(-45.0 if dtype is np.float32 else -320.0, 1.0)])
    up, across = np.meshgrid(hair, hair)
    side = np.sqrt(np.maximum(1.0 - hair**2, 0.0))
    light = np.stack([np.broadcast_to(side, up.shape), np.zeros_like(up), up], -1).astype(dtype)
    for turn in (1.0, -1.0):
        x = turn * np.broadcast_to(side[:, None], up.shape)
        view = np.stack([x, np.zeros_like(up), across], -1).astype(dtype)
        for each, values in CASES:
            value = evaluate(each, UP.astype(dtype), light, view, values)
            assert np.isfinite(value).all(), (each.name, values)
            assert (value >= 0.0).all(), (each.name, values)


@pytest.mark.parametrize(("each", "values"), CASES, ids=IDS)
def test_light_and_view_can_be_exchanged(each: Model, values: dict[str, float]) -> None:
    """Helmholtz reciprocity, to the last bit: no sum or product depends on their order."""
    n, wi, wo = random_directions(500)
    assert (evaluate(each, n, wi, wo, values) == evaluate(each, n, wo, wi, values)).all()


@pytest.mark.parametrize("each", MODELS.values(), ids=list(MODELS))
def test_nothing_comes_from_below_the_horizon_or_goes_there(each: Model) -> None:
    n, wi, wo = random_directions(200)
    below = wi - 2.0 * (n * wi).sum(-1, keepdims=True) * n
    for light, view in ((below, wo), (wo, below), (below, below), (below, -below)):
        assert (evaluate(each, n, light, view) == 0.0).all()
    across = np.array([1.0, 0.0, 0.0])
    assert evaluate(each, UP, across, UP) == 0.0
    assert evaluate(each, UP, UP, across) == 0.0


@pytest.mark.parametrize("each", MODELS.values(), ids=list(MODELS))
def test_a_value_does_not_change_when_everything_is_turned(each: Model) -> None:
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    n, wi, wo = random_directions(500)
    turned = evaluate(each, n @ turn, wi @ turn, wo @ turn)
    assert np.allclose(turned, evaluate(each, n, wi, wo), rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("each", MODELS.values(), ids=list(MODELS))
def test_float32_agrees_with_float64(each: Model) -> None:
    """Of the same float32 directions; the models are smooth there, so rounding is all that differs."""
    n, wi, wo = (d.astype(np.float32) for d in random_directions(2000))
    low = evaluate(each, n, wi, wo)
    exact = evaluate(each, n.astype(np.float64), wi.astype(np.float64), wo.astype(np.float64))
    assert low.dtype == np.float32
    assert exact.dtype == np.float64
    assert (exact > 0.0).any()
    assert np.allclose(low, exact, rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize("each", MODELS.values(), ids=list(MODELS))
def test_any_leading_shape_goes_and_broadcasts(each: Model) -> None:
    n, wi, wo = random_directions(20)
    flat = evaluate(each, n[0], wi, wo)
    assert flat.shape == (20,)
    assert (
        evaluate(each, n[0], wi.reshape(4, 5, 3), wo.reshape(4, 5, 3)) == flat.reshape(4, 5)
    ).all()
    assert evaluate(each, n[0], wi[:4, None], wo[None, :5]).shape == (4, 5)
    assert evaluate(each, n[0], wi[0], wo[0]).shape == ()
    assert evaluate(each, n[0], wi[0], wo[0]) == flat[0]
    assert evaluate(each, n[:0], wi[:0], wo[:0]).shape == (0,)
    listed = evaluate(each, n[0].tolist(), wi[0].tolist(), wo[0].tolist())
    assert listed.dtype == np.float64
    assert listed == flat[0]


@pytest.mark.parametrize("each", [m for m in MODELS.values() if m.parameters], ids=lambda m: m.name)
def test_a_parameter_may_differ_from_point_to_point(each: Model) -> None:
    n, wi, wo = random_directions(6)
    for parameter in each.parameters:
        values = np.linspace(max(parameter.least, 0.01), min(parameter.most, 1.5), 6)
        at_once = evaluate(each, n, wi, wo, {parameter.name: values})
        one_by_one = [
            float(evaluate(each, n[i], wi[i], wo[i], {parameter.name: values[i]})) for i in range(6)
        ]
        assert np.allclose(at_once, one_by_one, rtol=1e-12)


def test_directions_are_not_changed() -> None:
    directions = random_directions(10)
    before = [d.copy() for d in directions]
    for each in MODELS.values():
        evaluate(each, directions[0], directions[1], directions[2])
    assert all((a == b).all() for a, b in zip(directions, before, strict=True))


@pytest.mark.parametrize("each", [m for m in MODELS.values() if m.parameters], ids=lambda m: m.name)
@pytest.mark.parametrize("wrong", [-0.1, 1e9, math.nan, math.inf, "0.5", None, True, [0.5, -1.0]])
def test_a_parameter_out_of_range_is_refused_in_one_line(each: Model, wrong: object) -> None:
    n, wi, wo = random_directions(2)
    for parameter in each.parameters:
        with pytest.raises(aobake.SettingsError, match=rf"^{parameter.name} is .* is needed\.$"):
            evaluate(each, n, wi, wo, {parameter.name: wrong})  # type: ignore[dict-item]


def test_an_index_of_refraction_of_zero_is_refused() -> None:
    with pytest.raises(aobake.SettingsError, match=r"^ior is 0\.0; a number from 0\.001 to 100 is"):
        shading.cook_torrance(UP, UP, UP, 0.3, 0.0)


def test_a_parameter_of_another_shape_is_refused() -> None:
    n, wi, wo = random_directions(5)
    with pytest.raises(aobake.SettingsError, match=r"roughness has the shape \(2,\)"):
        shading.cook_torrance(n, wi, wo, np.array([0.1, 0.2]), 1.5)


@pytest.mark.parametrize(
    ("normal", "light", "message"),
    [
        ([0.0, 1.0], [0.0, 0.0, 1.0], r"normal has the shape \(2,\)"),
        ([0.0, 0.0, 1.0], 1.0, r"light has the shape \(\)"),
        ([["a", "b", "c"]], [0.0, 0.0, 1.0], "real numbers are needed"),
        (
            np.zeros((2, 3)),
            np.zeros((4, 3)),
            r"do not fit together: normal \(2, 3\), light \(4, 3\)",
        ),
    ],
)
def test_directions_of_another_shape_are_refused(
    normal: object, light: object, message: str
) -> None:
    with pytest.raises(aobake.InputError, match=message):
        shading.lambert(normal, light, UP)  # type: ignore[arg-type]


def test_an_unknown_model_is_answered_with_the_nearest_and_all_of_them() -> None:
    with pytest.raises(aobake.SettingsError) as refusal:
        model("cook-torrence")
    said = str(refusal.value)
    assert 'Did you mean "cook-torrance"?' in said
    assert all(name in said for name in MODELS)
    with pytest.raises(aobake.SettingsError) as refusal:
        model("zzz")
    assert str(refusal.value).count("Known:") == 1


def test_an_unknown_parameter_is_answered_with_the_nearest() -> None:
    with pytest.raises(aobake.SettingsError, match=r'rougness.*Did you mean "roughness"'):
        evaluate(model("cook-torrance"), UP, UP, UP, {"rougness": 0.1})
    with pytest.raises(
        aobake.SettingsError, match=r"k is no parameter of lambert\. Models with it: minnaert"
    ):
        evaluate(model("lambert"), UP, UP, UP, {"k": 0.1})


def test_the_register_says_what_each_model_asks_for() -> None:
    for name, each in MODELS.items():
        assert name == each.name
        assert each.help
        assert getattr(shading, name.replace("-", "_")) is each.function
        for parameter in each.parameters:
            assert parameter.least <= parameter.default <= parameter.most
            assert parameter.help

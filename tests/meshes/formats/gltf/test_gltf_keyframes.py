"""Values between keyframes, against closed forms and values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aobake.meshes.formats.gltf.keyframes import (
    FloatArray,
    Interpolation,
    Keyframes,
    lerp,
    slerp,
    value_at,
)


def turn(degrees: float, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> FloatArray:
    """(4,) quaternion x, y, z, w of a turn about an axis."""
    half = np.radians(degrees) / 2.0
    return np.array([*(np.sin(half) * np.array(axis)), np.cos(half)])


def same_rotation(a: FloatArray, b: FloatArray) -> bool:
    """A quaternion and its opposite are one rotation."""
    return bool(abs(a @ b) > 1.0 - 1e-14)


def keys(values: list[float], interpolation: Interpolation) -> Keyframes:
    times = np.array([1.0, 2.0, 4.0])
    return Keyframes(times, np.array(values).reshape(3, -1), interpolation)


@pytest.mark.parametrize(
    ("seconds", "linear", "step"),
    [(0.0, 10, 10), (1.0, 10, 10), (1.25, 15, 10), (2.0, 30, 30), (3.5, 15, 30), (4.0, 10, 10), (9.0, 10, 10)],
)  # fmt: skip
def test_lines_lead_from_key_to_key_and_steps_wait_for_the_next(
    seconds: float, linear: float, step: float
) -> None:
    for interpolation, expected in (("LINEAR", linear), ("STEP", step)):
        found = value_at(keys([10, 30, 10], interpolation), seconds, lerp)  # type: ignore[arg-type]
        np.testing.assert_allclose(found, [expected], rtol=1e-15)


def test_a_step_is_taken_at_its_key_and_not_before() -> None:
    steps = keys([10, 30, 10], "STEP")
    assert value_at(steps, np.nextafter(2.0, 0.0), lerp) == 10
    assert value_at(steps, 2.0, lerp) == 30


def test_two_keys_at_one_time_are_a_jump() -> None:
    jump = Keyframes(np.array([0.0, 1.0, 1.0, 2.0]), np.array([[0.0], [1], [5], [6]]), "LINEAR")
    assert value_at(jump, np.nextafter(1.0, 0.0), lerp) == pytest.approx(1.0)
    assert value_at(jump, 1.0, lerp) == 5


def test_halfway_between_two_turns_is_half_the_angle() -> None:
    assert same_rotation(slerp(turn(10), turn(100), 0.5), turn(55))
    assert same_rotation(slerp(turn(0), turn(90, (1, 0, 0)), 1 / 3), turn(30, (1, 0, 0)))


def test_a_turn_goes_the_shorter_way() -> None:
    """Stored as 350 degrees, the end is 10 degrees back; its opposite quaternion is the same end."""
    for end in (turn(350), -turn(350)):
        assert same_rotation(slerp(turn(0), end, 0.5), turn(-5))


@given(st.floats(0, 179), st.floats(1e-6, 179), st.floats(0, 1))
def test_turns_run_at_constant_speed(start: float, by: float, share: float) -> None:
    found = slerp(turn(start), turn(start + by), share)
    np.testing.assert_allclose(found, turn(start + share * by), atol=1e-14)


def test_quaternions_of_any_length_stand_for_their_direction() -> None:
    assert same_rotation(slerp(3.0 * turn(10), 0.1 * turn(100), 0.5), turn(55))
    np.testing.assert_allclose(slerp(np.zeros(4), turn(90), 0.0), [0, 0, 0, 1])


def test_a_turn_that_leads_nowhere_stays() -> None:
    np.testing.assert_allclose(slerp(turn(30), turn(30), 0.7), turn(30), rtol=1e-15)


def spline(*rows: tuple[float, float, float]) -> Keyframes:
    return Keyframes(np.array([1.0, 3.0]), np.array(rows).reshape(2, 3, 1), "CUBICSPLINE")


def test_a_spline_through_a_quarter_of_its_span_as_worked_out_by_hand() -> None:
    """Values 2 and 6, slopes 1 and -3 a second over two seconds, a quarter of the way.

    27/32 * 2 + 9/64 * 2 * 1 + 5/32 * 6 - 3/64 * 2 * (-3) = 3.1875; the outer slopes do not count.
    """
    found = value_at(spline((99, 2, 1), (-3, 6, 99)), 1.5, lerp)
    np.testing.assert_allclose(found, [3.1875], rtol=1e-15)


@given(st.floats(1.0, 3.0))
def test_a_spline_with_the_slopes_of_a_cubic_is_that_cubic(seconds: float) -> None:
    def cubic(t: float) -> float:
        return 0.5 * t**3 - 2.0 * t**2 + t - 3.0

    def slope(t: float) -> float:
        return 1.5 * t**2 - 4.0 * t + 1.0

    found = value_at(spline((0, cubic(1), slope(1)), (slope(3), cubic(3), 0)), seconds, lerp)
    np.testing.assert_allclose(found, [cubic(seconds)], atol=1e-13)


def test_a_spline_holds_its_values_and_not_its_slopes_at_both_ends() -> None:
    curve = spline((7, 2, 8), (9, 6, 10))
    assert [float(value_at(curve, t, lerp)[0]) for t in (0.0, 1.0, 3.0, 5.0)] == [2, 2, 6, 6]


def test_one_key_holds_for_ever() -> None:
    for interpolation, values in (("LINEAR", [[5.0]]), ("CUBICSPLINE", [[[1.0], [5.0], [2.0]]])):
        one = Keyframes(np.array([2.0]), np.array(values), interpolation)  # type: ignore[arg-type]
        assert [float(value_at(one, t, lerp)[0]) for t in (0.0, 2.0, 3.0)] == [5, 5, 5]

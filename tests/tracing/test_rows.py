"""What holds of rows is what numpy says of them, for every kind of number."""

from __future__ import annotations

import numpy as np

from aobake.tracing.rows import any_in_rows, bounds, finite_rows, largest_in_rows

KINDS = np.array([0.0, -0.0, 1.5, -2.0, 5e-324, np.inf, -np.inf, np.nan])
ROWS = np.stack(np.meshgrid(KINDS, KINDS, KINDS), axis=-1).reshape(-1, 3)


def test_rows_are_told_as_numpy_tells_them() -> None:
    assert np.array_equal(finite_rows(ROWS), np.isfinite(ROWS).all(axis=1))
    assert np.array_equal(any_in_rows(ROWS), ROWS.any(axis=1))
    assert np.array_equal(largest_in_rows(ROWS), np.abs(ROWS).max(axis=1), equal_nan=True)


def test_a_box_has_the_lowest_and_the_highest_of_each_coordinate() -> None:
    points = np.array([[1.0, 5.0, -3.0], [2.0, -5.0, 0.0], [0.0, 0.0, 9.0]])
    low, high = bounds(points)
    assert low.tolist() == [0.0, -5.0, -3.0]
    assert high.tolist() == [2.0, 5.0, 9.0]


def test_no_rows_give_no_answers() -> None:
    none = np.zeros((0, 3))
    assert len(finite_rows(none)) == len(any_in_rows(none)) == len(largest_in_rows(none)) == 0

"""Equal rows, found by hash, against a dictionary."""

from __future__ import annotations

import numpy as np
import pytest

from aobake.meshes.coincident import first_equal_row


@pytest.mark.parametrize("seed", range(4))
def test_the_first_equal_row_is_the_one_a_dictionary_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.integers(0, 4, (500, 3)).astype(np.float64)
    more = rng.integers(0, 2, (500, 2)).astype(np.float64)
    seen: dict[tuple[float, ...], int] = {}
    expected = [seen.setdefault(tuple(row), number) for number, row in enumerate(rows)]
    assert first_equal_row(rows).tolist() == expected
    seen = {}
    both = np.column_stack([rows, more])
    expected = [seen.setdefault(tuple(row), number) for number, row in enumerate(both)]
    assert first_equal_row(rows, more).tolist() == expected


def test_zero_equals_minus_zero_and_neighbouring_numbers_differ() -> None:
    tiny = np.nextafter(0.0, 1.0)
    rows = np.array([[0.0], [-0.0], [tiny], [1.0], [np.nextafter(1.0, 2.0)], [1.0]])
    assert first_equal_row(rows).tolist() == [0, 0, 2, 3, 4, 3]


def test_no_rows_are_no_rows() -> None:
    assert first_equal_row(np.zeros((0, 3))).tolist() == []


def test_rows_given_in_any_layout() -> None:
    rows = np.asfortranarray(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [1.0, 2.0, 3.0]]))
    assert first_equal_row(rows).tolist() == [0, 1, 0]
    assert first_equal_row(rows[::-1]).tolist() == [0, 1, 0]

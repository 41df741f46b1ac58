"""Eight lanes at once give what one after the other gives, to the last bit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import inlined, kernel
from aobake.tracing.kernels import changes
from aobake.tracing.lanes import (
    at_most,
    below,
    count,
    divided,
    eight,
    minus,
    picked,
    plus,
    put,
    put_mask,
    spread,
    times,
)

LANES = 8
AWKWARD = np.array([0.0, -0.0, 1.5, -2.25, np.inf, -np.inf, np.nan, 1e-42], np.float32)


@inlined
def difference_and_more(a, b):  # type: ignore[no-untyped-def]
    """Every operation that gives a row, from two rows."""
    return plus(a, b), minus(a, b), times(a, b), divided(a, b)


@kernel
def _rows(a, b, out):  # type: ignore[no-untyped-def]
    first, second = eight(a, 8), eight(b, 8)
    total, difference, product, ratio = difference_and_more(first, second)  # type: ignore[no-untyped-call]
    put(out, 0, total)
    put(out, 8, difference)
    put(out, 16, product)
    put(out, 24, ratio)
    put(out, 32, picked(0b10100101, first, second))
    put(out, 40, spread(a[10]))


@kernel
def _sets(a, b, sets, mask):  # type: ignore[no-untyped-def]
    first, second = eight(a, 0), eight(b, 0)
    sets[0], sets[1] = below(first, second), at_most(first, second)
    sets[2] = count(sets[0])
    put_mask(mask, 8, 0b11010010)


@kernel
def _changes(is_open, counts, before, out):  # type: ignore[no-untyped-def]
    for i in range(len(counts)):
        out[i, 0], out[i, 1] = changes(is_open[i], counts[i], before[i])  # type: ignore[no-untyped-call]


def bits_of(lanes: NDArray[np.bool_]) -> int:
    return sum(1 << k for k in range(LANES) if lanes[k])


def test_rows_hold_what_numpy_gives_lane_by_lane() -> None:
    a = np.concatenate([np.zeros(8, np.float32), AWKWARD])
    b = np.concatenate([np.zeros(8, np.float32), np.roll(AWKWARD, 3)])
    out = np.zeros(48, np.float32)
    _rows(a, b, out)
    x, y = a[8:], b[8:]
    with np.errstate(all="ignore"):
        expected = [x + y, x - y, x * y, x / y]
    expected += [np.where([True, False, True, False, False, True, False, True], x, y)]
    expected += [np.full(8, a[10])]
    found = out.reshape(6, 8)
    for row, wanted in zip(found, expected, strict=True):
        known = ~np.isnan(wanted)
        assert np.array_equal(np.isnan(row), ~known)
        assert row[known].tobytes() == wanted[known].astype(np.float32).tobytes()


def test_sets_of_lanes_are_bits_and_leave_out_what_is_no_number() -> None:
    a, b = AWKWARD, np.roll(AWKWARD, 1)
    sets, mask = np.zeros(3, np.int64), np.full(24, 7, np.int32)
    _sets(a, b, sets, mask)
    assert sets[0] == bits_of(a < b)
    assert sets[1] == bits_of(a <= b)
    assert sets[2] == np.count_nonzero(a < b)
    assert mask.tolist() == [7] * 8 + [0, -1, 0, 0, -1, 0, -1, -1] + [7] * 8


def test_successive_rays_that_count_are_compared_whatever_lies_between_them() -> None:
    numbers = np.random.default_rng(5).integers(0, 256, (4000, 2))
    counts = np.where(np.arange(4000) % 3 == 0, 255, numbers[:, 0])
    is_open = numbers[:, 1] & counts
    before = np.array([-1.0, 0.0, 0.25, 1.0])[np.arange(4000) % 4]
    found = np.zeros((4000, 2))
    _changes(is_open, counts, before, found)
    for i in range(4000):
        values = [float(is_open[i] >> k & 1) for k in range(LANES) if counts[i] >> k & 1]
        row = [before[i], *values] if before[i] >= 0.0 else values
        assert found[i, 0] == np.square(np.diff(row)).sum()
        assert found[i, 1] == (values[-1] if values else before[i])

"""Memory for kernels: zeros that do not overlap, given back, and never more than there is."""

from __future__ import annotations

import numpy as np

from aobake.tracing.arena import LINE, give_back, reserved, taken, zeros
from aobake.tracing.compiled import kernel


@kernel
def fill(memory, rounds, addresses, dirty):  # type: ignore[no-untyped-def]
    """Take three arrays again and again, and note where they lie and whether they were zeros."""
    for n in range(rounds):
        mark = taken(memory)  # type: ignore[no-untyped-call]
        a, b = zeros(memory, 3, np.float64), zeros(memory, (2, 5), np.int16)
        c = zeros(memory, (2, 2, 2), np.bool_)
        for i in range(3):
            dirty[0] += a[i] != 0.0
            a[i] = i
        for i in range(2):
            for k in range(5):
                dirty[0] += b[i, k] != 0
                b[i, k] = 7
        dirty[0] += c[1, 1, 1]
        c[1, 1, 1] = True
        addresses[n, 0], addresses[n, 1] = a.ctypes.data, b.ctypes.data
        addresses[n, 2] = c.ctypes.data
        dirty[0] += (a[2] != 2.0) + (b[1, 4] != 7)
        give_back(memory, mark)  # type: ignore[no-untyped-call]


def test_pieces_are_zeros_on_lines_of_their_own_and_are_given_back() -> None:
    memory, addresses = reserved(24 + 20 + 8, 3), np.zeros((4, 3), np.int64)
    dirty = np.zeros(1, np.int64)
    fill(memory, 4, addresses, dirty)
    assert dirty[0] == 0
    assert (addresses == addresses[0]).all()
    assert (addresses % LINE == 0).all()
    assert np.diff(addresses[0]).tolist() == [LINE, LINE]
    assert memory[:8].view(np.int64)[0] == 0


def test_more_than_there_is_comes_from_elsewhere_and_nothing_is_written_over() -> None:
    memory = reserved(24, 1)
    around = np.zeros((3, 3), np.int64)
    dirty = np.zeros(1, np.int64)
    fill(memory, 3, around, dirty)
    assert dirty[0] == 0
    begin = memory.ctypes.data
    inside = (around >= begin) & (around < begin + len(memory))
    np.testing.assert_array_equal(inside, [[True, False, False]] * 3)

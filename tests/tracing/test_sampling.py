"""Direction sets: spread as the cosine asks, in an order in which neighbours travel together."""

from __future__ import annotations

import numpy as np
import pytest

from aobake.tracing.sampling import (
    LANES,
    SETS,
    SIZES,
    direction_sets,
    vogel_disc,
)
from tests.scenes import FloatArray


def flat(rays: int, number: int = 0) -> FloatArray:
    """(rays, 3) one set, without the lanes that fill up the last packet."""
    lanes = direction_sets(rays)[number].transpose(0, 2, 1)
    return np.asarray(lanes.reshape(-1, 3)[:rays], np.float64)


@pytest.mark.parametrize("rays", [1, 7, 8, 9, 64, 1000, 4096])
def test_directions_are_unit_vectors_above_the_horizon(rays: int) -> None:
    sets = direction_sets(rays)
    assert sets.shape == (SETS, -(-rays // LANES), 3, LANES)
    assert sets.dtype == np.float32
    assert np.allclose(np.linalg.norm(sets, axis=2), 1.0, atol=1e-6)
    assert float(sets[:, :, 2].min()) > 0.0


@pytest.mark.parametrize("rays", [1, 7, 9, 1001])
def test_the_lanes_behind_the_last_direction_repeat_it(rays: int) -> None:
    lanes = direction_sets(rays).transpose(0, 1, 3, 2).reshape(SETS, -1, 3)
    assert (lanes[:, rays:] == lanes[:, rays - 1 : rays]).all()


@pytest.mark.parametrize("number", range(0, SETS, 5))
def test_moments_are_those_of_the_cosine(number: int) -> None:
    """With pdf z / pi: z^2 is uniform, so E[z] = 2/3, E[z^2] = 1/2, E[z^4] = 1/3; E[x] = E[xy] = 0."""
    x, y, z = flat(4096, number).T
    for moment, exact in (
        (z, 2.0 / 3.0), (z**2, 0.5), (z**4, 1.0 / 3.0), (x**2, 0.25), (y**2, 0.25),
        (x, 0.0), (y, 0.0), (x * y, 0.0), (x * z, 0.0),
    ):  # fmt: skip
        assert abs(float(moment.mean()) - exact) < 1e-3


def test_no_part_of_the_disc_is_left_out() -> None:
    """Rings and sectors of equal area hold their share to within a few points of 4096."""
    disc = vogel_disc(4096, 0.5)
    rings = np.histogram((disc**2).sum(axis=1), 16, (0.0, 1.0))[0]
    sectors = np.histogram(np.arctan2(disc[:, 1], disc[:, 0]), 16, (-np.pi, np.pi))[0]
    assert np.abs(rings - 256).max() <= 1
    assert np.abs(sectors - 256).max() <= 8


def test_sets_differ_from_each_other() -> None:
    sets = direction_sets(64)
    assert len({sets[number].tobytes() for number in range(SETS)}) == SETS


@pytest.mark.parametrize("rays", [64, 1024, 4096])
def test_neighbours_in_the_order_are_neighbours_on_the_disc(rays: int) -> None:
    """A step is about as long as the points are apart, 1/sqrt(rays / pi); in the spiral's own order
    it is about 1."""
    steps = np.linalg.norm(np.diff(flat(rays)[:, :2], axis=0), axis=1)
    assert float(steps.mean()) < 1.5 * np.sqrt(np.pi / rays)
    assert float(np.median(steps)) < 1.3 * np.sqrt(np.pi / rays)


def test_sets_are_made_once_and_cannot_be_changed() -> None:
    assert direction_sets(32) is direction_sets(32)
    with pytest.raises(ValueError, match="read-only"):
        direction_sets(32)[0, 0, 0, 0] = 0.0


def test_sizes_are_whole_packets_and_close_to_any_number() -> None:
    sizes = np.array(SIZES)
    assert (sizes % LANES == 0).all()
    assert sizes[-1] == 1 << 20
    assert (np.diff(sizes) > 0).all()
    assert (sizes[1:] <= 1.26 * sizes[:-1])[sizes[1:] > 40].all()


def test_large_sets_are_fewer_so_that_none_takes_much_memory() -> None:
    assert len(direction_sets(1 << 14)) == SETS
    for size in ((1 << 14) + 8, 1 << 16, 1 << 18):
        sets = len(direction_sets(size))
        assert sets & (sets - 1) == 0  # a mask picks one of them
        assert 1 <= sets <= (1 << 18) // size

"""How many rays the next set of each point has, by what is known of it and of its neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.settings import BakeSettings, TraceSettings
from aobake.tracing.neighbours import Neighbours
from aobake.tracing.rounds import AIM, PILOT, missing
from aobake.tracing.sampling import SIZES
from aobake.tracing.tally import Tally
from tests.tracing.test_tally import sums

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def row(count: int) -> Neighbours:
    """Points on a plane, one after the other."""
    return Neighbours.along(np.arange(count), np.tile((0.0, 0.0, 1.0), (count, 1)))


def after(boundary: FloatArray, rays: int) -> Tally:
    """Half-open points of boundaries so long, after a set of so many rays."""
    found = Tally.blank(len(boundary))
    found.add(np.arange(len(boundary)), sums(boundary, rays), rays)
    return found


def asked(**settings: object) -> TraceSettings:
    chosen: TraceSettings = BakeSettings(**settings)  # type: ignore[arg-type]
    return chosen


def with_next(tally: Tally, boundary: float, sizes: IntArray) -> FloatArray:
    """The standard error once everyone has had the next set."""
    for size in np.unique(sizes).tolist():
        chosen = np.flatnonzero(sizes == size)
        tally.add(chosen, sums(np.full(len(chosen), boundary), size), size)
    return np.sqrt(tally.variance(row(len(sizes)).behind(tally)))


@pytest.mark.parametrize("boundary", [0.0, 0.5, 2.0, 5.0])
@pytest.mark.parametrize("tolerance", [0.02, 0.005, 0.001])
def test_the_next_set_is_as_large_as_it_takes(tolerance: float, boundary: float) -> None:
    """Within what whole sizes, and a law of n^-1.5 for the few rays as well, leave over."""
    found = after(np.full(40, boundary), 64)
    sizes = missing(found, row(40), asked(tolerance=tolerance, max_rays=1 << 20))
    error = with_next(found, boundary, sizes)
    if sizes.any():
        assert (error > 0.7 * tolerance).all()
    assert (error <= 1.1 * tolerance).all()


def test_a_point_above_the_tolerance_goes_on_and_one_below_is_done() -> None:
    found = after(np.full(3, 2.0), 64)
    error = float(np.sqrt(found.variance(row(3).behind(found)))[0])
    assert missing(found, row(3), asked(tolerance=error * 1.01)).tolist() == [0, 0, 0]
    above = missing(found, row(3), asked(tolerance=error * 0.99))
    assert (above > 0).all()
    assert (above < 64).all()  # what is missing, not twice as much


def test_points_without_rays_get_at_once_what_their_neighbours_needed() -> None:
    found, leading = Tally.blank(400), np.arange(0, 400, 4)
    found.add(leading, sums(np.full(100, 2.0), 256), 256)
    tolerance = float(np.sqrt(found.variance(row(400).behind(found))[0])) / AIM
    sizes = missing(found, row(400), asked(tolerance=tolerance * 1.001))
    assert (sizes[leading] == 0).all()
    others = np.setdiff1d(np.arange(400), leading)
    assert (sizes[others] == 256).all()


def test_the_first_set_is_a_small_one() -> None:
    assert missing(Tally.blank(3), row(3), asked(tolerance=0.01)).tolist() == [PILOT] * 3


@pytest.mark.parametrize("form", ["each", "rms"])
@pytest.mark.parametrize("most", [32, 63, 64, 1000])
def test_no_point_gets_more_than_the_most(form: str, most: int) -> None:
    found = after(np.full(5, 4.0), PILOT)
    sizes = missing(found, row(5), asked(tolerance=1e-4, tolerance_of=form, max_rays=most))
    assert (sizes == max(size for size in SIZES if size <= most - PILOT)).all()
    full = after(np.full(5, 4.0), most - 7)
    assert not missing(full, row(5), asked(tolerance=1e-4, max_rays=most)).any()


@pytest.mark.parametrize("tolerance", [0.02, 0.005])
def test_a_common_tolerance_is_nearly_reached_at_once_and_rays_go_where_they_do_most(
    tolerance: float,
) -> None:
    boundary = np.repeat(np.linspace(0.0, 5.0, 10), 50)
    found = after(boundary, 16)
    settings = asked(tolerance=tolerance, tolerance_of="rms", max_rays=1 << 20)
    sizes = missing(found, row(500), settings)
    for size in np.unique(sizes[sizes > 0]).tolist():
        chosen = np.flatnonzero(sizes == size)
        found.add(chosen, sums(boundary[chosen], size), size)
    error = float(np.sqrt(np.mean(found.variance(row(500).behind(found)))))
    assert 0.7 * tolerance < error < 1.2 * tolerance
    of_each = sizes.reshape(10, 50).mean(axis=1)
    assert (np.diff(of_each) >= 0).all()
    # Neyman: n^2.5 in proportion to the boundary, a little less since rays are dearer there, and in whole sizes; for
    # each to reach it, it would be n^1.5.
    assert 1.1 < of_each[-1] / of_each[4] < (9.0 / 4.0) ** 0.6
    assert not missing(found, row(500), asked(tolerance=1.05 * error, tolerance_of="rms")).any()


def test_where_no_ray_counts_there_will_be_as_many_again() -> None:
    """So that it does not take a thousand rounds to give up on them."""
    found, nothing = Tally.blank(2), np.zeros((2, 5))
    found.add(np.arange(2), nothing, 512)
    assert missing(found, row(2), asked(tolerance=0.01, max_rays=4096)).tolist() == [512, 512]


def test_nobody_needs_a_set_where_there_is_nobody_or_the_number_is_fixed() -> None:
    assert len(missing(Tally.blank(0), row(0), asked(tolerance=0.01))) == 0
    assert not missing(after(np.ones(3), 32), row(3), asked(rays=64)).any()

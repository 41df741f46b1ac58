"""The standard error by what rays have met, and several sets of a point put together."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.tracing.tally import APART, PAIRS, Tally
from tests.tracing.rays import sums_of


def sums(boundary: NDArray[np.float64], rays: int, noise: float = 0.0) -> NDArray[np.float64]:
    """What half-open points of a boundary so long, and of so much noise a ray, tell with so many rays."""
    rough = boundary * rays**0.5 + 2.0 * noise * rays
    apart = PAIRS / 8 * (APART * boundary * rays**0.5 + 2.0 * noise * rays)
    same = np.ones_like(boundary)
    return np.column_stack([0.5 * rays * same, rough, rays * same, apart, rays / 8 * same])


def told(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P,) the standard error of points whose rays have these values, (P, rays)."""
    found = Tally.blank(len(values))
    found.add(np.arange(len(values)), sums_of(values), values.shape[1])
    return np.sqrt(found.variance(found.behind()))


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_rays_that_err_independently_have_about_the_error_of_independent_rays(share: float) -> None:
    values = (np.random.default_rng(1).random((2000, 256)) < share).astype(float)
    error = np.sqrt(share * (1.0 - share) / 256)
    assert 0.7 * error < float(np.sqrt(np.mean(told(values) ** 2))) < 1.1 * error


def test_an_edge_along_the_curve_has_a_fifth_of_that_error() -> None:
    values = (np.arange(256) < np.arange(40, 220)[:, None]).astype(float)
    assert (told(values) < 0.2 * np.sqrt(0.25 / 256)).all()


def test_as_many_differences_tell_more_error_where_they_are_no_line() -> None:
    """Sixteen runs of eight open rays, and sixteen open rays alone: 32 differences each, of 256 rays."""
    line, noise = np.zeros((2, 1, 256))
    for first in range(4, 256, 16):
        line[0, first : first + 8] = 1.0
        noise[0, first] = 1.0
    assert sums_of(line)[0, 1] == sums_of(noise)[0, 1] == 32.0
    assert float(told(noise)[0]) > 1.5 * float(told(line)[0])


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_sets_of_a_point_err_independently_and_share_what_is_behind(noise: float) -> None:
    """Two alike halve the variance; what no ray has met falls with all rays."""
    boundary = np.full(10, 2.0)
    one, two = Tally.blank(10), Tally.blank(10)
    for found, times in ((one, 1), (two, 2)):
        for _ in range(times):
            found.add(np.arange(10), sums(boundary, 256, noise), 256)
    known = one.behind()
    assert np.allclose(two.behind().line, known.line)
    unseen = (0.5 / 256) ** 2
    expected = 0.5 * (one.variance(known) - unseen) + unseen / 4.0
    assert np.allclose(two.variance(known), expected, rtol=1e-9)
    assert np.allclose(one.scaled_variance(known), (one.variance(known) - unseen) * 256**1.5)


def test_sets_count_as_their_errors_fall() -> None:
    """One of 64 open rays and one of 256 closed ones: 64^1.5 to 256^1.5, a ninth."""
    found = Tally.blank(1)
    found.add(np.arange(1), sums_of(np.ones((1, 64))), 64)
    found.add(np.arange(1), sums_of(np.zeros((1, 256))), 256)
    assert found.mean()[0] == pytest.approx(1.0 / 9.0)
    assert found.counted[0] == found.rays[0] == 320


def test_where_all_rays_agree_there_is_an_error_and_none_is_known_without_a_ray() -> None:
    found = Tally.blank(2)
    found.add(np.arange(1), sums_of(np.ones((1, 100))), 100)
    variance = found.variance(found.behind())
    assert np.sqrt(variance[0]) == pytest.approx(0.5 / 100)
    assert np.isinf(variance[1])
    assert found.mean().tolist() == [1.0, 1.0]


def test_few_rays_have_an_error_though_no_packet_is_whole() -> None:
    assert np.isfinite(told(np.array([[0.0, 1.0, 1.0], [1.0, 1.0, 1.0]]))).all()

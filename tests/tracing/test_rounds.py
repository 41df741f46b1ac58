"""How many rays points get next, by what is known of them: at once what they surely need, then by doubling."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.settings import BakeSettings, TraceSettings
from aobake.tracing.rounds import APART, PAIRS, Tally, grown
from tests.tracing.rays import sums_of

FIRST = 32


def sums(boundary: NDArray[np.float64], rays: int, noise: float = 0.0) -> NDArray[np.float64]:
    """What half-open points of a boundary so long, and of so much noise a ray, tell with so many rays."""
    rough = boundary * rays**0.5 + 2.0 * noise * rays
    apart = PAIRS / 8 * (APART * boundary * rays**0.5 + 2.0 * noise * rays)
    same = np.ones_like(boundary)
    return np.column_stack([0.5 * rays * same, rough, rays * same, apart, rays / 8 * same])


def tally(boundary: NDArray[np.float64], rays: int = FIRST) -> Tally:
    """Half-open points of a boundary so long, after so many rays."""
    found = Tally.blank(len(boundary), grows=True)
    found.add(np.arange(len(boundary)), sums(boundary, rays), rays)
    return found


def told(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P,) the standard error of points whose rays have these values, (P, rays)."""
    found = Tally.blank(len(values), grows=False)
    found.add(np.arange(len(values)), sums_of(values), values.shape[1])
    return found.standard_error()


def expected_error(boundary: NDArray[np.float64], rays: NDArray[np.int64]) -> NDArray[np.float64]:
    """What is reported with so many rays if the boundary stays as long as it is."""
    found = [tally(boundary[k : k + 1], int(n)).standard_error()[0] for k, n in enumerate(rays)]
    return np.array(found)


def goals(boundary: NDArray[np.float64], **asked: object) -> NDArray[np.int64]:
    chosen: TraceSettings = BakeSettings(**asked)  # type: ignore[arg-type]
    return grown(tally(boundary), np.arange(len(boundary)), chosen)


@pytest.mark.parametrize("tolerance", [0.02, 0.005, 0.001])
def test_points_go_at_once_to_where_they_are_nearly_done(tolerance: float) -> None:
    boundary = np.linspace(0.5, 5.0, 40)
    reached = goals(boundary, tolerance=tolerance, max_rays=1 << 20)
    assert (reached > FIRST).all()
    error = expected_error(boundary, reached)
    alone = reached == 2 * FIRST  # one doubling is the least
    assert (error <= 1.1 * tolerance).all()
    assert (expected_error(boundary, reached // 2)[~alone] > 1.1 * tolerance).all()


def test_a_point_just_above_the_tolerance_doubles_and_one_below_is_done() -> None:
    boundary = np.array([2.0])
    error = float(expected_error(boundary, np.array([FIRST]))[0])
    assert goals(boundary, tolerance=error * 0.99).tolist() == [2 * FIRST]
    assert goals(boundary, tolerance=error * 1.01).tolist() == [FIRST]


@pytest.mark.parametrize("form", ["each", "rms"])
@pytest.mark.parametrize("most", [32, 63, 64, 1000])
def test_no_point_gets_more_than_the_most(form: str, most: int) -> None:
    reached = goals(np.full(5, 4.0), tolerance=1e-4, tolerance_of=form, max_rays=most)
    assert (reached == 2 ** int(np.log2(most))).all()


@pytest.mark.parametrize("tolerance", [0.02, 0.005])
def test_a_common_tolerance_is_nearly_reached_at_once_and_rays_go_where_they_do_most(
    tolerance: float,
) -> None:
    boundary = np.linspace(0.0, 5.0, 200)
    reached = goals(boundary, tolerance=tolerance, tolerance_of="rms", max_rays=1 << 20)
    error = float(np.sqrt(np.mean(expected_error(boundary, reached) ** 2)))
    assert 0.8 * tolerance < error < 1.3 * tolerance
    assert (np.diff(reached) >= 0).all()
    assert reached[0] < reached[-1]


def test_nothing_grows_where_there_is_nothing_or_the_number_is_fixed() -> None:
    assert len(goals(np.zeros(0), tolerance=0.01)) == 0
    assert goals(np.ones(3), rays=64).tolist() == [FIRST] * 3


# -- the standard error ---------------------------------------------------------------------------


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
def test_the_parts_of_a_set_tell_what_the_whole_tells(noise: float) -> None:
    boundary = np.linspace(0.5, 5.0, 10)
    whole, grew = Tally.blank(10, grows=True), Tally.blank(10, grows=True)
    whole.add(np.arange(10), sums(boundary, 512, noise), 512)
    for rays in (32, 32, 64, 128, 256):
        grew.add(np.arange(10), sums(boundary, rays, noise), rays)
    assert np.allclose(grew.standard_error(), whole.standard_error(), rtol=1e-12)


def test_few_rays_have_an_error_though_no_packet_is_whole() -> None:
    assert np.isfinite(told(np.array([[0.0, 1.0, 1.0], [1.0, 1.0, 1.0]]))).all()

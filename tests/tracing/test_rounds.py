"""How many rays points get next, by what is known of them: at once what they surely need, then by doubling."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.settings import BakeSettings, TraceSettings
from aobake.tracing.rounds import Tally, grown

FIRST = 32


def tally(boundary: NDArray[np.float64], rays: int = FIRST) -> Tally:
    """Half-open points of a boundary so long, after so many rays."""
    found = Tally.blank(len(boundary), grows=True)
    sums = np.column_stack(
        [0.5 * rays + 0.0 * boundary, boundary * rays**0.5, rays + 0.0 * boundary]
    )
    found.add(np.arange(len(boundary)), sums, rays)
    return found


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
    assert (error <= 1.3 * tolerance).all()
    assert (expected_error(boundary, reached // 2)[~alone] > 1.3 * tolerance).all()


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

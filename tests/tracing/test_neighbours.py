"""What points next to each other tell about each other's errors: the same where they see the same, nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.tracing.neighbours import REACH, Neighbours
from aobake.tracing.tally import Behind, Tally
from tests.tracing.test_tally import sums

FloatArray = NDArray[np.float64]
UP, ASIDE = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


def behind(boundary: FloatArray, normals: FloatArray, rays: int = 64) -> Behind:
    """What is found behind points of boundaries so long; those that are not a number have no ray."""
    found, traced = Tally.blank(len(boundary)), np.flatnonzero(np.isfinite(boundary))
    found.add(traced, sums(boundary[traced], rays), rays)
    return Neighbours.along(np.arange(len(boundary)), normals).behind(found)


def test_points_that_are_alike_tell_each_other_nothing_new() -> None:
    found = behind(np.full(50, 1.5), np.tile(UP, (50, 1)))
    assert np.allclose(found.line, 1.5)
    assert np.allclose(found.noise, 0.0, atol=1e-12)
    assert np.allclose(found.openness, 0.5)


def test_a_point_among_others_goes_half_of_the_way_to_them() -> None:
    """So a crack in a wall keeps at least half of its edges, and a wall is told of it a little."""
    boundary = np.ones(101)
    boundary[50] = 9.0
    line = behind(boundary, np.tile(UP, (101, 1))).line
    assert 0.45 * 9.0 < line[50] < 0.6 * 9.0
    near, far = np.abs(np.arange(101) - 50) <= REACH, np.abs(np.arange(101) - 50) > REACH
    assert (line[near] > 1.2).all()
    assert np.allclose(line[far], 1.0, atol=0.05)


def test_what_counts_is_the_mean_over_points_and_not_more_than_that() -> None:
    """Sharing changes single points, not how much there is."""
    boundary = np.random.default_rng(0).exponential(1.0, 4000)
    line = behind(boundary, np.tile(UP, (4000, 1))).line
    assert line.mean() == pytest.approx(boundary.mean(), rel=0.01)
    assert line.std() < 0.7 * boundary.std()


def test_points_around_a_crease_have_nothing_to_do_with_each_other() -> None:
    boundary = np.tile([1.0, 3.0], 500)
    normals = np.tile([UP, ASIDE], (500, 1))
    apart, together = behind(boundary, normals).line, behind(boundary, np.tile(UP, (1000, 1))).line
    # Every second neighbour is on the same side.
    assert np.allclose(apart[8:-8], boundary[8:-8], atol=0.15)
    assert np.abs(together - 2.0).max() < 0.6 * np.abs(boundary - 2.0).max() + 0.2


def test_points_without_rays_are_like_those_beside_them() -> None:
    boundary = np.where(np.arange(400) < 200, 1.0, 5.0)
    boundary[np.arange(400) % 4 > 0] = np.nan
    line = behind(boundary, np.tile(UP, (400, 1))).line
    assert (line[:190] < 2.2).all()
    assert (line[210:] > 3.8).all()


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_few_points_are_enough(count: int) -> None:
    found = behind(np.full(count, 2.0), np.tile(UP, (count, 1)))
    assert np.allclose(found.line, 2.0)
    assert len(found.noise) == len(found.openness) == count


def test_the_length_of_normals_does_not_matter() -> None:
    boundary = np.arange(1.0, 21.0)
    one, other = (behind(boundary, np.tile(UP, (20, 1)) * length).line for length in (1.0, 3e-30))
    assert np.array_equal(one, other)

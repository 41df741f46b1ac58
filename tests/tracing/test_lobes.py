"""Direction sets drawn together into other lobes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aobake.settings import Distribution
from aobake.tracing.lobes import lobed
from aobake.tracing.sampling import direction_sets

RAYS = 1024


def directions(distribution: Distribution, spread: float) -> np.ndarray:
    sets = lobed(direction_sets(RAYS), distribution, spread)
    return sets.transpose(0, 1, 3, 2).reshape(-1, 3).astype(np.float64)


def test_the_usual_lobe_is_the_set_itself() -> None:
    sets = direction_sets(64)
    assert lobed(sets, "cosine", 180.0) is sets


@pytest.mark.parametrize("distribution", ["cosine", "uniform"])
@pytest.mark.parametrize("spread", [180.0, 162.0, 60.0, 1.0, 1e-3])
def test_directions_are_unit_vectors_inside_the_cone(
    distribution: Distribution, spread: float
) -> None:
    found = directions(distribution, spread)
    assert np.abs(np.linalg.norm(found, axis=1) - 1.0).max() < 1e-6
    angle = np.arctan2(np.hypot(found[:, 0], found[:, 1]), found[:, 2])
    half = math.radians(spread) / 2.0
    assert angle.max() <= half * (1.0 + 1e-6)
    assert angle.max() > 0.95 * half


@pytest.mark.parametrize("spread", [180.0, 90.0])
def test_equal_shares_lie_in_equal_parts_of_the_lobe(spread: float) -> None:
    """Uniform: the height is spread evenly; cosine: the square of the sine is."""
    half = math.radians(spread) / 2.0
    height = np.sort(1.0 - directions("uniform", spread)[:, 2]) / (1.0 - math.cos(half))
    squared = 1.0 - directions("cosine", spread)[:, 2] ** 2
    even = (np.arange(len(height)) + 0.5) / len(height)
    assert np.abs(height - even).max() < 2e-3
    assert np.abs(np.sort(squared) / math.sin(half) ** 2 - even).max() < 2e-3


def test_the_ways_around_the_normal_stay_even() -> None:
    assert np.abs(directions("uniform", 120.0)[:, :2].mean(axis=0)).max() < 1e-3

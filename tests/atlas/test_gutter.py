"""Gutters: what mip levels and lookups at the rims of charts get to see."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.atlas.gutter import REACH_PX, fill_gutters, nearest_covered
from tests.atlas.patched import cube, lookup, patched

Float32Array = NDArray[np.float32]

PATCHES = patched(cube, rows=4, columns=8, size=512, padding=16)
COVERED = PATCHES.chart >= 0


def mip(image: Float32Array, level: int) -> Float32Array:
    """The image at 1 / 2^level of its size, each texel the mean of those it replaces."""
    n = 1 << level
    height, width = image.shape
    return np.asarray(image.reshape(height // n, n, width // n, n).mean(axis=(1, 3)), np.float32)


def by_brute_force(covered: NDArray[np.bool_]) -> NDArray[np.float64]:
    rows, columns = np.nonzero(covered)
    y, x = np.mgrid[0 : covered.shape[0], 0 : covered.shape[1]]
    return np.asarray(np.hypot(y[..., None] - rows, x[..., None] - columns).min(axis=2))


def test_each_texel_gets_the_nearest_one_of_a_chart() -> None:
    covered = np.random.default_rng(3).random((41, 57)) < 0.01
    nearest = nearest_covered(covered, 9)
    distance = by_brute_force(covered)
    assert ((nearest >= 0) == (distance <= 9)).all()
    y, x = np.nonzero(nearest >= 0)
    row, column = np.divmod(nearest[y, x], 57)
    assert covered[row, column].all()
    assert np.hypot(row - y, column - x) == pytest.approx(distance[y, x], abs=1e-9)
    assert (nearest[covered] == np.flatnonzero(covered)).all()


def test_charts_stay_and_the_rest_is_white() -> None:
    values = np.zeros((100, 100), np.float32)
    covered = np.zeros((100, 100), bool)
    covered[:10, :10] = True
    filled = fill_gutters(values, covered)
    near = by_brute_force(covered) <= REACH_PX
    assert (filled[near] == 0.0).all()
    assert (filled[~near] == 1.0).all()


def test_a_page_without_charts_is_white() -> None:
    assert (fill_gutters(np.full((8, 8), np.nan, np.float32), np.zeros((8, 8), bool)) == 1.0).all()


def test_what_is_not_a_number_stays_out() -> None:
    values = np.where(COVERED, np.float32(0.5), np.float32(np.nan))
    assert np.isfinite(fill_gutters(values, COVERED)).all()


def test_no_texel_inside_the_padding_is_darker_than_the_rim_of_its_chart() -> None:
    values = np.where(COVERED, np.random.default_rng(5).random(COVERED.shape), 0).astype(np.float32)
    filled = fill_gutters(values, COVERED)
    nearest = nearest_covered(COVERED, 16)
    padding = ~COVERED & (nearest >= 0)
    assert (filled[padding] >= values.reshape(-1)[nearest[padding]]).all()


@pytest.mark.parametrize(("padding", "levels"), [(16, 3), (32, 4)])
def test_mip_levels_are_free_of_other_charts(padding: int, levels: int) -> None:
    patches = patched(cube, rows=3, columns=4, size=512, padding=padding)
    covered = patches.chart >= 0
    tint = (patches.chart % 2).astype(np.float32)
    filled = fill_gutters(tint, covered)
    y, x = np.nonzero(covered)
    for level in range(levels + 1):
        assert (mip(filled, level)[y >> level, x >> level] == tint[y, x]).all(), level


@pytest.mark.parametrize(
    ("padding", "level", "most"),
    [(16, 0, 0.0), (16, 1, 0.0), (16, 2, 0.0), (16, 3, 0.125), (32, 3, 0.0), (32, 4, 0.125)],
)
def test_lookups_on_mip_levels_see_their_own_chart(padding: int, level: int, most: float) -> None:
    """Black charts among white ones and the other way round, at 200 places of every triangle.

    On the first level that is too coarse for the padding an eighth of a neighbour comes through at worst.
    """
    patches = patched(cube, rows=3, columns=4, size=512, padding=padding)
    tint = (patches.chart % 2).astype(np.float32)
    filled = mip(fill_gutters(tint, patches.chart >= 0), level)
    share = np.random.default_rng(9).dirichlet((0.4, 0.4, 0.4), 200)
    places = np.einsum("nk,fkc->fnc", share, patches.uv)
    own = np.repeat(np.arange(12) % 2, len(patches.uv) // 12)[:, np.newaxis]
    assert np.abs(lookup(filled, places) - own).max() <= most + 1e-6

"""Denoising: less noise, no chart that depends on another one, and nothing spoilt that was good."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.atlas import denoise
from aobake.atlas.denoise import available, denoised
from aobake.errors import EngineError

Float32Array = NDArray[np.float32]

needs_oidn = pytest.mark.skipif(
    not available(), reason="Open Image Denoise (pyoidn) is not installed"
)

SIZE = 128
FLAT = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (SIZE, SIZE, 1))


def two_charts() -> NDArray[np.int32]:
    """A left and a right half, side by side without a gutter."""
    chart = np.zeros((SIZE, SIZE), np.int32)
    chart[:, SIZE // 2 :] = 1
    return chart


def smooth_page() -> Float32Array:
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    return np.asarray(0.5 + 0.4 * np.sin(5.0 * x + 1.0) * np.cos(4.0 * y), np.float32)


def noisy(sigma: float) -> Float32Array:
    noise = np.random.default_rng(8).normal(0.0, sigma, (SIZE, SIZE))
    return np.clip(smooth_page() + noise, 0.0, 1.0).astype(np.float32)


def errors(sigma: float) -> Float32Array:
    return np.full((SIZE, SIZE), sigma, np.float32)


def rms(values: Float32Array) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


@needs_oidn
@pytest.mark.parametrize("normal", [FLAT, None])
def test_noise_falls_to_less_than_a_third(normal: Float32Array | None) -> None:
    before = noisy(0.03)
    after = denoised(before, errors(0.03), two_charts(), normal)
    assert rms(after - smooth_page()) < rms(before - smooth_page()) / 3.0


@needs_oidn
def test_a_chart_does_not_depend_on_the_one_beside_it() -> None:
    """Not in one bit, though they touch."""
    chart, page = two_charts(), noisy(0.03)
    other = np.where(chart == 1, 1.0 - page, page)
    turned = np.where((chart == 1)[:, :, np.newaxis], FLAT[:, :, ::-1], FLAT)
    one = denoised(page, errors(0.03), chart, FLAT)
    two = denoised(other, errors(0.03), chart, turned)
    assert (one[chart == 0] == two[chart == 0]).all()
    assert (one[chart == 1] != two[chart == 1]).any()


@needs_oidn
def test_a_chart_does_not_depend_on_its_place() -> None:
    """Wherever it lies, at the corner of the page too, and whatever its number."""
    part = noisy(0.03)[:50, :40]
    found = []
    for number, (row, column) in enumerate([(0, 0), (37, 21), (78, 88)]):
        page, chart = np.zeros((SIZE, SIZE), np.float32), np.full((SIZE, SIZE), -1, np.int32)
        here = np.s_[row : row + 50, column : column + 40]
        page[here], chart[here] = part, number
        found.append(denoised(page, errors(0.03), chart, FLAT)[here])
    assert (found[0] == found[1]).all()
    assert (found[0] == found[2]).all()
    assert (found[0] != part).any()


@needs_oidn
def test_threads_do_not_matter() -> None:
    one, two = (denoised(noisy(0.03), errors(0.03), two_charts(), FLAT, threads=n) for n in (1, 2))
    assert (one == two).all()


@needs_oidn
@pytest.mark.parametrize("sigma", [0.0, 1e-4, 0.01])
def test_no_value_moves_by_more_than_twice_its_error(sigma: float) -> None:
    """On white noise, all of which the network would take away: a converged page may look like that."""
    page = np.random.default_rng(3).random((SIZE, SIZE), np.float32)
    moved = np.abs(denoised(page, errors(sigma), two_charts(), FLAT) - page)
    assert moved.max() <= 2.0 * sigma + 1e-7
    assert sigma == 0.0 or moved.max() > 0.0


@needs_oidn
@pytest.mark.parametrize("value", [0.0, 0.4, 1.0])
def test_a_page_of_one_value_stays_though_its_error_is_not_zero(value: float) -> None:
    """Where every ray agrees there is an error all the same; open stays exactly open."""
    page = np.full((SIZE, SIZE), value, np.float32)
    assert (denoised(page, errors(0.02), two_charts(), FLAT) == page).all()


@needs_oidn
def test_detail_that_noise_does_not_explain_stays() -> None:
    """White detail of 0.1 whose error is a tenth of that: the network would take all of it away."""
    detail = noisy(0.1)
    moved = denoised(detail, errors(0.01), two_charts(), FLAT) - detail
    assert rms(moved) < 0.3 * 0.01


@needs_oidn
def test_what_is_no_chart_stays_and_so_do_tiny_charts() -> None:
    page, chart = noisy(0.03), np.full((SIZE, SIZE), -1, np.int32)
    chart[10:17, 10:17] = 0
    assert (denoised(page, errors(0.03), chart, FLAT) == page).all()
    assert (denoised(page, errors(0.03), chart[:0], FLAT[:0])[:0] == page[:0]).all()


@needs_oidn
def test_a_chart_in_blocks_is_the_chart_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    chart = np.zeros((SIZE, SIZE), np.int32)
    whole = denoised(noisy(0.03), errors(0.03), chart, FLAT)
    monkeypatch.setattr(denoise, "BLOCK", 64)
    blocks = denoised(noisy(0.03), errors(0.03), chart, FLAT)
    assert np.abs(blocks - whole).max() < 2e-3


@needs_oidn
def test_a_chart_in_blocks_does_not_depend_on_what_lies_between_its_parts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A block of it may hold one corner of the chart, and be far from it in the other."""
    monkeypatch.setattr(denoise, "BLOCK", 64)
    monkeypatch.setattr(denoise, "CONTEXT", 16)
    chart = np.ones((200, 200), np.int32)
    chart[:64, :64] = chart[-20:, -20:] = 0
    page = np.random.default_rng(5).random(chart.shape, np.float32)
    other = np.where(chart == 1, 1.0 - page, page)
    error = np.full(chart.shape, 0.1, np.float32)
    one, two = (denoised(values, error, chart, None) for values in (page, other))
    assert (one[chart == 0] == two[chart == 0]).all()


@needs_oidn
def test_the_page_that_was_given_is_not_changed() -> None:
    page = noisy(0.03)
    kept = page.copy()
    denoised(page, errors(0.03), two_charts(), FLAT)
    assert (page == kept).all()


def test_without_open_image_denoise_the_cure_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(EngineError, match=r"pip install 'aobake\[denoise\]'"):
        denoised(noisy(0.03), errors(0.03), two_charts(), FLAT)

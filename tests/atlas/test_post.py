"""A baked page on its way to an image: the order of its stages, and what never comes out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.atlas import post
from aobake.atlas.denoise import available
from aobake.atlas.post import TracedPage, finished
from aobake.atlas.seams import find_seams, joined_seams
from tests.atlas.patched import cylinder, lookup, patched, sphere

DENOISE = [
    False,
    pytest.param(True, marks=pytest.mark.skipif(not available(), reason="pyoidn is not installed")),
]
PATCHES = patched(cylinder, rows=3, columns=4, size=256, padding=8)
SEAMS = find_seams(PATCHES.vertices, PATCHES.faces, PATCHES.uv, PATCHES.normals)
COVERED = PATCHES.chart >= 0


def page(values: NDArray[np.float64], error: float = 0.02) -> TracedPage:
    return TracedPage(
        values=np.where(COVERED, values, np.nan).astype(np.float32),
        error=np.where(COVERED, error, np.nan).astype(np.float32),
        chart=PATCHES.chart,
        normal=PATCHES.position.astype(np.float32),
    )


def shaded(noise: float) -> NDArray[np.float64]:
    x, y, z = np.moveaxis(PATCHES.position, -1, 0)
    rng = np.random.default_rng(3)
    return np.asarray(0.5 + 0.2 * np.sin(2 * x) * np.cos(y + z) + rng.normal(0.0, noise, x.shape))


@pytest.mark.parametrize("denoise", DENOISE)
@pytest.mark.parametrize("value", [0.0, 0.4, 1.0])
def test_one_value_stays_through_all_stages(value: float, denoise: bool) -> None:
    result = finished(page(np.full(COVERED.shape, value)), SEAMS, denoise=denoise)
    assert (result[COVERED] == np.float32(value)).all()
    assert set(np.unique(result)) <= {np.float32(value), np.float32(1.0)}


@pytest.mark.parametrize("denoise", DENOISE)
def test_a_page_without_charts_is_white(denoise: bool) -> None:
    empty = TracedPage(
        values=np.full((16, 16), np.nan, np.float32),
        error=np.full((16, 16), np.nan, np.float32),
        chart=np.full((16, 16), -1, np.int32),
        normal=None,
    )
    assert (finished(empty, joined_seams([]), denoise=denoise) == 1.0).all()


@pytest.mark.parametrize("denoise", DENOISE)
def test_what_is_not_a_number_never_comes_out(denoise: bool) -> None:
    """A texel that could not be baked takes the value of one beside it."""
    values = shaded(0.02)
    holes = np.random.default_rng(4).random(values.shape) < 0.05
    result = finished(page(np.where(holes, np.nan, values)), SEAMS, denoise=denoise)
    assert result.shape == values.shape
    assert result.dtype == np.float32
    assert np.isfinite(result).all()
    assert result.min() >= 0.0
    assert result.max() <= 1.0
    assert np.abs(result - shaded(0.0))[holes & COVERED].max() < 0.15


@pytest.mark.parametrize("denoise", DENOISE)
def test_seams_are_equal_and_gutters_repeat_the_rims_in_the_end(denoise: bool) -> None:
    """What comes later must not undo what came before."""
    result = finished(page(shaded(0.02)), SEAMS, denoise=denoise)
    share = np.random.default_rng(4).random((1, 30, 1))
    values = lookup(result, SEAMS.uv[:, :, :1] + share * (SEAMS.uv[:, :, 1:] - SEAMS.uv[:, :, :1]))
    assert np.abs(values[:, 0] - values[:, 1]).max() <= 0.01
    again = finished(
        page(np.where(COVERED, result, 0.0), error=0.0), joined_seams([]), denoise=False
    )
    assert (again == result).all()


def test_the_stages_run_in_their_order(monkeypatch: pytest.MonkeyPatch) -> None:
    ran = []

    def noted(name: str) -> object:
        def stage(values: NDArray[np.float32], *_: object, **__: object) -> NDArray[np.float32]:
            ran.append(name)
            return values

        return stage

    monkeypatch.setattr("aobake.atlas.denoise.denoised", noted("denoise"))
    monkeypatch.setattr(post, "equalised", noted("seams"))
    monkeypatch.setattr(post, "fill_gutters", noted("gutters"))
    finished(page(shaded(0.0)), SEAMS, denoise=True)
    assert ran == ["denoise", "seams", "gutters"]


@pytest.mark.skipif(not available(), reason="pyoidn is not installed")
def test_a_denoised_sphere_is_nearer_to_the_truth() -> None:
    patches = patched(sphere, rows=2, columns=4, size=256, padding=8)
    truth = 0.6 + 0.3 * patches.position[:, :, 2]
    covered = patches.chart >= 0
    noise = np.random.default_rng(1).normal(0.0, 0.03, truth.shape)
    baked = TracedPage(
        values=np.clip(truth + noise, 0, 1).astype(np.float32),
        error=np.full(truth.shape, 0.03, np.float32),
        chart=patches.chart,
        normal=patches.position.astype(np.float32),
    )
    seams = find_seams(patches.vertices, patches.faces, patches.uv, patches.normals)
    result = finished(baked, seams, denoise=True)
    assert np.sqrt(np.mean(np.square(result - truth)[covered])) < 0.01

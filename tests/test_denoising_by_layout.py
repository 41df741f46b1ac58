"""Where a layout has small charts, denoising does not pay, and is left off unless it was asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aobake import BakeSettings
from aobake.atlas.layout import Layout, Page
from aobake.planning.denoising import denoised_where_it_pays, texels_a_chart
from aobake.planning.effect import Effect, Plan

ON = Plan({"denoise": Effect(True, "Noise would show.", 1.2), "alpha": Effect(False, "No mask.")})
AUTO = BakeSettings(size=256, denoise="auto")


def squares(side: int) -> Layout:
    """A page of side x side squares, each a chart of its own, that cover a quarter of it."""
    low = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 1, 2) / side
    wide = 0.5 / side
    corners = np.array([[[0, 0], [wide, 0], [wide, wide]], [[0, 0], [wide, wide], [0, wide]]])
    faces = (low[:, np.newaxis] + corners).reshape(-1, 3, 2)
    charts = np.repeat(np.arange(side * side, dtype=np.int32), 2)
    nowhere = np.full((1, 3, 2), np.nan)
    page = Page(
        instances=(0,),
        corners=(np.concatenate([faces, nowhere]),),
        charts=(np.append(charts, np.int32(-1)),),
        origin="squares",
    )
    return Layout(pages=(page, page), placings=(None,))


@pytest.mark.parametrize("side", [1, 3, 15])
def test_the_mean_chart_is_its_share_of_the_page(side: int) -> None:
    assert texels_a_chart(squares(side), 256) == pytest.approx(256**2 / 4 / side**2)


def test_specks_that_are_never_denoised_do_not_count() -> None:
    """A chart of a quarter of a page, and 1,024 of 16 texels."""
    large, specks = squares(1), squares(32)
    both = Layout(pages=(*large.pages, *specks.pages), placings=(None,))
    assert texels_a_chart(both, 256) == pytest.approx(256**2 / 4)
    assert denoised_where_it_pays(ON, both, AUTO).effects["denoise"].on
    assert texels_a_chart(specks, 256) == 0.0


@pytest.mark.parametrize(("side", "on"), [(4, True), (6, True), (7, False), (16, False)])
def test_small_charts_are_left_as_they_were_traced(side: int, on: bool) -> None:
    """Charts of 1,024, 455, 334 and 64 texels."""
    found = denoised_where_it_pays(ON, squares(side), AUTO).effects
    assert found["denoise"].on is on
    assert found["alpha"] == ON.effects["alpha"]
    assert on or "texels in the mean" in found["denoise"].reason


def test_what_was_asked_for_is_done_whatever_the_charts() -> None:
    assert denoised_where_it_pays(ON, squares(16), replace(AUTO, denoise="on")) == ON


def test_a_layout_without_pages_has_nothing_to_denoise() -> None:
    nothing = Layout(pages=(), placings=())
    assert texels_a_chart(nothing, 256) == 0.0
    assert not denoised_where_it_pays(ON, nothing, AUTO).effects["denoise"].on

"""The study of a texture: its bakes are those of bake_texture, and what is said of them is true and the same again."""

from __future__ import annotations

import csv
import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake import BakeSettings, InputError, Scene, SettingsError, bake_texture
from aobake.atlas.denoise import available
from aobake.study import (
    Curve,
    Level,
    Study,
    TextureExtent,
    kept_reference,
    measure_texture,
    summary,
    texture_extent,
    write_study,
)
from aobake.study.bench import REFERENCE_SEED
from aobake.study.reference import Find, digest, made_anew
from aobake.study.texture_bench import texture_bench
from aobake.study.ways import fixed
from tests.scenes import Triangles, box, flipped, floor, joined

needs_oidn = pytest.mark.skipif(
    not available(), reason="Open Image Denoise (pyoidn) is not installed"
)
needs_plots = pytest.mark.usefixtures("plots_at_hand")

SMALL = TextureExtent(
    reference=256, budgets=(4, 16, 64), tolerances=(0.05,), seeds=2, shown=(4, 16)
)
SIZE = 64


@pytest.fixture
def plots_at_hand() -> None:
    pytest.importorskip("matplotlib", reason="the extra plot is not installed")


def bumps() -> Scene:
    """The bottom of an open box, with bumps on it."""
    vertices, faces = floor(1.0, 0.0, 24)
    x, y, _ = (vertices * 7.0).T
    ground = np.column_stack([vertices[:, :2], 0.15 * np.sin(x) * np.cos(y)])
    walls = flipped(box((-1, -1, -0.2), (1, 1, 0.4), without=("-z", "+z")))
    return Scene.from_arrays(*joined(Triangles(ground, faces), walls))


@pytest.fixture
def as_traced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bakes leave out what moves texels at the borders of charts, which a study does not look at."""
    monkeypatch.setattr("aobake.atlas.post.lit_rims", lambda values, *_: values)
    monkeypatch.setattr("aobake.atlas.post.equalised", lambda values, *_: values)


def settings(**more: object) -> BakeSettings:
    return BakeSettings(size=SIZE, **more)  # type: ignore[arg-type]


def without_times(study: Study) -> list[Curve]:
    return [
        replace(
            curve,
            levels=tuple(
                replace(v, seconds=0.0, seconds_least=0.0, seconds_most=0.0) for v in curve.levels
            ),
        )
        for curve in study.curves
    ]


@pytest.fixture(scope="module")
def measured() -> Study:
    return measure_texture(bumps(), settings(), SMALL)[0]


@needs_oidn
def test_what_is_measured_is_what_a_bake_gives(as_traced: None) -> None:
    bench = texture_bench(bumps(), settings())
    traced = bench.runs(fixed(bench.bake.settings, 8, 3))
    for (values, errors, rays, _), denoise in zip(traced, ("off", "on"), strict=True):
        baked = bake_texture(bumps(), settings(rays=8, seed=3, denoise=denoise))
        assert np.array_equal(values, baked.image[baked.coverage])
        assert np.array_equal(errors, baked.standard_errors[0][baked.coverage])
        assert rays == baked.rays / baked.coverage.sum()


def test_what_moves_later_is_what_a_bake_and_its_rays_differ_by() -> None:
    bench = texture_bench(bumps(), settings(denoise="off"))
    baked = bake_texture(bumps(), settings(rays=16, seed=REFERENCE_SEED, denoise="off"))
    later = bench.reference(16) + bench.moved_later(16)
    assert np.allclose(later, baked.image[baked.coverage], rtol=0.0, atol=1e-12)
    assert 0.0 < np.abs(bench.moved_later(16)).max() < 1.0


@needs_oidn
def test_denoising_takes_error_away_where_rays_are_few(measured: Study) -> None:
    assert measured.denoised is not None
    for plain, smooth in zip(measured.fixed.levels[:2], measured.denoised.levels[:2], strict=True):
        assert smooth.rmse < 0.8 * plain.rmse
        assert smooth.rays == plain.rays


def test_the_error_falls_with_rays(measured: Study) -> None:
    errors = [level.rmse for level in measured.fixed.levels]
    assert errors == sorted(errors, reverse=True)
    assert measured.fixed.slope is not None
    assert measured.fixed.slope < -0.5
    assert all(level.within_2 > 0.9 for level in measured.fixed.levels)


def test_a_texture_study_says_the_same_again(measured: Study) -> None:
    again = measure_texture(bumps(), settings(threads=1), SMALL)[0]
    assert without_times(again) == without_times(measured)


def test_a_study_without_the_denoiser_says_why() -> None:
    few = replace(SMALL, budgets=(4,), tolerances=(), reference=16, shown=(4,))
    found, pictures = measure_texture(bumps(), settings(denoise="off"), few)
    assert found.denoised is None
    assert found.facts["denoiser"] == "denoise is off"
    assert [len(row) for row in pictures] == [2]
    assert "denois" not in summary(found)[0]


# -- the reference --------------------------------------------------------------------------------


def test_the_reference_of_a_texture_is_made_once_and_used_again(tmp_path: Path) -> None:
    few = replace(SMALL, budgets=(4,), tolerances=())
    plain = settings(denoise="off")
    asked: list[str] = []

    def kept(known: str, find: Find) -> NDArray[np.float64]:
        def counted() -> NDArray[np.float64]:
            asked.append(known)
            return find()

        return kept_reference(tmp_path)(known, counted)

    first, _ = measure_texture(bumps(), plain, few, kept=kept)
    again, _ = measure_texture(bumps(), replace(plain, rays=9, threads=1), few, kept=kept)
    assert len(asked) == 1
    assert without_times(again) == without_times(first)
    for path in tmp_path.glob("*.npy"):
        np.save(path, np.load(path) + 1.0)
    off, _ = measure_texture(bumps(), plain, few, kept=kept)
    assert off.fixed.levels[0].rmse > 0.9
    measure_texture(bumps(), replace(plain, size=48), few, kept=kept)
    measure_texture(bumps(), replace(plain, supersample=2), few, kept=kept)
    assert len(set(asked)) == len(asked) == 3


def test_another_layout_and_another_file_have_another_reference(tmp_path: Path) -> None:
    page = np.arange(6.0)
    known = digest(bumps(), settings(), (64,), layout=(page,))
    assert digest(bumps(), settings(denoise="off"), (64,), layout=(page.copy(),)) == known
    assert digest(bumps(), settings(), (64,), layout=(page + 1.0,)) != known
    assert digest(bumps(), settings(), (64,)) != known
    from aobake import load

    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="ascii")
    before = digest(load(path), settings(), (64,))
    path.write_text("o renamed\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="ascii")
    assert digest(load(path), settings(), (64,)) != before
    assert made_anew(before, lambda: page) is page


# -- refusals -------------------------------------------------------------------------------------


def test_a_texture_study_that_would_take_too_long_is_refused_before_the_asset_is_laid_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begun: list[object] = []
    monkeypatch.setattr("aobake.study.texture_measure.texture_bench", begun.append)
    with pytest.raises(SettingsError, match=r"would take about .* quick"):
        measure_texture(bumps(), settings(), texture_extent(quick=False), time_limit=1e-3)
    assert begun == []


@pytest.mark.parametrize("faces", [np.zeros((0, 3), int), np.zeros((2, 3), int)])
def test_an_asset_without_area_has_no_texture_to_study(faces: NDArray[np.int64]) -> None:
    nothing = Scene.from_arrays(np.zeros((3, 3)), faces)
    for limit in (None, 60.0):
        with pytest.raises(InputError, match="nothing to study"):
            measure_texture(nothing, settings(), SMALL, time_limit=limit)


# -- what is written ------------------------------------------------------------------------------


@needs_plots
def test_a_texture_study_can_be_read_back(measured: Study, tmp_path: Path) -> None:
    write_study(tmp_path, measured, ())
    rows = list(csv.DictReader((tmp_path / "study.csv").read_text(encoding="utf-8").splitlines()))
    names = [field.name for field in fields(Level) if field.name != "setting"]
    levels = [(curve, level) for curve in measured.curves for level in curve.levels]
    for row, (curve, level) in zip(rows, levels, strict=True):
        assert (row["curve"], row["setting"]) == (curve.name, level.setting)
        assert row["denoised"] == str(int(curve.denoised))
        assert [float(row[name]) for name in names] == [getattr(level, name) for name in names]
    told = json.loads((tmp_path / "study.json").read_text(encoding="utf-8"))
    assert told["what"] == "texels"
    assert [curve["denoised"] for curve in told["curves"]] == [c.denoised for c in measured.curves]
    assert told["curves"][0]["levels"][0]["rmse"] == measured.fixed.levels[0].rmse


@needs_plots
def test_plots_of_an_earlier_study_of_vertices_do_not_stay(measured: Study, tmp_path: Path) -> None:
    (tmp_path / "directions.svg").write_text("of an earlier study", encoding="ascii")
    (tmp_path / "mine.svg").write_text("of no study", encoding="ascii")
    written = write_study(tmp_path, measured, ())
    assert sorted(tmp_path.iterdir()) == sorted([*written, tmp_path / "mine.svg"])


def test_pictures_stand_beside_their_errors_and_charts_before_a_ground(as_traced: None) -> None:
    few = replace(SMALL, tolerances=(), budgets=(4, 64), shown=(64,), seeds=1)
    _, (row,) = measure_texture(bumps(), settings(denoise="off"), few)
    assert [picture.caption for picture in row] == ["64 rays", "its error"]
    baked = bake_texture(bumps(), settings(rays=64, seed=1, denoise="off"))
    shown, error = (picture.pixels for picture in row)
    assert shown.shape == error.shape == (SIZE, SIZE, 3)
    assert np.array_equal(shown[baked.coverage][:, 0], baked.image[baked.coverage])
    (outside,) = np.unique(shown[~baked.coverage], axis=0)
    assert 0.5 < outside.min() < outside.max() < 1.0  # neither dark nor grey
    found = error[baked.coverage]
    assert found.min() >= 0.0
    assert found.max() == 1.0
    assert np.all(found[:, 0] >= found[:, 1])

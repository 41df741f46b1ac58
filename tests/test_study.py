"""The study: what is read off its curves, its sets of directions, and that it says the same every time."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aobake import BakeSettings, InputError, Scene, SettingsError
from aobake.study import (
    Curve,
    Extent,
    Level,
    Study,
    kept_reference,
    measure,
    needed,
    pareto,
    study_extent,
    summary,
    write_study,
)
from aobake.study.curves import level_of
from aobake.study.directions import KINDS, compared_sets
from aobake.study.reference import digest
from tests.scenes import floor, icosphere, joined

SMALL = Extent(
    points=400,
    reference=2048,
    budgets=(16, 32, 64, 128),
    sets=(16, 64),
    tolerances=(0.05, 0.02),
    seeds=2,
    surface=300,
    surface_reference=64,
    methods=(16,),
)


def asset() -> Scene:
    return Scene.from_arrays(*joined(floor(3.0, 0.0, 12), icosphere(2, 0.8, (0.3, 0.2, 0.9))))


def level(rays: float, rmse: float, setting: str = "") -> Level:
    return Level(
        setting=setting or f"{rays:g}", rays=rays, seconds=rays / 100.0, seconds_least=0.0,
        seconds_most=1.0, rmse=rmse, rmse_least=rmse, rmse_most=rmse, p99=rmse, max=rmse,
        reported=rmse, within_2=1.0, within_4=1.0,
    )  # fmt: skip


def law(slope: float) -> Curve:
    rays = [4.0**k for k in range(1, 7)]
    return Curve(name="fixed rays", kind="budget", levels=tuple(level(n, n**slope) for n in rays))


def without_times(study: Study) -> list[Curve]:
    return [
        replace(
            curve,
            levels=tuple(
                replace(v, seconds=0.0, seconds_least=0.0, seconds_most=0.0) for v in curve.levels
            ),
        )
        for curve in (*study.curves, *study.surface)
    ]


@pytest.fixture(scope="module")
def measured() -> Study:
    return measure(asset(), BakeSettings(), SMALL)


# -- what is read off -----------------------------------------------------------------------------


def test_a_power_law_has_its_slope_and_is_followed_between_its_levels() -> None:
    curve = law(-0.75)
    assert curve.slope == pytest.approx(-0.75)
    found = needed(curve, 100.0**-0.75)
    assert found is not None
    assert found == pytest.approx((100.0, 1.0))
    assert needed(curve, 1.0) is None
    assert needed(curve, 1e-9) is None


def test_the_front_holds_what_nothing_beats() -> None:
    other = Curve(name="b", kind="budget", levels=(level(20.0, 0.01), level(40.0, 0.5)))
    front = pareto([law(-0.5), other])
    assert ("b", other.levels[0]) in front
    assert ("b", other.levels[1]) not in front
    errors = [v.rmse for _, v in front]
    assert errors == sorted(errors, reverse=True)


def test_a_level_is_the_error_of_all_its_runs() -> None:
    truth = np.array([0.5, 0.25])
    runs = [(truth + 0.1, np.full(2, 0.1), 8.0, 1.0), (truth - 0.3, np.full(2, 0.1), 8.0, 3.0)]
    found = level_of("8", truth, runs)
    assert found.rmse == pytest.approx(np.sqrt(0.05))
    assert (found.rmse_least, found.rmse_most) == pytest.approx((0.1, 0.3))
    assert found.max == pytest.approx(0.3)
    assert (found.within_2, found.within_4, found.seconds) == (0.5, 1.0, 2.0)


# -- directions -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_every_set_integrates_the_cosine_over_the_hemisphere(kind: str) -> None:
    """The mean of z is 2/3 for directions with pdf z / pi, that of x is 0."""
    sets = compared_sets(kind, 256)
    assert np.allclose(np.linalg.norm(sets, axis=2), 1.0, atol=1e-5)
    assert len(sets) & (len(sets) - 1) == 0
    tolerance = 0.02 if kind == "random" else 0.01
    assert abs(float(sets[:, :, 2].mean(dtype=np.float64)) - 2.0 / 3.0) < tolerance
    assert abs(float(sets[:, :, 0].mean(dtype=np.float64))) < tolerance


def test_scrambled_sobol_points_have_one_in_every_elementary_box() -> None:
    """256 points: one in each of 256 boxes, of every shape that bits make."""
    from aobake.study.directions import _owen_sobol

    points = _owen_sobol(256, np.random.default_rng(0))
    for bits in range(9):
        x, y = 1 << bits, 1 << (8 - bits)
        boxes = np.floor(points[:, 0] * x) * y + np.floor(points[:, 1] * y)
        assert len(np.unique(boxes)) == 256


# -- a whole study --------------------------------------------------------------------------------


def test_the_error_falls_and_the_spiral_beats_chance(measured: Study) -> None:
    slope = measured.fixed.slope
    assert slope is not None
    assert slope < -0.6
    at_64 = {
        curve.name: curve.levels[1].rmse for curve in measured.curves if curve.kind == "directions"
    }
    assert at_64["Vogel spiral"] < 0.6 * at_64["random"]
    for curve in measured.curves[:3]:
        for found in curve.levels:
            assert found.within_2 > 0.9


def test_a_study_says_the_same_again(measured: Study) -> None:
    assert without_times(measure(asset(), BakeSettings(threads=1), SMALL)) == without_times(
        measured
    )


def test_a_study_is_written_whole(measured: Study, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="the extra plot is not installed")
    written = write_study(tmp_path, measured, ())
    assert all(path.stat().st_size > 0 for path in written)
    told = json.loads((tmp_path / "study.json").read_text(encoding="utf-8"))
    assert told["summary"] == list(summary(measured))
    rows = list(csv.DictReader((tmp_path / "study.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == sum(len(c.levels) for c in (*measured.curves, *measured.surface))
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "<svg" in page
    assert "http-equiv" not in page
    assert 'src="http' not in page
    drawn = (tmp_path / "directions.svg").read_bytes()
    write_study(tmp_path, measured, ())
    assert (tmp_path / "directions.svg").read_bytes() == drawn


def test_the_reference_is_kept_for_the_same_asset_and_no_other(tmp_path: Path) -> None:
    asked: list[int] = []

    def find() -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        asked.append(1)
        return np.array([0.25, 0.5])

    for settings in (BakeSettings(), BakeSettings(rays=8, threads=1)):
        known = digest(asset(), settings, (400, 2048))
        assert kept_reference(tmp_path)(known, find).tolist() == [0.25, 0.5]
    assert len(asked) == 1
    other = BakeSettings(max_distance=1.0)
    ball = Scene.from_arrays(*icosphere(1))
    for unknown in (
        digest(asset(), other, (400, 2048)),
        digest(ball, BakeSettings(), (400, 2048)),
        digest(asset(), BakeSettings(), (400, 4096)),
    ):
        kept_reference(tmp_path)(unknown, find)
    assert len(asked) == 4
    for path in tmp_path.glob("*.npy"):
        path.write_bytes(b"damaged")
    kept_reference(tmp_path)(digest(asset(), BakeSettings(), (400, 2048)), find)
    assert len(asked) == 5


def test_what_would_take_too_long_is_refused_before_it_starts() -> None:
    with pytest.raises(SettingsError, match="would take about"):
        measure(asset(), BakeSettings(), study_extent(quick=False), time_limit=1e-3)


def test_an_asset_without_triangles_cannot_be_studied() -> None:
    with pytest.raises(InputError, match="nothing to study"):
        measure(Scene.from_arrays(np.zeros((3, 3)), np.zeros((0, 3), int)), BakeSettings(), SMALL)

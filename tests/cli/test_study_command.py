"""`aobake study`: a folder that appears whole, and refusals before any work."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from aobake.cli.app import COMMANDS
from aobake.study import study_extent
from tests.conftest import Run
from tests.support import one_line

pytest.importorskip("matplotlib", reason="the extra plot is not installed")


def test_a_study_fills_a_folder_and_says_two_lines(run: Run, corner: Path, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    done = run("study", corner, "-o", folder, "--quick")
    assert done.status == 0, done.err
    lines = done.out.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("for RMSE 0.01: ")
    assert "halving" in lines[0]
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert "data:image/png" in page
    assert {"study.json", "study.csv", "error-rays.svg", "error-rays.png"} <= {
        path.name for path in folder.iterdir()
    }
    again = run("study", corner, "-o", folder, "--quick")
    assert again.status == 2
    assert one_line(again.err, "study.json", "--force")


def test_a_limit_that_is_too_short_is_said_before_the_study_starts(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    done = run("study", corner, "-o", tmp_path / "new", "--time-limit", "0.001")
    assert done.status == 2
    assert one_line(done.err, "would take about", "quick")
    assert not (tmp_path / "new").exists()
    assert run("study", corner, "-o", tmp_path / "new", "--time-limit", "-1").status == 2
    done = run("study", corner, "-o", tmp_path / "new", "--texture", "--time-limit", "0.001")
    assert done.status == 2
    assert one_line(done.err, "would take about", "quick")
    assert not (tmp_path / "new").exists()


def test_a_texture_is_studied_at_a_size_of_its_own(run: Run, corner: Path, tmp_path: Path) -> None:
    (tmp_path / "aobake.toml").write_text("size = 8192\ndenoise = 'off'\n", encoding="ascii")
    asked = ("study", corner, "-o", tmp_path / "study", "--quick", "--texture")
    done = run(*asked, "--size", 32)
    assert done.status == 0, done.err
    lines = done.out.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("for RMSE 0.01: ")
    assert lines[1].startswith("quality: draft ")
    told = json.loads((tmp_path / "study" / "study.json").read_text(encoding="utf-8"))
    assert told["facts"]["texture"] == "32 x 32"
    page = (tmp_path / "study" / "index.html").read_text(encoding="utf-8")
    assert "It was not measured: denoise is off." in page
    assert run(*asked, "--force", "--size", 0).status == 2


def test_a_size_without_a_texture_is_refused(run: Run, corner: Path, tmp_path: Path) -> None:
    done = run("study", corner, "-o", tmp_path / "new", "--size", 64)
    assert done.status == 2
    assert one_line(done.err, "--size", "--texture")
    assert not (tmp_path / "new").exists()


def test_points_without_faces_are_refused(run: Run, tmp_path: Path) -> None:
    asset = tmp_path / "points.obj"
    asset.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n", encoding="ascii")
    for more in ((), ("--texture",)):
        done = run("study", asset, "-o", tmp_path / "new", "--quick", *more)
        assert done.status == 1
        assert one_line(done.err, "triangle")
        assert not (tmp_path / "new").exists()


def test_the_command_is_listed_and_quick_is_smaller() -> None:
    assert "study" in COMMANDS
    assert study_extent(quick=True).rays(10_000) < study_extent(quick=False).rays(10_000)

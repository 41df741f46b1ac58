"""`aobake render`, from a file to a picture."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from aobake.images import decode
from tests.conftest import Run
from tests.support import one_line

QUICK = ("--size", "64x48", "--samples", 1, "--rays", 8)


def pixels(path: Path) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    return decode(path.read_bytes(), path.name)


def test_a_picture_has_the_size_asked_for_and_shows_the_asset(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    before = corner.read_bytes()
    ran = run("render", corner, "-o", tmp_path / "out.png", *QUICK)
    assert (ran.status, ran.err) == (0, "")
    assert "64 x 48 pixels" in ran.out
    shown = pixels(tmp_path / "out.png")
    assert shown.shape == (48, 64, 3)
    assert shown.std() > 0.05
    assert corner.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["corner.obj", "out.png"]


def test_the_same_picture_comes_out_for_any_number_of_threads(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    for threads in (1, 3):
        out = tmp_path / f"{threads}.png"
        run("render", corner, "-o", out, *QUICK, "--threads", threads, "--ground", "+y")
    assert (tmp_path / "1.png").read_bytes() == (tmp_path / "3.png").read_bytes()


@pytest.mark.parametrize(
    ("name", "encoding", "channels"),
    [("a.png", "16", 4), ("a.exr", "half", 4), ("a.exr", "float", 4), ("a.tif", "8", 4)],
)
def test_each_format_holds_a_transparent_picture(
    run: Run, corner: Path, tmp_path: Path, name: str, encoding: str, channels: int
) -> None:
    options = (*QUICK, "--background", "transparent", "--encoding", encoding)
    assert run("render", corner, "-o", tmp_path / name, *options).status == 0
    shown = pixels(tmp_path / name)
    assert shown.shape == (48, 64, channels)
    assert shown[0, 0, 3] == 0.0
    assert shown[..., 3].max() == 1.0


def test_the_report_says_what_was_simulated_and_what_was_skipped(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    out, report = tmp_path / "out.png", tmp_path / "report.json"
    options = (*QUICK, "--no-shadows", "--report", report, "--quiet")
    ran = run("render", corner, "-o", out, *options)
    assert (ran.status, ran.out, ran.err) == (0, "", "")
    data = json.loads(report.read_text(encoding="utf-8"))
    assert data["outputs"][0]["sha256"] == hashlib.sha256(out.read_bytes()).hexdigest()
    assert data["inputs"][0]["path"] == str(corner)
    effects = data["plan"]["effects"]
    assert effects["ambient_occlusion"]["on"] is True
    assert effects["shadows"] == {"on": False, "reason": "no_shadows was asked for."}
    assert {"read", "bake", "render", "write"} <= set(data["seconds"])
    assert data["settings"]["rays"] == 8
    assert data["settings"]["size"] == "64x48"


def test_a_comparison_is_one_picture(run: Run, corner: Path, tmp_path: Path) -> None:
    out, report = tmp_path / "out.png", tmp_path / "report.json"
    options = ("--compare", "ao", "--size", "300x120", "--samples", 1, "--rays", 8)
    assert run("render", corner, "-o", out, *options, "--report", report).status == 0
    assert pixels(out).shape == (120, 300, 3)
    effects = json.loads(report.read_text(encoding="utf-8"))["plan"]["effects"]
    assert effects["ambient occlusion"]["ambient_occlusion"]["on"] is True


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (("--model", "cook-torance"), ("--model", "cook-torrance", "minnaert")),
        (("--model", "phong", "--exponent", -1), ("--exponent", "-1")),
        (("--ks", 0.5), ("--ks", "lambert")),
        (("--size", "64"), ("--size", "1280x720")),
        (("--size", "32000x32000"), ("--size", "memory")),
        (("--compare", "everything"), ("--compare", "models")),
        (("--channel", "depth"), ("--channel", "beauty")),
        (("--encoding", "half"), ("out.png", "PNG cannot hold half", "8 or 16")),
        (("--modle", "phong"), ("--modle", "--model")),
    ],
)
def test_wrong_options_are_one_line_and_status_2_before_anything_is_read(
    run: Run, tmp_path: Path, options: tuple[object, ...], parts: tuple[str, ...]
) -> None:
    ran = run("render", tmp_path / "missing.glb", "-o", tmp_path / "out.png", *options)
    assert ran.status == 2, ran.err
    assert one_line(ran.err, *parts), ran.err


def test_a_name_that_is_no_picture_is_refused(run: Run, corner: Path, tmp_path: Path) -> None:
    ran = run("render", corner, "-o", tmp_path / "out.jpg", *QUICK)
    assert ran.status == 2
    assert one_line(ran.err, "out.jpg", ".png"), ran.err


def test_an_existing_picture_is_kept_unless_forced(run: Run, corner: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.png"
    out.write_text("mine", encoding="ascii")
    ran = run("render", corner, "-o", out, *QUICK)
    assert ran.status == 2
    assert one_line(ran.err, "out.png", "--force")
    assert out.read_text(encoding="ascii") == "mine"
    assert run("render", corner, "-o", out, *QUICK, "--force").status == 0


def test_a_missing_camera_is_one_line_that_lists_what_there_is(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    ran = run("render", corner, "-o", tmp_path / "out.png", *QUICK, "--camera", "left")
    assert ran.status == 1
    assert one_line(ran.err, "left", "has none"), ran.err
    assert not (tmp_path / "out.png").exists()

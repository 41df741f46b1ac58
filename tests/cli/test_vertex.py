"""`aobake vertex`, from a file to a file."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import aobake
from tests.conftest import Run
from tests.scenes import obj_text, right_angle
from tests.support import heeds_interrupts, modules_after, one_line


def colours(path: Path) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    rows = [
        line.split()[4:]
        for line in path.read_text(encoding="ascii").split("\n")
        if line[:2] == "v "
    ]
    return np.array(rows, np.float64)


def test_a_corner_comes_out_dark_where_its_walls_meet(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    before = corner.read_bytes()
    ran = run("vertex", corner, "-o", tmp_path / "out.obj", "--rays", 64)
    assert ran.status == 0
    values = colours(tmp_path / "out.obj")[:, 0].reshape(2, 7, 7)
    assert np.all(values[:, 0] < values[:, -1] - 0.1)
    assert corner.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["corner.obj", "out.obj"]


def test_success_is_two_lines_on_stdout_and_none_on_stderr(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    ran = run("vertex", corner, "-o", tmp_path / "out.glb", "--rays", 8)
    assert ran.out.count("\n") == 2
    assert "98 vertices" in ran.out
    assert "out.glb" in ran.out
    assert ran.err == ""


def test_quiet_is_quiet(run: Run, corner: Path, tmp_path: Path) -> None:
    ran = run("vertex", corner, "-o", tmp_path / "out.glb", "--rays", 8, "--quiet")
    assert (ran.status, ran.out, ran.err) == (0, "", "")


def test_the_report_says_what_was_read_written_and_traced(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    out, report = tmp_path / "out.ply", tmp_path / "report.json"
    assert (
        run("vertex", corner, "-o", out, "--rays", 16, "--seed", 3, "--report", report).status == 0
    )
    data = json.loads(report.read_text(encoding="utf-8"))
    assert data["version"] == aobake.__version__
    digest = hashlib.sha256(corner.read_bytes()).hexdigest()
    assert data["inputs"] == [{"path": str(corner), "sha256": digest}]
    assert data["outputs"][0]["sha256"] == hashlib.sha256(out.read_bytes()).hexdigest()
    assert data["settings"]["seed"] == 3
    assert set(data["seconds"]) == {"read", "prepare", "build", "compile", "trace", "write"}
    assert data["points"] == 98
    assert 0 < data["rays"] <= 98 * 16
    assert 0.0 < data["error"]["rms"] <= data["error"]["max"]


def test_an_existing_file_is_kept_unless_forced(run: Run, corner: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.obj"
    out.write_text("mine", encoding="ascii")
    ran = run("vertex", corner, "-o", out, "--rays", 4)
    assert ran.status == 2
    assert one_line(ran.err, "out.obj", "--force")
    assert out.read_text(encoding="ascii") == "mine"
    assert run("vertex", corner, "-o", out, "--rays", 4, "--force").status == 0
    assert out.read_text(encoding="ascii") != "mine"


def test_the_report_is_kept_unless_forced(run: Run, corner: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    report.write_text("mine", encoding="ascii")
    ran = run("vertex", corner, "-o", tmp_path / "out.obj", "--rays", 4, "--report", report)
    assert ran.status == 2
    assert report.read_text(encoding="ascii") == "mine"
    assert not (tmp_path / "out.obj").exists()


def test_the_input_is_replaced_only_when_forced(run: Run, corner: Path, tmp_path: Path) -> None:
    before = corner.read_bytes()
    link = tmp_path / "link.obj"
    link.symlink_to(corner)
    for name in (corner, link):
        ran = run("vertex", corner, "-o", name, "--rays", 4)
        assert ran.status == 2
        assert one_line(ran.err, "the input itself", "--force")
    assert corner.read_bytes() == before
    assert run("vertex", corner, "-o", corner, "--rays", 4, "--force").status == 0
    assert corner.read_bytes() != before


@pytest.mark.parametrize(
    ("name", "content", "finding"),
    [
        ("missing.glb", None, "there is no such file"),
        ("empty.glb", b"", ""),
        ("cut.glb", b"glTF\x02\x00\x00\x00\xff\x00\x00\x00", ""),
        ("noise.obj", bytes(range(256)), ""),
        ("points.obj", b"v 0 0 0\nv 1 0 0\n", "no triangle"),
        ("text.txt", b"hello", "no known format"),
        ("a.fbx", b"Kaydara", "Blender"),
        ("line\nbreak.glb", None, "there is no such file"),
    ],
)
def test_a_file_that_cannot_be_read_is_one_line_and_status_1(
    run: Run, tmp_path: Path, name: str, content: bytes | None, finding: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    ran = run("vertex", path, "-o", tmp_path / "out.glb")
    assert ran.status == 1
    assert one_line(ran.err, name.replace("\n", " "), finding), ran.err
    assert not (tmp_path / "out.glb").exists()


def test_a_missing_folder_is_found_before_the_bake(run: Run, corner: Path, tmp_path: Path) -> None:
    ran = run("vertex", corner, "-o", tmp_path / "no" / "out.glb", "--rays", 1 << 20)
    assert ran.status == 1
    assert one_line(ran.err, "out.glb", "there is no folder")


def test_a_failure_shows_where_only_with_debug(run: Run, tmp_path: Path) -> None:
    arguments = ["vertex", tmp_path / "missing.glb", "-o", tmp_path / "out.glb"]
    assert "Traceback" not in run(*arguments).err
    assert "Traceback" in run(*arguments, "--debug").err


def test_an_error_nobody_thought_of_is_one_line_too(
    run: Run, corner: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("division\nby zero")

    monkeypatch.setattr("aobake.bake.bake_vertices", broken)
    ran = run("vertex", corner, "-o", tmp_path / "out.glb")
    assert ran.status == 1
    assert one_line(ran.err, "ZeroDivisionError", "--debug", "corner.obj"), ran.err


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no POSIX signals")
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_long_bake_within_a_second_and_leaves_nothing(
    tmp_path: Path, number: signal.Signals, status: int
) -> None:
    source = tmp_path / "endless.obj"  # 2**20 rays at 33,000 vertices take any machine minutes
    source.write_text(obj_text(right_angle(2.0, 128)), encoding="ascii")
    command = [
        sys.executable,
        "-m",
        "aobake",
        "vertex",
        str(source),
        "-o",
        str(tmp_path / "out.glb"),
    ]
    process = subprocess.Popen(
        [*command, "--rays", str(1 << 20), "--report", str(tmp_path / "report.json")],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": ""},
        preexec_fn=heeds_interrupts,  # noqa: PLW1509 - no threads yet
    )
    time.sleep(2.5)  # into compiling or tracing
    assert process.poll() is None
    process.send_signal(number)
    started = time.monotonic()
    _, err = process.communicate(timeout=20)
    waited = time.monotonic() - started
    assert process.returncode == status, err
    assert "Traceback" not in err
    assert [p.name for p in tmp_path.iterdir()] == ["endless.obj"]
    assert waited < 10.0  # a second by design, minutes without it; the rest is for busy machines


def test_a_vertex_bake_loads_nothing_that_it_does_not_need(corner: Path, tmp_path: Path) -> None:
    """What textures, fits and pictures need takes a second to import."""
    arguments = ["vertex", str(corner), "-o", str(tmp_path / "out.obj"), "--rays", "4", "--quiet"]
    loaded = modules_after(["from aobake.cli.app import run", f"run({arguments!r})"])
    assert (tmp_path / "out.obj").exists()
    assert not loaded & {"OpenImageIO", "xatlas", "pymetis", "pyoidn", "matplotlib"}

"""`aobake batch` and `aobake watch` as they are used."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from aobake.cli.batching import FolderOptions, batch_of
from aobake.cli.watch import counts, written_by
from tests.conftest import Run
from tests.scenes import CUBE_OBJ
from tests.support import one_line

LIMIT_S = 100.0  # for what takes a few seconds where nothing else runs


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two assets, the one in a folder of its own with settings of its own."""
    source = tmp_path / "in"
    (source / "heroes").mkdir(parents=True)
    (source / "crate.obj").write_text(CUBE_OBJ, encoding="ascii")
    (source / "heroes" / "it's <b>.obj").write_text(CUBE_OBJ, encoding="ascii")
    (source / "aobake.toml").write_text("rays = 4\n", encoding="ascii")
    (source / "heroes" / "aobake.toml").write_text("rays = 8\n", encoding="ascii")
    return source


def baked(out: Path) -> dict[str, dict[str, object]]:
    jobs = json.loads((out / "report.json").read_text(encoding="utf-8"))["jobs"]
    return {job["source"]: job for job in jobs}


def test_a_folder_is_baked_in_processes_of_its_own_and_then_stands(
    run: Run, folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    first = run("batch", folder, "-o", out)
    assert first.status == 0, first.err
    assert "2 baked" in first.out
    jobs = baked(out)
    assert jobs["crate.obj"]["settings"]["rays"] == 4  # type: ignore[index]
    assert jobs["heroes/it's <b>.obj"]["settings"]["rays"] == 8  # type: ignore[index]
    again = run("batch", folder, "-o", out)
    assert (again.status, "2 unchanged" in again.out) == (0, True)


def test_an_asset_that_cannot_be_baked_makes_the_status_1(
    run: Run, folder: Path, tmp_path: Path
) -> None:
    (folder / "broken.glb").write_bytes(b"not a GLB")
    ran = run(
        "batch", folder, "-o", tmp_path / "out", "--pictures", "none", "--junit", tmp_path / "j.xml"
    )
    assert ran.status == 1
    assert "broken.glb: by its content this is text" in ran.err
    assert "2 baked, 1 failed" in ran.out
    assert b"broken" in (tmp_path / "j.xml").read_bytes()


def test_a_dry_run_says_what_it_would_do_and_writes_nothing(
    run: Run, folder: Path, tmp_path: Path
) -> None:
    ran = run("batch", folder, "-o", tmp_path / "out", "--dry-run", "--seed", 7)
    assert ran.status == 0
    assert "crate.obj" in ran.out
    assert "--rays=8" in ran.out
    assert "--seed=7" in ran.out
    assert str(folder / "heroes" / "aobake.toml") in ran.out
    assert "2 to bake" in ran.out
    assert not (tmp_path / "out").exists()


def test_listed_commands_do_what_the_batch_does(run: Run, folder: Path, tmp_path: Path) -> None:
    lines = run("batch", folder, "-o", tmp_path / "listed", "--list-commands").out.splitlines()
    assert len(lines) == 2
    run("batch", folder, "-o", tmp_path / "out", "--pictures", "none")
    for line in lines:
        words = shlex.split(line)
        assert words[0] == "aobake"
        assert run(*words[1:]).status == 0
    for name in ("crate.obj", "heroes/it's <b>.obj"):
        assert (tmp_path / "listed" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such names")
def test_what_no_command_line_can_bake_is_said_and_the_others_are_listed(
    run: Run, folder: Path, tmp_path: Path
) -> None:
    (folder / "two\nlines.obj").write_text(CUBE_OBJ, encoding="ascii")
    (folder / "crate.stl").write_text("solid\nendsolid\n", encoding="ascii")
    ran = run("batch", folder, "-o", tmp_path / "out", "--format", "glb", "--list-commands")
    assert ran.status == 1
    assert len(ran.out.splitlines()) == 1
    assert "it's <b>.obj" in shlex.split(ran.out)[2]
    assert "two lines.obj: its name cannot stand in a line" in ran.err
    assert "crate.glb would also be written for crate.stl" in ran.err
    dry = run("batch", folder, "-o", tmp_path / "out", "--format", "obj", "--dry-run")
    assert "two lines.obj -> two lines.obj" in dry.out


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["in", "-o", "in/out"], ["in/out"]),
        (["in", "-o", "out", "--memory-per-job", "4"], ["--memory-per-job"]),
        (["in", "-o", "out", "--retries", "-1"], ["--retries"]),
        (["in", "-o", "out", "--preset", "hero"], ["hero"]),
        (["in", "-o", "s3://bucket/out"], ["--state"]),
        (["in", "-o", "out", "--dry-run", "--list-commands"], ["--dry-run"]),
        (["in", "-o", "out", "--timeout", "soon"], ["--timeout", "soon"]),
        (["in", "-o", "out", "--proceses", "2"], ["--processes"]),
        (["in", "-o", "out", "--format", "jpg"], ["--format is 'jpg'"]),
        (["in", "-o", "out", "--report", "r.html"], ["--report r.html"]),
        (["in", "-o", "out", "--report", "r.json", "--junit", "r.json"], ["--report r.json"]),
        (["in", "-o", "s3://b/out", "--state", "s", "--list-commands"], ["--list-commands", "s3:"]),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(
    run: Run,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    parts: list[str],
) -> None:
    monkeypatch.chdir(folder.parent)
    ran = run("batch", *arguments)
    assert ran.status == 2, ran.err
    assert one_line(ran.err, *parts), ran.err
    assert not (folder.parent / "out").exists()


def waiting_for(path: Path, process: subprocess.Popen[str]) -> None:
    """Wait until a file is there."""
    end = time.monotonic() + LIMIT_S
    while not path.exists():
        assert process.poll() is None, process.communicate()
        if time.monotonic() > end:
            process.kill()
            pytest.fail(f"{path} never came: {process.communicate()}")
        time.sleep(0.05)


def start(*arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "aobake", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": ""},
    )


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGINT for another process")
def test_an_interrupted_batch_leaves_a_state_that_the_next_one_goes_on_from(
    run: Run, folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    (folder / "endless.obj").write_text(CUBE_OBJ, encoding="ascii")
    (folder / "heroes" / "aobake.toml").write_text("rays = 8\n", encoding="ascii")
    slow = 'rays = 4\n[files."endless.obj"]\nrays = 65536\n'
    (folder / "aobake.toml").write_text(slow, encoding="ascii")
    process = start("batch", folder, "-o", out, "--pictures", "none", "--grace", 60)
    waiting_for(out / ".aobake" / "batch.sqlite", process)
    process.send_signal(signal.SIGINT)
    said, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130, (said, err)
    assert "goes on from here" in err
    assert not list(out.rglob("*.part"))
    after = run("batch", folder, "-o", out, "--pictures", "none")
    assert after.status == 0, after.err
    assert {job["state"] for job in baked(out).values()} <= {"baked", "unchanged"}


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGINT for another process")
def test_a_watched_folder_is_baked_when_it_changes(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("watchfiles", reason="aobake[watch] is not installed")
    out, settings = folder / "baked", folder / "aobake.toml"
    settings.write_text("[preset.hero]\nrays = 4\n", encoding="ascii")
    flags = ("--skip", "baked/", "--preset", "hero", "--pictures", "none")
    process = start("watch", folder, "-o", out, *flags)
    assert process.stderr is not None
    waiting_for(out / "report.json", process)
    settings.write_text("rays = 4\n", encoding="ascii")
    while "--preset is 'hero'" not in (line := process.stderr.readline()):  # and it goes on
        assert line, "it ended"
    settings.write_text("[preset.hero]\nrays = 4\n", encoding="ascii")
    (folder / "late.obj").write_text(CUBE_OBJ, encoding="ascii")
    waiting_for(out / "late.obj", process)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130, err
    assert "Traceback" not in err


def test_what_a_batch_writes_is_no_change_to_bake_for(tmp_path: Path) -> None:
    """Where outputs lie among the assets, a watched folder would be baked without an end."""
    out, junit = tmp_path / "out", tmp_path / "junit.xml"
    flags = FolderOptions(report=tmp_path / "r.json", junit=junit, state=tmp_path / "state")
    ours = written_by(batch_of(str(tmp_path), str(out), None, None, flags, command="watch"))
    own = (
        out / "a.glb", out / ".aobake" / "lock", junit, tmp_path / "r.json", tmp_path / "r.html",
        tmp_path / "r_files" / "0.html", tmp_path / "state" / "batch.sqlite", tmp_path / ".aobake-abc_1234.part",
    )  # fmt: skip
    assert [path.name for path in own if counts(str(path), ours)] == []
    assert counts(str(tmp_path / "outer.glb"), ours)
    assert counts(str(tmp_path / "aobake.toml"), ours)

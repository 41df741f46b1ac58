"""`aobake demo`: a scene of its own, baked into a folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import aobake
from aobake import images
from tests.conftest import Run
from tests.support import one_line


def test_the_demo_writes_an_asset_and_its_report(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "demo"
    ran = run("demo", "-o", folder, "--rays", 4, "--size", 256, "--denoise", "off")
    assert ran.status == 0, ran.err
    assert ran.err == ""
    written = ["hall.glb", "hall.html", "hall.png", "hall_lightmap.glb", "report.json"]
    assert sorted(p.name for p in folder.iterdir()) == written
    assert str(folder / "hall.html") in ran.out
    assert images.decode((folder / "hall.png").read_bytes(), "hall.png").std() > 0.05
    assert b"<title>The hall" in (folder / "hall.html").read_bytes()
    lightmap = aobake.load(folder / "hall_lightmap.glb")
    assert all(material.occlusion_texture for material in lightmap.materials)
    scene = aobake.load(folder / "hall.glb")
    data = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert data["triangles"] == scene.triangles
    assert data["warnings"] == []


def test_a_second_demo_does_not_replace_the_first(run: Run, tmp_path: Path) -> None:
    (tmp_path / "hall.glb").write_bytes(b"mine")
    ran = run("demo", "-o", tmp_path)
    assert ran.status == 2
    assert one_line(ran.err, "hall.glb", "--force")
    assert [p.name for p in tmp_path.iterdir()] == ["hall.glb"]


def test_an_interrupted_demo_leaves_no_folder(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("aobake.demo.hall", interrupted)
    assert run("demo", "-o", tmp_path / "demo").status == 130
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_no_folder(run: Run, tmp_path: Path) -> None:
    (tmp_path / "demo").write_bytes(b"")
    ran = run("demo", "-o", tmp_path / "demo")
    assert ran.status == 1
    assert one_line(ran.err, "demo", "cannot be made")

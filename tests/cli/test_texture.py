"""`aobake texture`, from a file to a file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import aobake
from aobake import images
from aobake.meshes.scene import Mesh
from tests.conftest import Run
from tests.support import one_line

FEW = ("--size", 64, "--rays", 16, "--denoise", "off")


@pytest.fixture
def room(run: Run, corner: Path, tmp_path: Path) -> Path:
    """The corner as a GLB, unwrapped into its first set of texture coordinates."""
    path = tmp_path / "room.glb"
    assert run("texture", corner, "-o", path, *FEW).status == 0
    return path


def occlusion_of(path: Path) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """The red of the image that the first material of a glTF file has as its occlusion."""
    scene = aobake.load(path)
    texture = scene.materials[0].occlusion_texture
    assert texture is not None
    image = scene.images[texture.image]
    return images.decode(image.data(), image.name)[..., 0]


def test_a_corner_becomes_a_glb_with_an_occlusion_texture(room: Path, corner: Path) -> None:
    shown = occlusion_of(room)
    assert shown.shape == (64, 64)
    assert shown.max() > 0.9
    assert shown.min() < 0.6
    mesh: Mesh = aobake.load(room).meshes[0]
    uv = mesh.at_corners("TEXCOORD_0")
    assert uv is not None
    assert uv.min() >= 0.0
    assert uv.max() <= 1.0


def test_what_was_unwrapped_is_kept_when_it_is_baked_again(
    run: Run, room: Path, tmp_path: Path
) -> None:
    again = tmp_path / "again.glb"
    ran = run("texture", room, "-o", again, *FEW)
    assert ran.status == 0
    assert "TEXCOORD_0 is in range" in ran.out
    assert occlusion_of(again) == pytest.approx(occlusion_of(room), abs=1 / 255)


def test_success_says_what_was_baked_and_onto_what(run: Run, corner: Path, tmp_path: Path) -> None:
    ran = run("texture", corner, "-o", tmp_path / "out.glb", *FEW)
    assert ran.out.count("\n") == 3
    assert "texels of 1 mesh" in ran.out
    assert "1 chart, padding 2," in ran.out
    assert ran.err == ""


def test_the_report_tells_the_stages_and_the_layout(run: Run, corner: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    assert run("texture", corner, "-o", tmp_path / "out.glb", *FEW, "--report", report).status == 0
    data = json.loads(report.read_text(encoding="utf-8"))
    assert data["command"] == "texture"
    assert {"prepare", "unwrap", "build", "compile", "texels", "trace", "finish"} <= set(
        data["seconds"]
    )
    assert len(data["layout"]) == 1
    assert data["settings"]["size"] == 64
    assert data["settings"]["encoding"] is None
    assert not data["plan"]["effects"]["denoise"]["on"]
    assert 0 < data["points"] < 64 * 64


def test_the_image_alone_says_that_its_coordinates_are_kept_nowhere(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    ran = run("texture", corner, "-o", tmp_path / "ao.exr", *FEW)
    assert ran.status == 0
    assert one_line(ran.err, "ao.exr", "new texture coordinates")
    assert images.decode((tmp_path / "ao.exr").read_bytes(), "ao.exr").shape == (64, 64, 1)


def test_the_same_input_gives_the_same_bytes(
    run: Run, room: Path, corner: Path, tmp_path: Path
) -> None:
    assert run("texture", corner, "-o", tmp_path / "b.glb", *FEW, "--threads", 3).status == 0
    assert (tmp_path / "b.glb").read_bytes() == room.read_bytes()


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (("--uv", "keep"), ("has no TEXCOORD_0", "--uv keep")),
        (("--uv", "3"), ("has no TEXCOORD_3",)),
        (("--uv", "kep"), ('Did you mean "keep"?',)),
        (("--size", "4", "--padding", "3"), ("too small",)),
        (("--size", "1000000"), ("--size",)),
        (("--supersample", "3"), ("1, 2 or 4",)),
        (("--encoding", "half"), ("glTF holds PNG",)),
        (("--texels-per-unit", "1e9"), ("too small", "fewer texels per unit")),
        (("--denoize", "on"), ("--denoise",)),
    ],
)
def test_what_cannot_be_is_one_line_and_writes_nothing(
    run: Run, corner: Path, tmp_path: Path, flags: tuple[str, ...], says: tuple[str, ...]
) -> None:
    out = tmp_path / "out.glb"
    ran = run("texture", corner, "-o", out, "--rays", 4, *flags)
    assert ran.status in {1, 2}
    assert one_line(ran.err, *says)
    assert sorted(p.name for p in tmp_path.iterdir()) == [corner.name]


@pytest.mark.parametrize("name", ["out.glb", "out.png"])
def test_an_asset_without_area_is_one_line_and_writes_nothing(
    run: Run, tmp_path: Path, name: str
) -> None:
    flat = tmp_path / "flat.obj"
    flat.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    ran = run("texture", flat, "-o", tmp_path / name)
    assert ran.status == 1
    assert one_line(ran.err, "flat.obj", "no triangle has an area")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["flat.obj"]


def test_a_format_without_textures_is_refused_before_the_bake(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    ran = run("texture", corner, "-o", tmp_path / "out.ply")
    assert ran.status == 2
    assert one_line(ran.err, "out.ply", ".glb")


def test_a_format_of_its_own_that_holds_no_texture_ends_with_status_1(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    own = tmp_path / "room.ply"
    assert run("vertex", corner, "-o", own, "--rays", 4).status == 0
    ran = run("texture", own, "-o", tmp_path / "out.ply")
    assert ran.status == 1
    assert one_line(ran.err, "out.ply", "room.ply", ".glb")

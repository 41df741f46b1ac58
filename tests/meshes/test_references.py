"""Which files an asset refers to, told from its text."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from aobake.meshes.formats.references import references


def test_a_gltf_names_its_buffers_and_images_in_each_way_they_can_be_read(tmp_path: Path) -> None:
    document = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "deep%20er/a%231.bin"}, {"uri": "data:;base64,AAAA"}],
        "images": [{"uri": "b\\c.png"}, {"uri": "https://host/d.png"}, {"uri": "../up.png"}],
        "extensions": {"X": [{"uri": "./e/../f.ktx2"}, {"uri": "/etc/passwd"}, {"uri": "C:/x"}]},
    }
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    assert set(references(tmp_path / "a.gltf")) == {
        "deep er/a#1.bin", "deep%20er/a%231.bin", "b\\c.png", "b/c.png", "../up.png", "f.ktx2",
    }  # fmt: skip


def test_an_obj_names_its_libraries_and_then_their_textures(tmp_path: Path) -> None:
    asset = tmp_path / "a.obj"
    asset.write_text("mtllib my lib.mtl\r\nv 0 0 0\n# mtllib no.mtl\n  mtllib two.mtl\n")
    assert references(asset) == ("my lib.mtl", "my", "lib.mtl", "two.mtl")
    library = "newmtl x\nmap_Kd -o 1 2 3 -clamp on tex\\a b.png\nbump c.png\nKd 1 1 1\n"
    (tmp_path / "two.mtl").write_text(library)
    assert references(asset)[4:] == ("tex\\a b.png", "tex/a b.png", "c.png")


@pytest.mark.skipif(importlib.util.find_spec("pxr") is None, reason="usd-core is not installed")
def test_a_usd_file_names_the_layers_of_its_layers(tmp_path: Path) -> None:
    header = "#usda 1.0\n"
    (tmp_path / "a.usda").write_text(f"{header}(subLayers = [@./sub/b.usda@])\n")
    assert references(tmp_path / "a.usda") == ("sub/b.usda",)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "b.usda").write_text(
        f'{header}(subLayers = [@../a.usda@])\ndef "X" (references = @c.usda@) {{}}\n'
    )
    assert references(tmp_path / "a.usda") == ("sub/b.usda", "a.usda", "sub/c.usda")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.gltf", b"{broken"),
        ("a.glb", b"glTF"),
        ("a.obj", b""),
        ("a.usda", b"no usd"),
        ("a.ply", b"ply\n"),
        ("a.stl", b"solid"),
        ("a.obj", b"mtllib x\0y\n"),
    ],
)
def test_what_refers_to_nothing_or_cannot_be_read_names_nothing_that_is_there(
    tmp_path: Path, name: str, content: bytes
) -> None:
    (tmp_path / name).write_bytes(content)
    assert references(tmp_path / name) == ()


def test_a_file_that_is_missing_names_nothing(tmp_path: Path) -> None:
    assert references(tmp_path / "a.obj") == ()


def test_a_name_that_no_system_can_hold_hides_no_other(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_bytes(b"mtllib " + 300 * b"x" + b"\nmtllib b.mtl\n")
    assert references(tmp_path / "a.obj") == (300 * "x", "b.mtl")

"""A file whose name and content disagree gives one line that says what it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from aobake.errors import InputError
from aobake.meshes.formats import load

GLB = b"glTF\x02\0\0\0\x0c\0\0\0"
PLY = b"ply\nformat ascii 1.0\nend_header\n"
STL = b"solid a\n facet normal 0 0 1\n"
OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.mark.parametrize(
    ("name", "content", "finding"),
    [
        ("chair.obj", GLB, "this is a GLB file, not OBJ. Rename it to chair.glb."),
        ("chair.gltf", GLB, "this is a GLB file, not GLTF. Rename it to chair.glb."),
        ("chair.stl", PLY, "this is a PLY file, not STL. Rename it to chair.ply."),
        ("chair.obj", STL, "this is an STL file, not OBJ. Rename it to chair.stl."),
        ("chair.obj", b"OFF\n3 1 0\n", "this is an OFF file, not OBJ. Rename it to chair.off."),
        ("chair.glb", b'\xef\xbb\xbf {"asset": {}}', "this is a glTF file, not GLB"),
        ("chair.glb", b"hello\n", "this is text of another kind, not GLB"),
        ("chair.glb", b"he\0\0llo", "this is binary data of another kind, not GLB"),
        ("chair.ply", OBJ, "this is text of another kind, not PLY"),
        ("chair.obj", b"\0\x01\x02\xff", "this is binary data, not OBJ"),
        ("chair.obj", b"Kaydara FBX Binary  \0", "this is an FBX file, not OBJ"),
        ("chair.glb", b"<!DOCTYPE html><html>", "this is a web page, not GLB. Download it again."),
        ("chair.glb", b"version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer"),
        ("chair.obj", b"\x89PNG\r\n", "this is a PNG image, not OBJ"),
        ("chair.3mf", OBJ, "this is text of another kind, not 3MF"),
        ("chair.vrm", GLB, "this is a GLB file, not VRM. Rename it to chair.glb."),
        ("chair", GLB, "this is a GLB file, not an asset. Rename it to chair.glb."),
        ("chair.obj", b"", "the file is empty"),
        ("chair.glb", b"", "the file is empty"),
        ("chair.xyzzy", b"what", ".xyzzy is no known format"),
        ("chair.fbx", b"; FBX 7.4.0", "Export it as GLB"),
        ("chair.blend", b"of old", "Export it as GLB"),
    ],
)
def test_a_wrong_name_is_one_line_with_the_finding_and_the_cure(
    tmp_path: Path, name: str, content: bytes, finding: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        load(tmp_path / name)
    assert str(caught.value).startswith(str(tmp_path / name) + ": ")
    assert finding in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["gone.obj", "gone.fbx", "gone", "nul\0.obj"])
def test_a_file_that_is_not_there_is_said_to_be_missing(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"no such file|not a file name"):
        load(tmp_path / name)


def test_a_folder_is_no_asset(tmp_path: Path) -> None:
    (tmp_path / "a.obj").mkdir()
    with pytest.raises(InputError, match="not a regular file"):
        load(tmp_path / "a.obj")


def test_a_right_name_in_capitals_passes(tmp_path: Path) -> None:
    (tmp_path / "A.OBJ").write_bytes(OBJ)
    assert load(tmp_path / "A.OBJ").triangles == 1

"""OBJ files of every spelling are read alike, and broken ones give one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import aobake
from aobake.errors import InputError
from aobake.meshes.formats import load, obj
from aobake.meshes.scene import Scene
from tests.meshes.formats.damage import damaged, read_or_refused

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\n"  # the last one is used by no face
TWO = [[0, 1, 2], [0, 2, 3]]


def read(tmp_path: Path, text: str | bytes) -> Scene:
    """The scene in an OBJ file of this text, triangles or not."""
    file = tmp_path / "asset.obj"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return obj.read(file, root=None, scene=None)


@pytest.mark.parametrize(
    "text",
    [
        QUAD + "f 1 2 3 4\n",
        QUAD + "f 1 2 3 4",
        QUAD + "f -5 -4 -3 -2\n",
        QUAD + "f 1 2 3\nf 1 3 4\n",
        QUAD + "vt 0 0\nvn 0 0 1\nf 1/1 2/1/1 3//1 4\n",
        QUAD + "vt 0 0\nf 1/ 2/1/ 3// -2/-1\n",
        QUAD + "# a comment\n\n   \no thing\ng a b\ns off\nusemtl Wood#2\nf 1 2 3 4 # a quad\n",
        QUAD + "l 1 2\np 1\nf 1 2 3 4\nunheard of\n",
        QUAD + "f 1 2 \\\n  3 \\\n4\n",
        QUAD + "# a path with a backslash at its end C:\\\nf 1 2 3 4\n",
        QUAD.replace("\n", " # c\n") + "\t f\t1  2\t3 4 \n",
        (QUAD + "f 1 2 3 \\\n4\n").replace("\n", "\r\n"),
        (QUAD + "f 1 2 3 4\n").replace("\n", "\r"),
        "\ufeff" + QUAD + "f 1 2 3 4\n",
        "f 1 2 3 4\n" + QUAD,
        QUAD.replace("0 0 0", "+.0 -0. 0e5 1.0") + "f 1 2 3 4\n",
        QUAD.replace("9 9 9", "9 9 9 .5 .5 .5 1") + "f 1 2 3 4\n",
    ],
)
def test_one_quad_in_every_spelling_gives_the_same_mesh(tmp_path: Path, text: str) -> None:
    mesh = read(tmp_path, text).meshes[0]
    assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]])
    assert_array_equal(mesh.faces, TWO)
    assert mesh.normals is None


def test_a_relative_index_counts_from_its_own_line(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 5\nv 1 0 5\nv 0 1 5\nf -3 -2 -1\n"
    assert_array_equal(read(tmp_path, text).meshes[0].faces, [[0, 1, 2], [3, 4, 5]])


def test_blocks_of_a_few_bytes_give_the_mesh_of_the_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = QUAD + "vn 0 0 1\nf -5//-1 -4//-1 -3//-1\nv 2 2 2\nvn 0 1 0\nf 1//1 -1//-1 2//2\n"
    whole = read(tmp_path, text).meshes[0]
    monkeypatch.setattr("aobake.meshes.formats.obj.statements.BLOCK_BYTES", 3)
    parts = read(tmp_path, text).meshes[0]
    assert_array_equal(parts.faces, whole.faces)
    assert_array_equal(parts.vertices, whole.vertices)
    assert whole.normals is not None
    assert parts.normals is not None
    assert_array_equal(parts.normals, whole.normals)


def test_corner_normals_are_averaged_and_a_shared_one_counts_once(tmp_path: Path) -> None:
    """Vertex 1 has two corners with the first normal and one with the second: both count the same."""
    text = QUAD + "vn 0 0 2\nvn 0 3 0\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\nf 1//2 5//2 2//2\n"
    normals = read(tmp_path, text).meshes[0].normals
    assert normals is not None
    assert_allclose(normals[0], [0, 1, 1])
    assert_allclose(normals[2], [0, 0, 1])


@pytest.mark.parametrize("faces", ["f 1//1 2//1 3//1\nf 1 3 4\n", "f 1//1 2//1 3//7\n"])
def test_normals_are_left_out_where_a_corner_has_none(tmp_path: Path, faces: str) -> None:
    assert read(tmp_path, QUAD + "vn 0 0 1\n" + faces).meshes[0].normals is None


def test_positions_that_are_not_finite_are_kept(tmp_path: Path) -> None:
    vertices = read(tmp_path, "v nan 0 0\nv inf 1e999 -inf\nv 0 1 0\nf 1 2 3\n").meshes[0].vertices
    assert_array_equal(vertices, [[np.nan, 0, 0], [np.inf, np.inf, -np.inf], [0, 1, 0]])


def test_digits_are_read_to_the_last_bit(tmp_path: Path) -> None:
    numbers = [0.1, 1 / 3, 5e-324, 1.7976931348623157e308, -123456789.123456789, 16777217.0]
    text = "v {!r} {!r} {!r}\nv {!r} {!r} {!r}\n".format(*numbers)
    assert read(tmp_path, text).meshes[0].vertices.reshape(-1).tolist() == numbers


@pytest.mark.parametrize(
    ("text", "line", "found"),
    [
        ("v 0 0 0\nv 1 zwei 0\n", 2, "'zwei'"),
        ("v 0 0 0\nv 1 1_0 0\n", 2, "'1_0'"),
        ("v 0 0 0\nv 1-2 0 0\n", 2, "'1-2'"),
        ("v 0 0 0\r\n\r\nv 1 2\r\n", 3, "2 numbers"),
        ("vn 0 0\n", 1, "2 numbers"),
        ("v 0 0 0\r\rv 1\r", 3, "1 numbers"),
        (QUAD + "f 1 2 6\n", 6, "vertex 6; there are 5"),
        (QUAD + "f 1 2 3\nf 0 1 2\n", 7, "vertex 0; there are 5"),
        (QUAD + "f 1 2 -6\n", 6, "vertex -6; there are 5"),
        (QUAD + "f 1 2 x\n", 6, "'x'"),
        (QUAD + "f 1/1 2/1 3/x\n", 6, "'3/x'"),
        (QUAD + "f 1/1 2/1 /3\n", 6, "'/3'"),
        (QUAD + "f 1/1/1/1 2 3\n", 6, "'1/1/1/1'"),
        (QUAD + "f 1 2 3.0\n", 6, "'3.0'"),
        (QUAD + "f 1 2 99999999999999999999999\n", 6, "there are 5"),
    ],
)
def test_what_cannot_be_read_is_named_by_its_line(
    tmp_path: Path, text: str, line: int, found: str
) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    message = str(caught.value)
    assert f"asset.obj: line {line}" in message
    assert found in message
    assert "\n" not in message


def test_a_line_beyond_sense_is_refused_by_its_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aobake.meshes.formats.obj.statements.BLOCK_BYTES", 1 << 10)
    monkeypatch.setattr("aobake.meshes.formats.obj.statements.MOST_LINE_BYTES", 1 << 12)
    with pytest.raises(InputError, match=r"asset\.obj: line 6 is longer than 4096 bytes"):
        read(tmp_path, QUAD + "f" + " 1" * 4000 + "\nf 1 2 3\n")


def test_faces_of_two_corners_and_surfaces_are_warned_of(tmp_path: Path) -> None:
    scene = read(tmp_path, QUAD + "f 1 2\nf 1\nf\nf 1 2 3\nsurf 0 1 0 1 1 2\n")
    assert_array_equal(scene.meshes[0].faces, [[0, 1, 2]])
    assert "3 faces" in scene.warnings[0]
    assert "free-form" in scene.warnings[1]


def test_a_file_without_faces_has_nothing_to_bake(tmp_path: Path) -> None:
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\nl 1 2\n")
    with pytest.raises(InputError, match=r"points\.obj: there is no triangle"):
        load(tmp_path / "points.obj")


def test_facts_count_what_is_in_the_file(tmp_path: Path) -> None:
    text = QUAD + "o a\ng x\nusemtl wood\nf 1 2 3 4\no b\nusemtl wood\nf 1 2 3\nl 1 2\n"
    source = read(tmp_path, text).source
    assert source is not None
    facts = source.facts()
    assert facts["vertices"] == 5
    assert facts["faces"] == 2
    assert facts["triangles"] == 3
    assert facts["objects"] == ["a", "b"]
    assert facts["materials"] == ["wood"]
    assert facts["lines and points"] == 1


def test_any_damage_gives_a_scene_or_an_input_error(tmp_path: Path) -> None:
    seed = (
        QUAD + "mtllib a.mtl\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 \\\n 4/1/1\nf -1 -2 -3 # c\n"
    ).encode()
    random = np.random.default_rng(20260)
    words = [
        b"/",
        b"-",
        b"\\\n",
        b"\r",
        b"#",
        b"\n",
        b"\0",
        b"9" * 30,
        b"nan",
        b"f ",
        b"v ",
        b"\xff",
    ]
    files = [damaged(seed, random, 5, words) for _ in range(700)]
    assert 25 < read_or_refused(files, lambda file: read(tmp_path, file)) < 675, (
        "else it tests nothing"
    )


def test_arrays_of_a_scene_are_read_only(tmp_path: Path) -> None:
    mesh = aobake.load(_quad_file(tmp_path)).meshes[0]
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0, 0] = 1.0


def _quad_file(tmp_path: Path) -> Path:
    file = tmp_path / "quad.obj"
    file.write_text(QUAD + "f 1 2 3 4\n")
    return file

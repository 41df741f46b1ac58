"""PLY files of every encoding are read alike, and broken ones give one line and claim no memory."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from aobake.errors import InputError
from aobake.meshes.formats import ply
from aobake.meshes.scene import Scene
from tests.meshes.formats.damage import damaged, read_or_refused

VERTICES = [
    (0.0, 0.0, 0.1),
    (1.0, 0.0, 1 / 3),
    (1.0, 1.0, -1e-30),
    (0.0, 1.0, 1e30),
    (9.0, 9.0, 9.0),
]
FACES = [[0, 1, 2, 3], [2, 1, 0], [0, 1, 2, 3, 3]]
TRIANGLES = [[0, 1, 2], [0, 2, 3], [2, 1, 0], [0, 1, 2], [0, 2, 3], [0, 3, 3]]
HEADER = """ply
format {} 1.0
comment made by hand
obj_info nothing
element camera 2
property double focus
property list uchar short marks
element vertex 5
property uchar flag
property double x
property float64 y
property float32 z
property list ushort float weights
property int nx
property int ny
property int nz
element face {}
property float area
property list {} {} vertex_indices
property char kind
element edge 1
property int a
end_header
"""


def write(order: str, count: str = "B", index: str = "i", faces: list[list[int]] = FACES) -> bytes:
    """The same mesh in an encoding: "" for ascii, "<" or ">"; struct codes of the face lists."""
    names = {"b": "char", "B": "uchar", "H": "ushort", "I": "uint", "i": "int", "h": "short"}
    encoding = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = HEADER.format(encoding, len(faces), names[count], names[index]).encode()
    rows: list[tuple[str, list[float]]] = [("dBhh", [1.5, 2, -7, 7]), ("dB", [2.5, 0])]
    for number, (x, y, z) in enumerate(VERTICES):
        rows.append((f"BddfH{number}fiii", [1, x, y, z, number, *[0.5] * number, 0, 0, number]))
    rows += [(f"f{count}{len(face)}{index}b", [2.5, len(face), *face, -3]) for face in faces]
    rows.append(("i", [4]))
    if order:
        return head + b"".join(struct.pack(order + code, *row) for code, row in rows)
    return head + b"".join(b" ".join(b"%r" % value for value in row) + b"\n" for _, row in rows)


def read(tmp_path: Path, data: bytes) -> Scene:
    """The scene in a PLY file of these bytes."""
    file = tmp_path / "asset.ply"
    file.write_bytes(data)
    return ply.read(file, root=None, scene=None)


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize(("count", "index"), [("B", "i"), ("b", "B"), ("I", "H"), ("i", "h")])
def test_every_encoding_and_type_gives_the_same_mesh(
    tmp_path: Path, order: str, count: str, index: str
) -> None:
    mesh = read(tmp_path, write(order, count, index)).meshes[0]
    z = np.array(VERTICES)[:, 2]
    assert_array_equal(mesh.vertices[:, :2], np.array(VERTICES)[:, :2])
    assert_array_equal(mesh.vertices[:, 2], z.astype(np.float32) if order else z)
    assert_array_equal(mesh.faces, TRIANGLES)
    assert mesh.normals is not None
    assert_array_equal(mesh.normals[:, 2], range(5))


@pytest.mark.parametrize("order", ["<", ">", ""])
def test_faces_that_are_all_alike_are_read_as_those_that_are_not(
    tmp_path: Path, order: str
) -> None:
    alike = read(tmp_path, write(order, faces=[[0, 1, 2], [2, 3, 4]]))
    assert_array_equal(alike.meshes[0].faces, [[0, 1, 2], [2, 3, 4]])


@pytest.mark.parametrize("newline", [b"\r\n", b"\r"])
def test_text_of_other_line_ends_is_read(tmp_path: Path, newline: bytes) -> None:
    mesh = read(tmp_path, write("").replace(b"\n", newline)).meshes[0]
    assert_array_equal(mesh.faces, TRIANGLES)


def test_a_binary_body_may_begin_with_a_byte_that_looks_like_a_line_end(tmp_path: Path) -> None:
    """The header ends in CR alone, and the first number's first byte is a LF."""
    head = (
        "ply\rformat binary_little_endian 1.0\relement vertex 1\rproperty int x\rproperty int y\r"
    )
    data = (head + "property int z\rend_header\r").encode() + struct.pack("<3i", 10, 13, 10)
    assert_array_equal(read(tmp_path, data).meshes[0].vertices, [[10, 13, 10]])


def test_a_header_without_an_end_is_not_searched_through_the_whole_file(tmp_path: Path) -> None:
    data = b"ply\nformat ascii 1.0\n" + b"comment x\n" * 450_000 + b"end_header\n"
    with pytest.raises(InputError, match="no end_header"):
        read(tmp_path, data)


def test_triangle_strips_are_read(tmp_path: Path) -> None:
    text = (
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty int x\nproperty int y\nproperty int z\n"
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 3 2 0\n"
    )
    scene = read(tmp_path, text.encode())
    assert_array_equal(scene.meshes[0].faces, [[0, 1, 2], [1, 3, 2], [3, 2, 0]])


def test_coordinates_that_are_not_finite_are_kept(tmp_path: Path) -> None:
    data = write("").replace(b"9.0 9.0 9.0", b"nan -inf 1e999")
    vertices = read(tmp_path, data).meshes[0].vertices
    assert_array_equal(vertices[4], [np.nan, -np.inf, np.inf])


@pytest.mark.parametrize("order", ["", "<"])
def test_a_count_beyond_the_file_is_refused_before_memory_is_claimed(
    tmp_path: Path, order: str
) -> None:
    for old, new in [
        (b"element vertex 5", b"element vertex 2147483648"),
        (b"element face 3", b"element face 99999999999"),
        (b"element camera 2", b"element camera 999999999999999999"),
    ]:
        data = write(order).replace(old, new)
        tracemalloc.start()
        with pytest.raises(InputError, match=r"asset\.ply: the header claims \d+ rows of element"):
            read(tmp_path, data)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 4e6  # bytes


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_a_file_that_is_cut_anywhere_is_refused_in_one_line(tmp_path: Path, order: str) -> None:
    data = write(order)
    for size in range(0, len(data) - 3, 7):
        with pytest.raises(InputError) as caught:
            read(tmp_path, data[:size])
        assert "asset.ply: " in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("order", ["", "<"])
@pytest.mark.parametrize("wrong", [5, -1, 2**31 - 1])
def test_an_index_beyond_the_vertices_names_its_face(
    tmp_path: Path, order: str, wrong: int
) -> None:
    data = write(order, faces=[[0, 1, 2], [2, 3, wrong], [0, 1, 2, 3]])
    with pytest.raises(InputError, match=rf"face 1 .* vertex {wrong}.*; there are 5 vertices"):
        read(tmp_path, data)


@pytest.mark.parametrize(
    ("old", "new", "finding"),
    [
        ("ply\n", "plyx\n", "no PLY file"),
        ("end_header\n", "", "no end_header"),
        ("format ascii 1.0\n", "", "no format line"),
        ("format ascii", "format binary_litle_endian", 'Did you mean "binary_little_endian"'),
        ("property double x", "property doubel x", "line 10: 'doubel' is no type"),
        ("property double x", "property double", "line 10: 'property double' is no line"),
        (
            "property double x",
            "property double u",
            "no element vertex with the properties x, y and z",
        ),
        ("element camera 2", "element camera -2", "line 5: '-2' is no number of rows"),
        ("element camera 2\n", "", "line 5: property focus comes before any element"),
        ("element camera 2", "element vertex 2", "element 'vertex' is declared 2 times"),
        (
            "list uchar int vertex_indices",
            "list float int vertex_indices",
            "counted in whole numbers",
        ),
        ("list uchar int vertex_indices", "list uchar int corners", "no list of whole numbers"),
        ("\n2.5 4 0 1", "\n2.5 vier 0 1", "line 31: 'vier' is no number"),
        ("\n2.5 4 0 1", "\n2.5 nan 0 1", "no valid number of items"),
        ("\n2.5 4 0 1", "\n2.5 1e300 0 1", "it ends within row 0"),
        ("\n2.5 4 0 1", "\n2.5 4 0 1.5", "points at vertex 1.5"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path: Path, old: str, new: str, finding: str) -> None:
    text = write("").decode()
    assert old in text
    with pytest.raises(InputError) as caught:
        read(tmp_path, text.replace(old, new, 1).encode())
    assert finding in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_any_damage_gives_a_scene_or_an_input_error(tmp_path: Path, order: str) -> None:
    seed, random = write(order), np.random.default_rng(77)
    files = [damaged(seed, random, 3) for _ in range(500)]
    assert 5 < read_or_refused(files, lambda file: read(tmp_path, file)) < 495, (
        "else it tests nothing"
    )


def test_facts_name_what_is_in_the_file(tmp_path: Path) -> None:
    source = read(tmp_path, write("<")).source
    assert source is not None
    facts = source.facts()
    assert facts["elements"] == {"camera": 2, "vertex": 5, "face": 3, "edge": 1}
    assert facts["encoding"] == "binary_little_endian"
    assert facts["triangles"] == 6
    assert facts["comments"] == ["made by hand", "nothing"]

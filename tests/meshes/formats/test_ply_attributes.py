"""What a PLY file says beyond its geometry, in every encoding and under every name."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from aobake.errors import InputError
from aobake.meshes.formats import ply
from aobake.meshes.scene import Mesh

SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
UV = [(0.0, 0.0), (0.5, 0.0), (0.5, 0.25), (0.0, 0.25)]
DOWN = np.array([(u, 1 - v) for u, v in UV])
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


def read(
    path: Path,
    properties: list[tuple[str, str]],
    rows: Sequence[tuple[float, ...]],
    faces: Sequence[tuple[list[int], list[float]]],
    encoding: str = "ascii",
) -> Mesh:
    """The mesh of a file: x, y, z and further properties of each vertex; corners and wedges of each face."""
    wedges = any(more for _, more in faces)
    head = ["ply", f"format {encoding} 1.0", f"element vertex {len(rows)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"property {kind} {name}" for kind, name in properties]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    head += ["property list uchar float texcoord"] if wedges else []
    codes = "fff" + "".join({"float": "f", "uchar": "B", "ushort": "H"}[k] for k, _ in properties)
    table: list[tuple[str, list[float]]] = [(codes, list(row)) for row in rows]
    for corners, more in faces:
        code = f"B{len(corners)}i" + (f"B{len(more)}f" if wedges else "")
        values = [len(corners), *corners, *([len(more), *more] if wedges else [])]
        table.append((code, values))
    if encoding == "ascii":
        body = "".join(" ".join(f"{v:g}" for v in values) + "\n" for _, values in table).encode()
    else:
        body = b"".join(struct.pack(ORDERS[encoding] + code, *values) for code, values in table)
    path.write_bytes("\n".join([*head, "end_header", ""]).encode() + body)
    return ply.read(path, root=None, scene=None).meshes[0]


QUAD: list[tuple[list[int], list[float]]] = [([0, 1, 2, 3], [])]


@pytest.mark.parametrize("encoding", ORDERS)
@pytest.mark.parametrize("names", [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
def test_texture_coordinates_of_vertices_run_down(
    tmp_path: Path, names: tuple[str, str], encoding: str
) -> None:
    rows = [(*xyz, *uv) for xyz, uv in zip(SQUARE, UV, strict=True)]
    mesh = read(tmp_path / "a.ply", [("float", name) for name in names], rows, QUAD, encoding)
    assert_array_equal(mesh.attributes["TEXCOORD_0"].values, DOWN)
    assert mesh.attributes["TEXCOORD_0"].corners is None


@pytest.mark.parametrize("encoding", ORDERS)
def test_texture_coordinates_of_corners_stay_with_them(tmp_path: Path, encoding: str) -> None:
    flat = [value for uv in UV for value in uv]
    faces = [([0, 1, 2, 3], flat), ([0, 2, 1], [0.0, 0.0, 0.5, 0.25, 9.0, 8.0])]
    mesh = read(tmp_path / "a.ply", [], [*SQUARE], faces, encoding)
    found = mesh.at_corners("TEXCOORD_0")
    assert found is not None
    assert_array_equal(found[:2], DOWN[mesh.faces[:2]])
    assert_array_equal(found[2], [DOWN[0], DOWN[2], (9.0, -7.0)])


@pytest.mark.parametrize("encoding", ORDERS)
@pytest.mark.parametrize(("kind", "full"), [("uchar", 255), ("ushort", 65535), ("float", 1)])
def test_colors_are_scaled_by_their_type(
    tmp_path: Path, kind: str, full: int, encoding: str
) -> None:
    color = (full, 0, full // 5 if full > 1 else 0.5, full)
    rows = [(*xyz, *color) for xyz in SQUARE]
    properties = [(kind, name) for name in ("red", "green", "blue", "alpha")]
    mesh = read(tmp_path / "a.ply", properties, rows, QUAD, encoding)
    assert_allclose(mesh.attributes["COLOR_0"].values, [[1, 0, color[2] / full, 1]] * 4)
    three = read(tmp_path / "b.ply", properties[:3], [row[:6] for row in rows], QUAD, encoding)
    assert three.attributes["COLOR_0"].values.shape == (4, 3)


def test_occlusion_of_an_earlier_bake_is_an_attribute(tmp_path: Path) -> None:
    rows = [(*xyz, 0.25 * number) for number, xyz in enumerate(SQUARE)]
    mesh = read(tmp_path / "a.ply", [("float", "ao")], rows, QUAD)
    assert_array_equal(mesh.attributes["_AO"].values, [[0.0], [0.25], [0.5], [0.75]])


def test_parts_of_names_are_no_attribute(tmp_path: Path) -> None:
    rows = [(*xyz, 1.0, 2.0, 3.0) for xyz in SQUARE]
    names = ("s", "v", "red")
    mesh = read(tmp_path / "a.ply", [("float", name) for name in names], rows, QUAD)
    assert len(mesh.attributes) == 0


def test_wedges_of_another_size_stop_no_load_and_are_one_line_when_wanted(tmp_path: Path) -> None:
    faces = [([0, 1, 2], [0.0] * 6), ([0, 2, 3], [0.0] * 4)]
    mesh = read(tmp_path / "a.ply", [], [*SQUARE], faces)
    with pytest.raises(InputError) as caught:
        mesh.at_corners("TEXCOORD_0")
    assert "face 1 (from 0) has 4 numbers" in str(caught.value)
    assert "6 are needed" in str(caught.value)
    assert "\n" not in str(caught.value)

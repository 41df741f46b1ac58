"""New OBJ and PLY documents for scenes that came from anywhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats import check_target, load, write_vertex_ao
from aobake.meshes.scene import Instance, Mesh, Scene
from aobake.settings import Store, StoreSettings

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
MIRROR = np.array([[-2, 0, 0, 5], [0, 3, 0, 0], [0, 0.5, 1, 0], [0, 0, 0, 1]], float)


def volume(mesh: Mesh) -> float:
    """Signed volume; positive where faces wind outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def two_instances(normals: NDArray[np.float64] | None = None) -> Scene:
    """A tetrahedron, and the same one mirrored, sheared and moved: 6 times its volume."""
    mesh = Mesh(vertices=TETRAHEDRON, faces=FACES, normals=normals, name="a b\n#c")
    placed = (Instance(mesh=0, name="first # one"), Instance(mesh=0, transform=MIRROR))
    return Scene(meshes=(mesh,), instances=placed)


AO = [np.array([0, 0.25, 0.5, 1], np.float32), np.array([1 / 3, 0.1, 0.9, 0.7], np.float32)]


@pytest.mark.parametrize("name", ["a.ply", "a.obj"])
def test_instances_are_merged_where_they_stand_with_their_front_outside(
    tmp_path: Path, name: str
) -> None:
    write_vertex_ao(two_instances(), AO, tmp_path / name, StoreSettings())
    mesh = load(tmp_path / name).meshes[0]
    assert_array_equal(mesh.vertices[:4], TETRAHEDRON)
    assert_allclose(mesh.vertices[4:], TETRAHEDRON @ MIRROR[:3, :3].T + MIRROR[:3, 3])
    assert_allclose(volume(mesh), 1 / 6 + 1, rtol=1e-12)
    assert mesh.normals is None


@pytest.mark.parametrize("name", ["a.ply", "a.obj"])
def test_normals_stay_perpendicular_and_outside(tmp_path: Path, name: str) -> None:
    """A normal that was that of face 1 2 3 is the mirrored face's own, to float32."""
    normals = np.full((4, 3), 3.0)
    write_vertex_ao(two_instances(normals), AO, tmp_path / name, StoreSettings())
    mesh = load(tmp_path / name).meshes[0]
    assert mesh.normals is not None
    a, b, c = (mesh.vertices[mesh.faces[7, corner]] for corner in range(3))
    outside = np.cross(b - a, c - a)
    assert_allclose(mesh.normals[5], outside / np.linalg.norm(outside), atol=1e-6)


def test_normals_are_left_out_where_one_mesh_has_none(tmp_path: Path) -> None:
    with_normals = Mesh(vertices=TETRAHEDRON, faces=FACES, normals=TETRAHEDRON)
    scene = Scene.from_meshes([with_normals, Mesh(vertices=TETRAHEDRON, faces=FACES)])
    write_vertex_ao(scene, AO, tmp_path / "a.ply", StoreSettings())
    assert load(tmp_path / "a.ply").meshes[0].normals is None


@pytest.mark.parametrize("name", ["a.ply", "a.obj"])
def test_coordinates_come_back_to_the_last_bit(tmp_path: Path, name: str) -> None:
    vertices = np.array([[1 / 3, 5e-324, -0.0], [1e308, np.nan, 16777217.0], [0.1, np.inf, 7]])
    scene = Scene.from_arrays(vertices, [[0, 1, 2]])
    write_vertex_ao(scene, [np.ones(3, np.float32)], tmp_path / name, StoreSettings())
    assert load(tmp_path / name).meshes[0].vertices.tobytes() == vertices.tobytes()


def test_a_ply_file_takes_floats_where_they_are_exact(tmp_path: Path) -> None:
    for vertices, kind in ((TETRAHEDRON, b"float x"), (TETRAHEDRON / 3, b"double x")):
        scene = Scene.from_arrays(vertices, FACES)
        write_vertex_ao(scene, [np.ones(4, np.float32)], tmp_path / "a.ply", StoreSettings())
        assert kind in (tmp_path / "a.ply").read_bytes()


def test_values_stand_beside_their_vertices(tmp_path: Path) -> None:
    write_vertex_ao(two_instances(), AO, tmp_path / "a.ply", StoreSettings())
    data = (tmp_path / "a.ply").read_bytes()
    body = data[data.index(b"end_header\n") + 11 :]
    row = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3), ("ao", "<f4")])
    rows = np.frombuffer(body, row, 8)
    assert_array_equal(rows["ao"], np.concatenate(AO))
    # 0.9 and 0.7 as float32 lie just below 229.5 and 178.5 of 255.
    assert_array_equal(rows["rgb"][:, 1], [0, 64, 128, 255, 85, 26, 229, 178])
    write_vertex_ao(two_instances(), AO, tmp_path / "a.obj", StoreSettings())
    lines = [line.split() for line in (tmp_path / "a.obj").read_text().splitlines()]
    shown = [float(words[4]) for words in lines if words[0] == "v"]
    assert_allclose(shown, np.concatenate(AO), rtol=1e-5)


def test_an_attribute_is_alone_in_a_new_ply_file(tmp_path: Path) -> None:
    write_vertex_ao(two_instances(), AO, tmp_path / "a.ply", StoreSettings(store="attribute"))
    assert b"red" not in (tmp_path / "a.ply").read_bytes()
    assert b"property float ao" in (tmp_path / "a.ply").read_bytes()


def test_names_of_instances_are_one_word_each(tmp_path: Path) -> None:
    write_vertex_ao(two_instances(), AO, tmp_path / "a.obj", StoreSettings())
    lines = (tmp_path / "a.obj").read_text().splitlines()
    assert [line for line in lines if line.startswith("o ")] == ["o first___one", "o a_b__c"]


def test_an_obj_file_is_written_as_ply_and_the_other_way_round(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n")
    ao = [np.array([0.5, 0.25, 1], np.float32)]
    write_vertex_ao(load(tmp_path / "a.obj"), ao, tmp_path / "b.ply", StoreSettings())
    write_vertex_ao(load(tmp_path / "b.ply"), ao, tmp_path / "c.obj", StoreSettings())
    mesh = load(tmp_path / "c.obj").meshes[0]
    assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert mesh.normals is not None
    assert_array_equal(mesh.normals, [[0, 0, 1]] * 3)


@pytest.mark.parametrize(
    ("name", "store"),
    [("a.obj", "attribute"), ("a.obj", "occlusion"), ("a.ply", "occlusion")],
)
def test_a_store_without_a_place_takes_the_next_one_and_says_so(
    tmp_path: Path, name: str, store: Store
) -> None:
    target, settings = tmp_path / name, StoreSettings(store=store)
    found = check_target(two_instances(), target, settings)
    assert len(found) == 1
    assert name in found[0]
    assert "\n" not in found[0]
    write_vertex_ao(two_instances(), AO, target, settings)
    instead = StoreSettings(store="color" if name == "a.obj" else "attribute")
    assert check_target(two_instances(), target, instead) == ()
    write_vertex_ao(two_instances(), AO, tmp_path / f"b{target.suffix}", instead)
    assert target.read_bytes() == (tmp_path / f"b{target.suffix}").read_bytes()


def test_values_of_another_scene_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="do not belong to this scene"):
        write_vertex_ao(two_instances(), AO[:1], tmp_path / "a.ply", StoreSettings())
    assert not (tmp_path / "a.ply").exists()

"""Scenes from arrays and from trimesh: what is taken, and what is refused with which words."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from aobake import BakeSettings, InputError, Instance, Material, Mesh, Scene, bake_vertices
from aobake.batch.pictures import thumbnails
from tests.scenes import TURNED, affine, box, icosphere

VERTICES, FACES = box()


@pytest.mark.parametrize(
    ("vertices", "faces", "normals", "said"),
    [
        (np.zeros((4, 2)), FACES[:0], None, "vertices"),
        (np.zeros(7), FACES[:0], None, "vertices"),
        (np.zeros((2, 3, 3)), FACES[:0], None, "vertices"),
        ([["a", "b", "c"]], FACES[:0], None, "vertices"),
        ([[1.0, 2.0, 3.0], [4.0]], FACES[:0], None, "vertices"),
        (VERTICES, FACES[:, :2], None, "faces"),
        (VERTICES, np.zeros((2, 4), np.int32), None, "faces"),
        (VERTICES, FACES.reshape(-1), None, "faces"),
        (VERTICES, FACES.astype(np.float64), None, "whole numbers"),
        (VERTICES, FACES > 2, None, "whole numbers"),
        (VERTICES, [["0", "1", "2"]], None, "whole numbers"),
        (VERTICES, [[0, 1, 8]], None, "vertex 8"),
        (VERTICES, [[0, 1, 2], [0, -1, 2]], None, "face 1 points at vertex -1"),
        (VERTICES, np.array([[0, 1, 2**40]]), None, "vertex 1099511627776"),
        (VERTICES, np.array([[0, 1, 2**63]], np.uint64), None, "vertex 9223372036854775808"),
        (np.zeros((0, 3)), [[0, 0, 0]], None, "there are 0 vertices"),
        (VERTICES, FACES, VERTICES[:4], "4 normals for 8 vertices"),
        (VERTICES, FACES, np.zeros((8, 2)), "normals"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused_in_one_line(
    vertices: object, faces: object, normals: object, said: str
) -> None:
    with pytest.raises(InputError) as caught:
        Scene.from_arrays(vertices, faces, normals, name="chair")  # type: ignore[arg-type]
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "chair" in str(caught.value)


@pytest.mark.parametrize(
    "kind", [np.int8, np.uint8, np.int16, np.uint16, np.int64, np.uint32, np.uint64]
)
def test_faces_may_be_any_whole_numbers(kind: type) -> None:
    scene = Scene.from_arrays(VERTICES.astype(np.float32), FACES.astype(kind))
    assert scene.meshes[0].faces.tolist() == FACES.tolist()
    assert scene.meshes[0].vertices.dtype == np.float64


def test_lists_and_views_are_arrays_as_well() -> None:
    scene = Scene.from_arrays(VERTICES.tolist(), FACES.tolist())
    strided = Scene.from_arrays(np.repeat(VERTICES, 2, axis=1)[:, ::2], np.asfortranarray(FACES))
    for made in (scene, strided):
        assert made.meshes[0].vertices.tolist() == VERTICES.tolist()
        assert made.meshes[0].vertices.flags.c_contiguous
        assert made.triangles == 12
        assert made.vertices == 8


@pytest.mark.parametrize("shape", [(0, 3), (0,)])
def test_an_empty_mesh_is_a_mesh(shape: tuple[int, ...]) -> None:
    scene = Scene.from_arrays(np.zeros(shape), np.zeros(shape, np.int32))
    assert (scene.vertices, scene.triangles) == (0, 0)
    assert [ao.shape for ao in bake_vertices(scene).ao] == [(0,)]


def test_arrays_at_an_odd_place_of_a_file_can_be_baked_and_seen() -> None:
    """Embree takes numbers at multiples of four bytes alone; a GLB may hold its indices anywhere."""
    data = b"--" + FACES.astype(np.int32).tobytes()
    odd = np.frombuffer(data, np.int32, offset=2).reshape(-1, 3)
    assert not odd.flags.aligned
    mesh = Mesh(vertices=VERTICES, faces=odd)
    apart = affine(1.0, (5.0, 0.0, 0.0))
    scene = Scene(meshes=(mesh,), instances=(Instance(mesh=0), Instance(mesh=0, transform=apart)))
    assert scene.meshes[0].faces.flags.aligned
    assert set(thumbnails(bake_vertices(scene, BakeSettings(rays=16)))) == {"before", "after"}


def test_a_scene_cannot_be_changed_and_changes_nothing() -> None:
    vertices, faces = VERTICES.copy(), FACES.copy()
    scene = Scene.from_arrays(vertices, faces)
    with pytest.raises(ValueError, match="read-only"):
        scene.meshes[0].vertices[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        scene.meshes[0].faces[0, 0] = 1
    vertices[0, 0] = 5.0  # the caller's own array stays writable
    bake_vertices(Scene.from_arrays(VERTICES, FACES), BakeSettings(rays=8))
    assert VERTICES.flags.writeable
    assert faces.tolist() == FACES.tolist()


def test_references_to_what_is_not_there_are_refused() -> None:
    mesh = Mesh(vertices=VERTICES, faces=FACES, name="seat")
    with pytest.raises(InputError, match="instance 1 stands for mesh 1; there are 1"):
        Scene(meshes=(mesh,), instances=(Instance(mesh=0), Instance(mesh=1)))
    with pytest.raises(InputError, match="instance 0 stands for mesh -1"):
        Scene(meshes=(mesh,), instances=(Instance(mesh=-1),))
    made = Mesh(vertices=VERTICES, faces=FACES, name="seat", material=2)
    with pytest.raises(InputError, match="'seat' is made of material 2; there are 1"):
        Scene(meshes=(made,), instances=(), materials=(Material(),))
    with pytest.raises(InputError, match=r"\(4, 4\), not \(3, 4\)"):
        Instance(mesh=0, transform=np.eye(3, 4))


def test_a_trimesh_gives_the_values_of_its_arrays() -> None:
    mesh = trimesh.Trimesh(*box(), process=False)
    settings = BakeSettings(rays=32)
    ours = bake_vertices(Scene.from_arrays(VERTICES, FACES), settings)
    theirs = bake_vertices(Scene.from_trimesh(mesh), settings)
    assert ours.ao[0].tobytes() == theirs.ao[0].tobytes()


def test_normals_that_a_trimesh_was_given_are_taken() -> None:
    normals = np.tile([0.0, 0.0, 1.0], (8, 1))
    given = trimesh.Trimesh(*box(), vertex_normals=normals, process=False)
    assert Scene.from_trimesh(given).meshes[0].normals is not None
    assert Scene.from_trimesh(trimesh.Trimesh(*box(), process=False)).meshes[0].normals is None


def test_a_trimesh_scene_keeps_its_instances_and_passes_over_what_has_no_faces() -> None:
    body = trimesh.Trimesh(*icosphere(1), process=False)
    scene = trimesh.Scene()
    turned = affine(TURNED, (5.0, 0.0, 0.0))
    scene.add_geometry(body, node_name="one", geom_name="ball")
    scene.graph.update(frame_to="other", geometry="ball", matrix=turned)  # type: ignore[no-untyped-call]
    scene.add_geometry(trimesh.PointCloud(VERTICES), node_name="dust")  # type: ignore[no-untyped-call]
    made = Scene.from_trimesh(scene)
    assert len(made.meshes) == 1
    assert {instance.name for instance in made.instances} == {"one", "other"}
    placed = {instance.name: instance.transform for instance in made.instances}
    assert np.allclose(placed["other"], turned)


@pytest.mark.parametrize("wrong", [None, 3, "chair.glb", VERTICES])
def test_what_is_no_trimesh_is_refused_with_the_cure(wrong: object) -> None:
    with pytest.raises(InputError, match="from_arrays"):
        Scene.from_trimesh(wrong)  # type: ignore[arg-type]

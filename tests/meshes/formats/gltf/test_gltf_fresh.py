"""A new document for a scene that was not read from glTF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aobake.errors import OutputError
from aobake.meshes.formats import gltf
from aobake.meshes.scene import Instance, Material, Mesh, Scene
from aobake.settings import Store, StoreSettings
from tests.meshes.formats.gltf.build import SQUARE, attribute, load, ramp, unpack_glb

FACES = np.array([[0, 1, 2], [0, 2, 3]])


def moved(*offset: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def square(**more: object) -> Mesh:
    return Mesh(**{"vertices": np.array(SQUARE), "faces": FACES, "name": "square", **more})  # type: ignore[arg-type]


def saved(
    scene: Scene, path: Path, store: Store = "color", ao: list[np.ndarray] | None = None
) -> Scene:
    gltf.write(scene, ramp(scene) if ao is None else ao, path, StoreSettings(store=store))
    return load(path)


@pytest.mark.parametrize("store", ["color", "occlusion", "attribute"])
@pytest.mark.parametrize("name", ["new.glb", "new.gltf"])
def test_a_scene_from_arrays_comes_back(tmp_path: Path, name: str, store: Store) -> None:
    normals = np.array([[0, 0, 5.0], [0, 0, 0], [np.nan, 0, 0], [3, 4, 0]])
    scene = Scene.from_arrays(SQUARE, FACES, normals, name="sheet")
    found = saved(scene, tmp_path / name, store).meshes[0]
    np.testing.assert_array_equal(found.vertices, SQUARE)
    np.testing.assert_array_equal(found.faces, FACES)
    assert found.name == "sheet"
    assert found.normals is not None
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0, atol=1e-7)
    np.testing.assert_allclose(found.normals[3], [0.6, 0.8, 0.0], atol=1e-7)
    files = ["new.gltf", "new_ao.bin"] if name == "new.gltf" else [name]
    assert sorted(p.name for p in tmp_path.iterdir()) == files


def test_instances_stay_instances_and_materials_stay(tmp_path: Path) -> None:
    leaf = Material(
        name="leaf",
        base_color=(0.1, 0.2, 0.3, 1.0),
        double_sided=True,
        alpha_mode="MASK",
        alpha_cutoff=0.25,
    )
    mirrored = np.diag([-2.0, 3.0, 1.0, 1.0])
    scene = Scene(
        meshes=(square(material=0),),
        instances=(
            Instance(mesh=0, name="a"),
            Instance(mesh=0, transform=mirrored @ moved(1, 2, 3), name="b"),
        ),
        materials=(leaf,),
    )
    found = saved(scene, tmp_path / "a.glb", ao=[np.full(4, 0.5, np.float32)] * 2)
    assert len(found.meshes) == 1
    assert [instance.name for instance in found.instances] == ["a", "b"]
    for before, after in zip(scene.instances, found.instances, strict=True):
        np.testing.assert_array_equal(after.transform, before.transform)
    assert found.materials == (found.materials[0],)
    assert [getattr(found.materials[0], key) for key in ("name", "double_sided", "alpha_mode", "alpha_cutoff")] == [
        "leaf", True, "MASK", 0.25,
    ]  # fmt: skip


def test_a_sheared_instance_stands_where_it_stood(tmp_path: Path) -> None:
    """A node holds translation, rotation and scale alone, so the vertices take up the rest."""
    shear = np.eye(4)
    shear[0, 1] = 0.5
    scene = Scene(
        meshes=(square(),), instances=(Instance(mesh=0), Instance(mesh=0, transform=shear))
    )
    found = saved(scene, tmp_path / "a.glb")
    assert "matrix" not in unpack_glb(tmp_path / "a.glb")[0]["nodes"][1]
    instance, mesh = list(found.placed())[1]
    np.testing.assert_allclose(
        mesh.vertices @ instance.transform[:3, :3].T + instance.transform[:3, 3],
        np.array(SQUARE) @ shear[:3, :3].T,
        atol=1e-7,
    )


def test_a_model_far_from_the_origin_keeps_its_shape(tmp_path: Path) -> None:
    """At 1e7, float32 is one unit coarse: the node carries the distance."""
    vertices = np.add(SQUARE, [1e7, -2e7, 3e7])
    found = saved(Scene.from_arrays(vertices, FACES), tmp_path / "a.glb")
    instance, mesh = next(found.placed())
    np.testing.assert_allclose(
        mesh.vertices + instance.transform[:3, 3], vertices, rtol=0, atol=1e-7
    )


def test_vertices_that_are_not_finite_stay_without_their_triangles(tmp_path: Path) -> None:
    vertices = np.array([*SQUARE, [np.nan, 0, 0]])
    found = saved(Scene.from_arrays(vertices, [*FACES, [0, 1, 4]]), tmp_path / "a.glb").meshes[0]
    np.testing.assert_array_equal(found.faces, FACES)
    np.testing.assert_array_equal(found.vertices, [*SQUARE, [0, 0, 0]])
    assert attribute(tmp_path / "a.glb", "COLOR_0").shape == (5, 4)


@pytest.mark.parametrize(("count", "kind"), [(65535, 5123), (65536, 5125)])
def test_indices_take_32_bits_only_where_they_must(tmp_path: Path, count: int, kind: int) -> None:
    scene = Scene.from_arrays(np.random.default_rng(0).random((count, 3)), [[0, 1, count - 1]])
    saved(scene, tmp_path / "a.glb")
    document = unpack_glb(tmp_path / "a.glb")[0]
    indices = document["meshes"][0]["primitives"][0]["indices"]
    assert document["accessors"][indices]["componentType"] == kind


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="there is no folder"):
        saved(Scene.from_arrays(SQUARE, FACES), tmp_path / "none" / "a.glb")
    with pytest.raises(OutputError, match="there is no folder"):
        gltf.check(Scene.from_arrays(SQUARE, FACES), StoreSettings(), tmp_path / "none" / "a.glb")

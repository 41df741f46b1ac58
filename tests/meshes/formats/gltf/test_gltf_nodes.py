"""The node tree, scenes, GPU instances and skins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aobake.errors import InputError
from tests.meshes.formats.gltf.build import SQUARE, Builder, load, square_builder

QUARTER_TURN = [0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)]  # about +z


def test_translation_rotation_and_scale_apply_in_that_order(tmp_path: Path) -> None:
    """x = (1, 0, 0) is scaled to 2, turned to +y, moved by (5, 0, 0)."""
    path = square_builder(translation=[5, 0, 0], rotation=QUARTER_TURN, scale=[2, 1, 1]).glb(
        tmp_path / "a.glb"
    )
    transform = load(path).instances[0].transform
    np.testing.assert_allclose(transform @ [1, 0, 0, 1], [5, 2, 0, 1], atol=1e-12)


def test_a_matrix_is_stored_by_columns_and_parents_come_first(tmp_path: Path) -> None:
    builder = Builder()
    child = builder.node(
        mesh=builder.mesh(), matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 4, 5, 1]
    )
    parent = builder.node(children=[child], scale=[-2, 2, 2])
    transform = load(builder.show(parent).glb(tmp_path / "a.glb")).instances[0].transform
    np.testing.assert_array_equal(transform @ [1, 1, 1, 1], [-8, 10, 12, 1])


def test_a_chain_of_five_thousand_nodes_is_followed(tmp_path: Path) -> None:
    builder = Builder()
    count = 5000
    for number in range(count - 1):
        builder.node(children=[number + 1], translation=[1, 0, 0])
    builder.node(mesh=builder.mesh())
    scene = load(builder.show(0).glb(tmp_path / "a.glb"))
    np.testing.assert_array_equal(scene.instances[0].transform[:3, 3], [count - 1, 0, 0])


@pytest.mark.parametrize(
    ("children", "words"),
    [
        ({0: [1], 1: [2], 2: [1]}, "node 1 has two parents"),
        ({0: [1], 1: [0]}, "node 0 stands below itself"),
        ({0: [0]}, "node 0 stands below itself"),
        ({0: [2], 1: [2]}, "node 2 has two parents"),
        ({0: [7]}, "children names 7, and the file has 3 nodes"),
        ({0: ["1"]}, "children is '1'"),
    ],
)
def test_nodes_that_are_no_tree_are_refused(
    tmp_path: Path, children: dict[int, list[Any]], words: str
) -> None:
    builder = Builder()
    for number in range(3):
        builder.node(
            mesh=builder.mesh(), **({"children": children[number]} if number in children else {})
        )
    with pytest.raises(InputError, match=words):
        load(builder.show(0).glb(tmp_path / "a.glb"))


def two_scenes() -> Builder:
    builder = Builder()
    nodes = [builder.node(mesh=builder.mesh(), translation=[x, 0, 0]) for x in (1, 2, 3)]
    builder.put("scenes", {"nodes": [nodes[0]], "name": "first"})
    builder.put("scenes", {"nodes": [nodes[1], nodes[2]], "name": "second"})
    return builder


@pytest.mark.parametrize(
    ("default", "asked", "places"),
    [
        (None, None, [1]),
        (1, None, [2, 3]),
        (1, "first", [1]),
        (0, "1", [2, 3]),
        (0, "second", [2, 3]),
    ],
)
def test_the_scene_that_is_asked_for_is_read(
    tmp_path: Path, default: int | None, asked: str | None, places: list[int]
) -> None:
    builder = two_scenes()
    if default is not None:
        builder.json["scene"] = default
    scene = load(builder.glb(tmp_path / "a.glb"), scene=asked)
    assert [int(instance.transform[0, 3]) for instance in scene.instances] == places


def test_an_unknown_scene_is_refused_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no scene 'secund'.*second"):
        load(two_scenes().glb(tmp_path / "a.glb"), scene="secund")


def test_without_scenes_every_root_is_shown(tmp_path: Path) -> None:
    builder = two_scenes()
    del builder.json["scenes"]
    assert len(load(builder.glb(tmp_path / "a.glb")).instances) == 3


def test_a_scene_may_list_a_node_that_stands_below_another(tmp_path: Path) -> None:
    """Found in the wild; the node is shown once, where its parents put it."""
    builder = Builder()
    child = builder.node(mesh=builder.mesh())
    parent = builder.node(children=[child], translation=[1, 0, 0])
    scene = load(builder.show(parent, child).glb(tmp_path / "a.glb"))
    assert [instance.transform[0, 3] for instance in scene.instances] == [1.0]


def test_gpu_instances_stand_in_the_space_of_their_node(tmp_path: Path) -> None:
    builder = Builder()
    attributes = {
        "TRANSLATION": builder.accessor([[1, 0, 0], [2, 0, 0]]),
        "ROTATION": builder.accessor([[0, 0, 0, 127], [0, 0, 127, 0]], "i1", normalized=True),
        "SCALE": builder.accessor([[1, 1, 1], [3, 3, 3]]),
    }
    extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    node = builder.node(mesh=builder.mesh(), translation=[0, 10, 0], extensions=extension)
    scene = load(builder.show(node).glb(tmp_path / "a.glb"))
    assert len(scene.meshes) == 1
    points = [instance.transform @ [1, 0, 0, 1] for instance in scene.instances]
    np.testing.assert_allclose(points, [[2, 10, 0, 1], [-1, 10, 0, 1]], atol=1e-12)


def test_gpu_instances_of_different_numbers_are_refused(tmp_path: Path) -> None:
    builder = Builder()
    attributes = {
        "TRANSLATION": builder.accessor([[1, 0, 0]]),
        "SCALE": builder.accessor([[1, 1, 1]] * 2),
    }
    extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    builder.show(builder.node(mesh=builder.mesh(), extensions=extension))
    with pytest.raises(InputError, match=r"\[1, 2\] values; one number"):
        load(builder.glb(tmp_path / "a.glb"))


def skinned_square(
    weights: list[list[float]], joint_scale: list[float], joints: list[int]
) -> Builder:
    """A square between two joints: the first at the origin, the second moved and scaled; its own node far away."""
    builder = Builder()
    normals = builder.accessor([[0, 0, 1]] * 4)
    attributes = {
        "JOINTS_0": builder.accessor([[*joints, 0, 0]] * 4, "u1"),
        "WEIGHTS_0": builder.accessor(weights),
        "NORMAL": normals,
    }
    mesh = builder.mesh(builder.primitive(attributes=attributes))
    first = builder.node()
    second = builder.node(translation=[0, 0, 10], scale=joint_scale)
    builder.put("skins", {"joints": [first, second]})
    node = builder.node(mesh=mesh, skin=0, translation=[1000, 0, 0])
    return builder.show(first, second, node)


def test_a_skin_puts_vertices_between_their_joints_and_ignores_its_node(tmp_path: Path) -> None:
    """Half of each joint: half of the height; weights that sum to 2 mean the same."""
    for sum_of_weights in (1.0, 2.0):
        half = [[sum_of_weights / 2, sum_of_weights / 2, 0, 0]] * 4
        scene = load(skinned_square(half, [1, 1, 1], [0, 1]).glb(tmp_path / "a.glb"))
        np.testing.assert_allclose(scene.meshes[0].vertices, np.add(SQUARE, [0, 0, 5]))
        np.testing.assert_array_equal(scene.instances[0].transform, np.eye(4))


def test_a_vertex_without_weight_follows_its_first_joint(tmp_path: Path) -> None:
    scene = load(skinned_square([[0, 0, 0, 0]] * 4, [1, 1, 1], [1, 0]).glb(tmp_path / "a.glb"))
    np.testing.assert_allclose(scene.meshes[0].vertices, np.add(SQUARE, [0, 0, 10]))


def test_a_mirroring_joint_turns_faces_with_their_normals(tmp_path: Path) -> None:
    """Mirrored in x, the corners run clockwise as seen from +z, where the normals still point."""
    mesh = load(
        skinned_square([[1, 0, 0, 0]] * 4, [-1, 1, 1], [1, 0]).glb(tmp_path / "a.glb")
    ).meshes[0]
    assert mesh.normals is not None
    a, b, c = (mesh.vertices[mesh.faces[0, k]] for k in range(3))
    assert np.dot(np.cross(b - a, c - a), mesh.normals[0]) > 0
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * 4)


def test_inverse_bind_matrices_come_before_the_joint(tmp_path: Path) -> None:
    builder = skinned_square([[1, 0, 0, 0]] * 4, [2, 2, 2], [1, 0])
    back = np.eye(4)
    back[2, 3] = -3.0
    matrices = builder.accessor(np.stack([np.eye(4), back.T]).reshape(2, 16))
    builder.json["skins"][0]["inverseBindMatrices"] = matrices
    scene = load(builder.glb(tmp_path / "a.glb"))
    np.testing.assert_allclose(
        scene.meshes[0].vertices, 2 * (np.array(SQUARE) - [0, 0, 3]) + [0, 0, 10]
    )


@pytest.mark.parametrize(
    ("skin", "joint", "words"),
    [
        ({"joints": []}, 0, "has no joints"),
        ({"joints": [0, 1]}, 2, "follows joint 2, and the skin has 2"),
        ({"joints": [0, 9]}, 0, "joints names 9"),
        ({"joints": [0, 1], "inverseBindMatrices": 0}, 0, "MAT4 is needed"),
    ],
)
def test_a_skin_that_lies_is_refused(
    tmp_path: Path, skin: dict[str, Any], joint: int, words: str
) -> None:
    builder = skinned_square([[1, 0, 0, 0]] * 4, [1, 1, 1], [joint, 0])
    builder.json["skins"][0] = skin
    with pytest.raises(InputError, match=words):
        load(builder.glb(tmp_path / "a.glb"))


def test_a_hidden_node_is_passed_over_with_everything_below_it(tmp_path: Path) -> None:
    def looks(visible: bool) -> dict[str, Any]:
        return {"KHR_node_visibility": {"visible": visible}}

    builder = Builder()
    mesh = builder.mesh()
    below = builder.node(mesh=mesh, name="below", extensions=looks(True))
    hidden = builder.node(mesh=mesh, name="hidden", children=[below], extensions=looks(False))
    shown = builder.node(mesh=mesh, name="shown", extensions=looks(True))
    by_default = builder.node(mesh=mesh, name="too", extensions={"KHR_node_visibility": {}})
    builder.json["extensionsRequired"] = builder.json["extensionsUsed"] = ["KHR_node_visibility"]
    scene = load(builder.show(hidden, shown, by_default).glb(tmp_path / "a.glb"))
    assert [instance.name for instance in scene.instances] == ["shown", "too"]

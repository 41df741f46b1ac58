"""Primitives as triangles: modes, morph targets, what is passed over."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aobake.errors import InputError
from aobake.meshes.formats.gltf.geometry import corners
from tests.meshes.formats.gltf.build import SQUARE, Builder, load

# A flat zigzag seen from above: as a strip, every triangle of it faces +z.
ZIGZAG = [[0, 0, 0], [0, -1, 0], [1, 0, 0], [1, -1, 0], [2, 0, 0]]


def facing(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.asarray(np.cross(b - a, c - a)[:, 2])


@pytest.mark.parametrize("indexed", [True, False])
def test_a_strip_faces_one_way_throughout(tmp_path: Path, indexed: bool) -> None:
    builder = Builder()
    primitive = builder.primitive(ZIGZAG, range(5) if indexed else None, mode=5)
    builder.show(builder.node(mesh=builder.mesh(primitive)))
    mesh = load(builder.glb(tmp_path / "a.glb")).meshes[0]
    assert len(mesh.faces) == 3
    np.testing.assert_array_equal(facing(mesh.vertices, mesh.faces), 1.0)


def test_a_fan_turns_about_its_first_vertex(tmp_path: Path) -> None:
    builder = Builder()
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(SQUARE, None, mode=6))))
    mesh = load(builder.glb(tmp_path / "a.glb")).meshes[0]
    assert [set(face) for face in mesh.faces.tolist()] == [{0, 1, 2}, {0, 2, 3}]
    np.testing.assert_array_equal(facing(mesh.vertices, mesh.faces), 1.0)


@pytest.mark.parametrize("mode", [4, 5, 6])
@pytest.mark.parametrize("count", range(6))
def test_corners_left_over_make_no_triangle(mode: int, count: int) -> None:
    faces = corners(np.arange(count, dtype=np.int32), mode)
    assert faces.shape == (count // 3 if mode == 4 else max(count - 2, 0), 3)


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_points_and_lines_are_passed_over(tmp_path: Path, mode: int) -> None:
    builder = Builder()
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(mode=mode), builder.primitive())))
    scene = load(builder.glb(tmp_path / "a.glb"))
    assert (len(scene.instances), scene.triangles, scene.warnings) == (1, 2, ())


def test_a_primitive_without_normals_is_shaded_flat(tmp_path: Path) -> None:
    builder = Builder()
    normals = builder.accessor([[0, 0, 1]] * 4)
    builder.show(
        builder.node(
            mesh=builder.mesh(
                builder.primitive(), builder.primitive(attributes={"NORMAL": normals})
            )
        )
    )
    bare, smooth = load(builder.glb(tmp_path / "a.glb")).meshes
    assert (bare.normals, bare.flat_shaded, smooth.flat_shaded) == (None, True, False)
    np.testing.assert_array_equal(smooth.normals, [[0, 0, 1]] * 4)


@pytest.mark.parametrize(
    ("mesh_weights", "node_weights", "height"),
    [(None, None, 0.0), ([0.5, 0.0], None, 0.5), ([0.5, 0.0], [0.25, 2.0], 4.25), ([], [1.0], 1.0)],
)
def test_morph_targets_move_by_their_default_weights(
    tmp_path: Path,
    mesh_weights: list[float] | None,
    node_weights: list[float] | None,
    height: float,
) -> None:
    """The node's weights come before the mesh's. Targets lift by 1 and 2."""
    builder = Builder()
    targets = [{"POSITION": builder.accessor([[0, 0, lift]] * 4)} for lift in (1, 2)]
    mesh = builder.mesh(
        builder.primitive(targets=targets),
        **({"weights": mesh_weights} if mesh_weights is not None else {}),
    )
    builder.show(
        builder.node(mesh=mesh, **({"weights": node_weights} if node_weights is not None else {}))
    )
    np.testing.assert_allclose(
        load(builder.glb(tmp_path / "a.glb")).meshes[0].vertices[:, 2], height
    )


def test_nodes_with_other_morph_weights_get_a_mesh_of_their_own(tmp_path: Path) -> None:
    builder = Builder()
    mesh = builder.mesh(
        builder.primitive(targets=[{"POSITION": builder.accessor([[0, 0, 1]] * 4)}])
    )
    nodes = [builder.node(mesh=mesh, weights=[w]) for w in (0.0, 1.0, 0.0)]
    scene = load(builder.show(*nodes).glb(tmp_path / "a.glb"))
    assert [instance.mesh for instance in scene.instances] == [0, 1, 0]


def test_normals_that_are_too_few_are_refused(tmp_path: Path) -> None:
    builder = Builder()
    primitive = builder.primitive(attributes={"NORMAL": builder.accessor([[0, 0, 1]] * 3)})
    builder.show(builder.node(mesh=builder.mesh(primitive)))
    with pytest.raises(InputError, match="3 normals for 4 vertices"):
        load(builder.glb(tmp_path / "a.glb"))


def test_a_primitive_without_positions_is_refused(tmp_path: Path) -> None:
    builder = Builder()
    builder.show(builder.node(mesh=builder.mesh({"attributes": {}})))
    with pytest.raises(InputError, match="mesh 0 primitive 0 has no POSITION"):
        load(builder.glb(tmp_path / "a.glb"))


def test_materials_are_those_of_the_file(tmp_path: Path) -> None:
    builder = Builder()
    builder.put("materials", {"name": "plain"})
    look = {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.25}
    builder.put(
        "materials",
        {
            "pbrMetallicRoughness": look,
            "alphaMode": "MASK",
            "alphaCutoff": 0.7,
            "doubleSided": True,
        },
    )
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(material=1))))
    scene = load(builder.glb(tmp_path / "a.glb"))
    plain, leaf = scene.materials
    assert (plain.metallic, plain.roughness, plain.alpha_mode, plain.double_sided) == (
        1.0,
        1.0,
        "OPAQUE",
        False,
    )
    assert (leaf.base_color, leaf.metallic, leaf.roughness) == ((0.1, 0.2, 0.3, 0.4), 0.5, 0.25)
    assert (leaf.alpha_mode, leaf.alpha_cutoff, leaf.double_sided) == ("MASK", 0.7, True)
    assert scene.meshes[0].material == 1

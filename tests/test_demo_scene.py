"""The showpiece: sound geometry, so that what one sees is the bake."""

from __future__ import annotations

import numpy as np
import pytest

from aobake import Scene
from aobake.demo import hall
from aobake.demo.patches import grid, rounded_path
from aobake.demo.shapes import ball, stone


@pytest.fixture(scope="module")
def scene() -> Scene:
    return hall()


def test_normals_are_unit_and_on_the_side_of_their_faces(scene: Scene) -> None:
    for mesh in scene.meshes:
        assert mesh.normals is not None
        assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        along = np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.normals[mesh.faces].sum(axis=1))
        assert np.all(along > 0.0), mesh.name


def test_every_vertex_is_used_and_finite(scene: Scene) -> None:
    for mesh in scene.meshes:
        assert np.array_equal(np.unique(mesh.faces), np.arange(len(mesh.vertices)))
        assert np.isfinite(mesh.vertices).all()


def test_it_is_small_enough_to_bake_in_seconds_and_shows_instances(scene: Scene) -> None:
    assert 20_000 < sum(len(mesh.faces) for mesh in scene.meshes) < 60_000
    assert len(scene.instances) > 2 * len(scene.meshes)
    assert len({mesh.material for mesh in scene.meshes}) == len(scene.materials)


def test_it_is_the_same_every_time(scene: Scene) -> None:
    again = hall()
    for one, other in zip(scene.meshes, again.meshes, strict=True):
        assert np.array_equal(one.vertices, other.vertices)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def test_a_ball_encloses_the_volume_of_a_ball() -> None:
    shape = ball(0.5, 96)
    assert volume(shape.vertices, shape.faces) == pytest.approx(np.pi / 6, rel=3e-3)


def test_a_stone_encloses_its_block_less_its_rounded_edges() -> None:
    shape = stone((1.0, 2.0, 3.0), 0.05, 0.2)
    inside = volume(shape.vertices, shape.faces)
    assert 0.98 * 6.0 < inside < 6.0
    assert np.allclose(np.abs(shape.vertices).max(axis=0), [0.5, 1.0, 1.5])


def test_a_grid_seen_from_the_front_faces_the_front() -> None:
    points = np.zeros((2, 3, 3))
    points[..., 0] = [0, 1, 2]
    points[1, :, 1] = 1
    patch = grid(points)
    assert np.allclose(patch.normals, [0, 0, 1])
    assert len(patch.faces) == 4


def test_a_row_of_one_point_is_the_tip_of_a_fan() -> None:
    points = np.zeros((2, 3, 3))
    points[0, :, 0] = [0, 1, 2]
    points[1] = [1, 1, 0]
    assert len(grid(points).faces) == 2


def test_a_rounded_path_keeps_its_ends_and_takes_no_long_steps() -> None:
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    path = rounded_path(corners, radius=0.2, step=0.25)
    assert np.array_equal(path[[0, -1]], corners[[0, -1]])
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= 0.25 + 1e-9
    assert np.linalg.norm(path - corners[1], axis=1).min() > 0.05

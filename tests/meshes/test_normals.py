"""Normals at vertices: angle-weighted, split at creases, finite whatever the faces are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aobake.meshes.normals import unit_rows
from aobake.meshes.surface import surface_of
from tests.scenes import (
    TURNED,
    FloatArray,
    Triangles,
    box,
    icosphere,
    joined,
    mesh_of,
    moved,
    patch,
    subdivided,
    unit,
    unwelded,
)


def normals_of(mesh: Triangles, *, flat: bool = False) -> FloatArray:
    return surface_of(mesh_of(mesh, flat_shaded=flat)).normals


def roof(degrees: float) -> Triangles:
    """Two unwelded squares along the y axis whose normals are so far apart."""
    a = math.radians(degrees) / 2.0
    left = patch(
        (-math.cos(a), 0, -math.sin(a)), (0, 0, 0), (0, 1, 0), (-math.cos(a), 1, -math.sin(a))
    )
    right = patch(
        (0, 0, 0), (math.cos(a), 0, -math.sin(a)), (math.cos(a), 1, -math.sin(a)), (0, 1, 0)
    )
    return joined(left, right)


@pytest.mark.parametrize("scale", [1e-150, 1e-9, 1.0, 1e9, 1e150])
def test_at_the_corner_of_a_box_the_normal_is_the_diagonal_however_it_is_cut_up(
    scale: float,
) -> None:
    """Weights by angle: by area, the two triangles of a side would count double."""
    corners = box()
    expected = np.sign(corners.vertices) / math.sqrt(3.0)
    for mesh in (corners, subdivided(corners), subdivided(subdivided(corners))):
        found = normals_of(moved(mesh, scale))[:8]
        assert np.allclose(found, expected, atol=1e-12)


def test_normals_of_a_sphere_point_outward() -> None:
    ball = icosphere(3)
    assert np.einsum("ij,ij->i", normals_of(ball), ball.vertices).min() > 0.9995


def test_normals_turn_with_the_mesh() -> None:
    mesh = joined(icosphere(1), moved(box(), 0.7, (2.0, 0.0, 0.0)))
    assert np.allclose(normals_of(moved(mesh, TURNED)), normals_of(mesh) @ TURNED.T, atol=1e-12)


@pytest.mark.parametrize(
    ("degrees", "smooth"), [(10.0, True), (39.0, True), (41.0, False), (90.0, False)]
)
def test_unwelded_faces_share_a_normal_up_to_the_crease_angle(degrees: float, smooth: bool) -> None:
    mesh = roof(degrees)
    found = normals_of(mesh)
    ridge = np.abs(mesh.vertices[:, 0]) < 1e-12
    angle = np.degrees(np.arccos(np.clip(found[ridge][:, 2], -1.0, 1.0)))
    assert np.allclose(angle, 0.0 if smooth else degrees / 2.0, atol=1e-5)


def test_flat_shaded_faces_keep_normals_of_their_own() -> None:
    mesh = unwelded(icosphere(1))
    found = normals_of(mesh, flat=True).reshape(-1, 3, 3)
    assert np.allclose(found, found[:, :1])
    smooth = normals_of(mesh)
    assert np.allclose(np.einsum("ij,ij->i", smooth, mesh.vertices), 1.0, atol=2e-2)
    assert not np.allclose(smooth, normals_of(mesh, flat=True), atol=1e-2)


@pytest.mark.parametrize("width", [1e-3, 1e-6, 1e-9])
def test_a_vertex_among_needles_has_the_normal_of_their_plane(width: float) -> None:
    """In float32, or from areas, an aspect of 1e6 turns it by 12 degrees."""
    angles = np.array([0.0, width, 2.2, 2.2 + width, 4.1, 4.1 + width])
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=1)
    fan = Triangles(
        np.concatenate([[np.zeros(3)], rim]), np.array([(0, 1, 2), (0, 3, 4), (0, 5, 6)], np.int32)
    )
    turned = moved(fan, TURNED, (1.0, 2.0, 3.0))
    cosine = float(normals_of(turned)[0] @ TURNED[:, 2])
    assert math.degrees(math.acos(min(1.0, cosine))) < 0.01


def test_a_welded_wall_with_two_sides_looks_to_its_first_one() -> None:
    """The sum of both would be zero."""
    wall = patch((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), 3, 3)
    both = Triangles(wall.vertices, np.concatenate([wall.faces, wall.faces[:, ::-1]]))
    assert np.allclose(normals_of(both), [0.0, 0.0, 1.0])


def test_duplicated_faces_do_not_pull_a_normal() -> None:
    mesh = box()
    doubled = Triangles(mesh.vertices, np.concatenate([mesh.faces, mesh.faces]))
    assert np.allclose(normals_of(doubled), normals_of(mesh), atol=1e-12)


def test_faces_without_area_do_not_pull_a_normal() -> None:
    mesh = box()
    junk = np.array([(0, 0, 1), (3, 3, 3)], np.int32)
    middle = Triangles(
        np.concatenate([mesh.vertices, mesh.vertices[:1]]),
        np.concatenate([mesh.faces, junk, [[0, 8, 1]]]).astype(np.int32),
    )
    assert np.allclose(normals_of(middle)[:8], normals_of(mesh), atol=1e-12)


def test_unused_vertices_have_no_normal() -> None:
    mesh = box()
    with_more = Triangles(np.concatenate([mesh.vertices, np.full((2, 3), 9.0)]), mesh.faces)
    assert not normals_of(with_more)[8:].any()


@pytest.mark.parametrize("scale", [5e-324, 1e-300, 1e-150, 1.0, 1e150, 1.7e308])
def test_any_vector_comes_out_at_length_one(scale: float) -> None:
    vectors = scale * np.array([(1.0, 0.0, 0.0), (-1.0, 1.0, 1.0), (0.0, 0.0, -1.0)])
    assert np.allclose(np.linalg.norm(unit_rows(vectors), axis=1), 1.0, atol=1e-12)


def test_what_has_no_direction_comes_out_as_zero() -> None:
    vectors = np.array(
        [(0.0, 0.0, 0.0), (np.nan, 1.0, 0.0), (np.inf, 0.0, 0.0), (0.0, -np.inf, 1.0)]
    )
    assert not unit_rows(vectors).any()
    assert unit_rows(np.zeros((0, 3))).shape == (0, 3)
    assert unit_rows(np.array([unit((1, 2, 2))])).tolist() == [unit((1, 2, 2)).tolist()]


@pytest.mark.parametrize("scale", [1e-300, 1e-100, 1e-60, 1e60, 1e100, 1e300])
def test_normals_are_the_same_at_any_size(scale: float) -> None:
    mesh = box()
    sized = Triangles(scale * mesh.vertices, mesh.faces)
    assert np.allclose(normals_of(sized), normals_of(mesh), atol=1e-12)


def test_weights_are_angles_to_the_last_digits() -> None:
    """Two faces at a vertex, of which one has any angle and the other a right one."""
    for angle in [1e-9, 1e-3, 0.3, np.pi / 4, 1.0, np.pi / 2, 2.0, 3.0, np.pi - 1e-6]:
        tip = (np.cos(angle), np.sin(angle), 0.0)
        vertices = np.array([(0, 0, 0), (1, 0, 0), tip, (0, 0, 1)], np.float64)
        found = normals_of(Triangles(vertices, np.array([(0, 1, 2), (0, 3, 1)], np.int32)))[0]
        assert math.atan2(found[2], found[1]) == pytest.approx(math.atan2(angle, np.pi / 2), 1e-13)

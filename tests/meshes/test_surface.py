"""What of a mesh is used and what is baked, and what is said about the rest."""

from __future__ import annotations

import numpy as np
import pytest

from aobake.meshes.surface import Surface, surface_of
from tests.scenes import FloatArray, Triangles, box, flipped, mesh_of, unwelded

BOX = box()


def looked_at(mesh: Triangles, normals: FloatArray | None = None) -> Surface:
    return surface_of(mesh_of(mesh, normals=normals))


def said(surface: Surface) -> dict[str, int]:
    return {finding.kind: finding.count for finding in surface.findings}


def test_an_ordinary_mesh_is_used_whole_and_nothing_is_said() -> None:
    surface = looked_at(BOX)
    assert surface.faces.tolist() == BOX.faces.tolist()
    assert surface.asked.all()
    assert surface.same_as.tolist() == list(range(8))
    assert surface.findings == ()


def test_vertices_with_one_place_and_normal_are_baked_once() -> None:
    """36 corners of an unwelded box: three normals at each of its eight places."""
    surface = looked_at(unwelded(BOX))
    assert int(surface.asked.sum()) == 24
    assert surface.asked[surface.same_as].all()
    same = unwelded(BOX).vertices[surface.same_as]
    assert (same == unwelded(BOX).vertices).all()
    assert (surface.normals[surface.same_as] == surface.normals).all()


def test_a_traced_vertex_stands_for_others_even_if_an_unused_one_comes_first() -> None:
    vertices = np.concatenate([BOX.vertices[:1], BOX.vertices])
    surface = looked_at(Triangles(vertices, BOX.faces + np.int32(1)))
    assert not surface.asked[0]
    assert surface.asked[1:].all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_vertex_that_is_not_finite_takes_its_faces_along(bad: float) -> None:
    vertices = np.concatenate([BOX.vertices, [[bad, 0.0, 0.0]]])
    faces = np.concatenate([BOX.faces, [[0, 1, 8]]]).astype(np.int32)
    surface = looked_at(Triangles(vertices, faces))
    assert surface.faces.tolist() == BOX.faces.tolist()
    assert not surface.asked[8]
    assert np.isfinite(surface.normals).all()
    assert said(surface) == {"non-finite": 1}


def test_faces_without_area_are_passed_over_and_counted() -> None:
    vertices = np.concatenate([BOX.vertices, [(0.0, 0.0, 5.0), (0.0, 0.0, 6.0), (0.0, 0.0, 7.0)]])
    junk = [(0, 0, 1), (2, 2, 2), (8, 9, 10), (3, 1, 3)]
    faces = np.concatenate([junk, BOX.faces]).astype(np.int32)
    surface = looked_at(Triangles(vertices, faces))
    assert surface.faces.tolist() == BOX.faces.tolist()
    assert not surface.asked[8:].any()
    assert said(surface) == {"degenerate": 4}


def test_normals_that_a_file_gives_are_taken_at_length_one() -> None:
    normals = np.tile([0.0, 3.0, 4.0], (8, 1))
    surface = looked_at(BOX, normals)
    assert np.allclose(surface.normals, [0.0, 0.6, 0.8])
    assert surface.findings == ()


@pytest.mark.parametrize("bad", [(0.0, 0.0, 0.0), (np.nan, 0.0, 1.0), (np.inf, 0.0, 0.0)])
def test_normals_without_direction_are_computed_and_counted(
    bad: tuple[float, float, float],
) -> None:
    normals = np.sign(BOX.vertices)
    normals[[2, 5]] = bad
    surface = looked_at(BOX, normals)
    assert np.allclose(surface.normals, np.sign(BOX.vertices) / np.sqrt(3.0))
    assert said(surface) == {"replaced-normal": 2}


def test_a_face_that_looks_against_its_normals_is_seen_from_there() -> None:
    surface = looked_at(flipped(BOX), np.sign(BOX.vertices))
    a, b, c = BOX.vertices[surface.faces].transpose(1, 0, 2)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0.0).all()


def test_a_vertex_whose_normal_cannot_be_told_is_not_traced_but_counted() -> None:
    """Two faces of one place, opposite and with corners of their own but one."""
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0.0)])
    faces = np.array([(0, 1, 2), (0, 4, 3)], np.int32)
    surface = looked_at(Triangles(vertices, faces))
    assert np.isfinite(surface.normals).all()
    assert surface.asked[surface.normals.any(axis=1)].any()
    assert not surface.asked[~surface.normals.any(axis=1)].any()


def test_nothing_at_all_is_a_surface() -> None:
    surface = looked_at(Triangles(np.zeros((0, 3)), np.zeros((0, 3), np.int32)))
    assert (len(surface.faces), len(surface.normals), len(surface.asked)) == (0, 0, 0)
    lonely = looked_at(Triangles(np.zeros((3, 3)), np.zeros((0, 3), np.int32)))
    assert not lonely.asked.any()

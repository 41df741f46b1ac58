"""Winding: honoured where it is consistent, made so where it is not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.meshes.surface import surface_of
from tests.scenes import (
    TURNED,
    Triangles,
    box,
    flipped,
    icosphere,
    joined,
    mesh_of,
    moved,
    patch,
    unwelded,
)


def oriented(mesh: Triangles) -> NDArray[np.uint32]:
    return surface_of(mesh_of(mesh)).faces


def volume(mesh: Triangles, faces: NDArray[np.uint32]) -> float:
    a, b, c = mesh.vertices[faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def mixed(mesh: Triangles, share: float, seed: int = 0) -> Triangles:
    """The mesh with a share of its faces wound the other way."""
    over = np.random.default_rng(seed).random(len(mesh.faces)) < share
    return Triangles(
        mesh.vertices, np.where(over[:, None], mesh.faces[:, ::-1], mesh.faces).astype(np.int32)
    )


@pytest.mark.parametrize(
    "body", [box(), icosphere(2), unwelded(icosphere(2)), moved(box(), TURNED, (7.0, 0.0, 0.0))]
)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_closed_body_of_mixed_winding_looks_outward(body: Triangles, share: float) -> None:
    tangled = mixed(body, share)
    assert math.isclose(
        volume(body, oriented(tangled)), volume(body, body.faces.astype(np.uint32)), rel_tol=1e-9
    )


def test_consistent_winding_is_honoured_even_inward() -> None:
    """A closed mesh whose faces all look inward is a room."""
    room = flipped(icosphere(2))
    assert (oriented(room) == room.faces).all()


def test_an_open_sheet_goes_with_most_of_its_area() -> None:
    sheet = patch((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), 8, 8)
    for share, up in ((0.2, True), (0.8, False)):
        tangled = mixed(sheet, share, seed=3)
        a, b, c = sheet.vertices[oriented(tangled)].transpose(1, 0, 2)
        heights = np.cross(b - a, c - a)[:, 2]
        assert (heights > 0.0).all() if up else (heights < 0.0).all()


def test_parts_are_settled_one_by_one() -> None:
    """A tangled ball is mended, a room beside it stays a room."""
    ball, room = mixed(icosphere(1), 0.3), flipped(moved(box(), 1.0, (5.0, 0.0, 0.0)))
    faces = oriented(joined(ball, room))
    both = joined(icosphere(1), room)
    assert volume(both, faces[: len(ball.faces)]) > 0.0
    assert (faces[len(ball.faces) :] == joined(ball, room).faces[len(ball.faces) :]).all()


def test_a_moebius_band_ends() -> None:
    """Nothing can be agreed on all the way round: any answer will do, and there is one."""
    n = 40
    t = 2.0 * math.pi * np.arange(n) / n
    out = np.stack([np.cos(t / 2) * np.cos(t), np.cos(t / 2) * np.sin(t), np.sin(t / 2)], axis=1)
    middle = np.stack([np.cos(t), np.sin(t), np.zeros(n)], axis=1)
    vertices = np.concatenate([middle - 0.3 * out, middle + 0.3 * out])
    faces = []
    for k in range(n):
        a, b = k, k + n
        c, d = ((k + 1), (k + 1) + n) if k + 1 < n else (n, 0)  # the seam: sides change over
        faces += [(a, c, b), (b, c, d)]
    band = Triangles(vertices, np.array(faces, np.int32))
    assert sorted(map(sorted, oriented(band).tolist())) == sorted(map(sorted, band.faces.tolist()))


def test_fins_agree_with_nobody() -> None:
    """Three faces at one edge: each keeps the winding it has."""
    vertices = np.array([(0, 0, 0), (0, 0, 1), (1, 0, 0), (-1, 0.5, 0), (-1, -0.5, 0.0)])
    fins = Triangles(vertices, np.array([(0, 1, 2), (0, 1, 3), (1, 0, 4)], np.int32))
    assert (oriented(fins) == fins.faces).all()


def test_the_order_of_faces_does_not_matter() -> None:
    ball = mixed(icosphere(2), 0.4)
    order = np.random.default_rng(1).permutation(len(ball.faces))
    one = oriented(ball)
    other = oriented(Triangles(ball.vertices, ball.faces[order]))
    assert math.isclose(volume(ball, one), volume(ball, other), rel_tol=1e-12)


def test_a_large_body_far_away_is_told_inside_from_outside() -> None:
    ball = moved(icosphere(2), 1.0, (1e6, -1e6, 1e6))
    faces = oriented(mixed(ball, 0.5))
    centred = Triangles(ball.vertices - (1e6, -1e6, 1e6), ball.faces)
    assert volume(centred, faces) > 0.0

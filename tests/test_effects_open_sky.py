"""Points that everything lies below are 1 without a ray, and only those."""

from __future__ import annotations

import numpy as np
import pytest

from aobake import BakedVertices, BakeSettings, Scene, bake_texture, bake_vertices, visibility
from tests.scenes import (
    TURNED,
    Triangles,
    box,
    flipped,
    floor,
    icosphere,
    joined,
    moved,
    unwelded,
)

ON, OFF = ("open_sky=on",), ("open_sky=off",)


def baked(mesh: Triangles, effect: tuple[str, ...] = (), **settings: object) -> BakedVertices:
    return bake_vertices(
        Scene.from_arrays(*mesh),
        BakeSettings(rays=256, effect=effect, **settings),  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("mesh", [icosphere(3), moved(icosphere(3), 1e6 * TURNED, 1e7)])
def test_a_convex_body_needs_no_ray(mesh: Triangles) -> None:
    found = baked(mesh)
    assert found.rays == 0
    assert (found.ao[0] == 1.0).all()
    assert not found.standard_error[0].any()
    assert f"{len(mesh.vertices)} of {len(mesh.vertices)}" in found.plan.effects["open_sky"].reason
    assert baked(mesh, OFF).rays == 256 * len(mesh.vertices)


@pytest.mark.parametrize(
    "mesh",
    [
        joined(icosphere(3), moved(icosphere(3), 0.5, (1.2, 0.3, 0.0))),
        moved(joined(unwelded(box()), moved(floor(2.0, -0.5, 8))), TURNED, (3.0, 2.0, 1.0)),
        joined(floor(0.5, 0.0, 6), flipped(floor(0.5, 1e-6))),
        joined(floor(1.0, 0.0, 4), moved(box(), 1e-7, (0.0, 0.0, 0.5e-7))),
    ],
    ids=["balls", "box on a plate", "close plates", "a grain on a plate"],
)
def test_what_is_told_is_what_would_be_traced(mesh: Triangles) -> None:
    told, traced = baked(mesh, ON), baked(mesh, OFF)
    skipped = (told.standard_error[0] == 0.0) & (traced.standard_error[0] > 0.0)
    assert (told.ao[0][skipped] == 1.0).all()
    assert (traced.ao[0][skipped] == 1.0).all()
    rest = ~skipped
    assert np.array_equal(told.ao[0][rest], traced.ao[0][rest])


def test_the_underside_of_a_box_that_stands_on_a_plate_is_not_open() -> None:
    """Everything lies below its plane, and yet it sees nothing."""
    mesh = joined(unwelded(box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))), floor(4.0, 0.0, 9))
    found = baked(mesh, ON)
    under = (mesh.vertices[:36, 2] == 0.0) & (bottoms(mesh)[:36])
    assert under.any()
    assert found.ao[0][:36][under].max() < 0.5


def bottoms(mesh: Triangles) -> np.ndarray:
    """(V,) the vertices of faces that look straight down."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    down = np.cross(b - a, c - a)[:, 2] < -1e-9
    marks = np.zeros(len(mesh.vertices), bool)
    marks[mesh.faces[down].reshape(-1)] = True
    return marks


def test_over_a_ground_every_point_is_traced() -> None:
    found = baked(icosphere(2), ON, ground="+z")
    assert found.rays == 256 * len(icosphere(2).vertices)
    assert not found.plan.effects["open_sky"].on


def test_where_few_points_are_open_nothing_is_looked_for() -> None:
    bowl = flipped(icosphere(3))
    found = baked(
        Triangles(bowl.vertices, bowl.faces[bowl.vertices[bowl.faces, 2].max(axis=1) < 0.5])
    )
    assert not found.plan.effects["open_sky"].on
    assert "does not pay" in found.plan.effects["open_sky"].reason


def test_towards_a_tolerance_open_points_cost_nothing_either() -> None:
    found = baked(
        joined(icosphere(3), moved(icosphere(2), 0.2, (1.5, 0.0, 0.0))), ON, tolerance=0.01
    )
    off = baked(
        joined(icosphere(3), moved(icosphere(2), 0.2, (1.5, 0.0, 0.0))), OFF, tolerance=0.01
    )
    assert found.rays < 0.8 * off.rays
    # Not the same bytes: points next to each other tell each other how many rays they need.
    allowed = 4.0 * np.hypot(found.standard_error[0], off.standard_error[0])
    assert (np.abs(found.ao[0] - off.ao[0]) <= allowed + 1e-6).all()


def test_points_inside_the_faces_of_a_coarse_ball_are_open() -> None:
    ball = icosphere(1)
    middle = ball.vertices[ball.faces].mean(axis=1)
    a, b, c = (ball.vertices[ball.faces[:, k]] for k in range(3))
    front = np.cross(b - a, c - a)
    found = visibility(
        Scene.from_arrays(*ball), middle, middle, BakeSettings(effect=ON), geometric_normals=front
    )
    assert (found.mean == 1.0).all()
    assert not found.rays.any()


def test_texels_of_a_convex_body_need_no_ray() -> None:
    found = bake_texture(Scene.from_arrays(*icosphere(2)), BakeSettings(size=64, denoise="off"))
    assert found.rays == 0
    assert (found.image == 1.0).all()


def test_nothing_but_an_open_plate_is_open() -> None:
    found = baked(floor(1.0, 0.0, 4), ON)
    assert (found.ao[0] == 1.0).all()

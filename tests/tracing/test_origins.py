"""Where rays start: in contact, in corners, in gaps, on creases; in any attitude."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake import BakeSettings, Scene, bake_vertices, visibility
from aobake.tracing.origins import ENCLOSED, PLAIN
from tests.known import rectangle_factor, wall_factor
from tests.scenes import (
    TURNED,
    UP,
    FloatArray,
    Triangles,
    box,
    flipped,
    floor,
    icosphere,
    joined,
    moved,
    patch,
    unit,
    unwelded,
)
from tests.tracing.rays import placed, world_of

RAYS = 1024
NOISE = 0.02  # most that one of a few hundred estimates is off: 4 standard errors of 4e-3
CORNER = 0.5 * (1.0 - 1.0 / math.sqrt(3.0))  # over a plane, looking (1, 1, -1): (1 + cos) / 2
UNIT_BOX = box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
NARROW = "a gap of a few ulps pushes the origin sideways, past the rim"
SLIVERS = (
    "an origin beside a convex edge is put behind the next face, whose slivers float32 cannot tell"
)


def attitudes(count: int = 5) -> list[FloatArray]:
    """The axes, and some rotations without their luck."""
    rng = np.random.default_rng(1)
    turns = [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(count - 2)]
    return [np.eye(3), TURNED, *(turn * np.sign(np.linalg.det(turn)) for turn in turns)]


def baked(
    mesh: Triangles, turn: FloatArray, normals: FloatArray | None = None
) -> NDArray[np.float32]:
    turned = None if normals is None else normals @ turn.T
    scene = Scene.from_arrays(*moved(mesh, turn), normals=turned)
    return bake_vertices(scene, BakeSettings(rays=RAYS)).ao[0]


def fronts(mesh: Triangles) -> FloatArray:
    """(3 F, 3) unit normal of the face of each corner."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    n = np.cross(b - a, c - a)
    return np.asarray(np.repeat(n / np.linalg.norm(n, axis=1)[:, None], 3, axis=0))


GROUNDS = {
    "two triangles": floor(4.0),
    "a grid": floor(4.0, 0.0, 16),
    "a grid that meets no corner": moved(floor(4.0, 0.0, 7), 1.0, (0.13, 0.07, 0.0)),
    "a thick slab": box((-4.0, -4.0, -1.0), (4.0, 4.0, 0.0)),
    "two large triangles": floor(50.0),
    "a large slab": box((-50.0, -50.0, -1.0), (50.0, 50.0, 0.0)),
    "two huge triangles": floor(1000.0),
    "a huge slab": box((-1000.0, -1000.0, -1.0), (1000.0, 1000.0, 0.0)),
    "a grid with the box's own corners": floor(4.0, 0.0, 8),
}


# -- a box on its ground --------------------------------------------------------------------------


@pytest.mark.parametrize("name", GROUNDS)
def test_the_lower_corners_of_a_welded_box_see_what_their_bisector_sees(name: str) -> None:
    mesh = joined(UNIT_BOX, GROUNDS[name])
    for turn in attitudes():
        assert np.abs(baked(mesh, turn)[:4] - CORNER).max() < NOISE


@pytest.mark.parametrize("name", GROUNDS)
def test_the_lower_corners_can_be_asked_for_as_points(name: str) -> None:
    mesh = joined(UNIT_BOX, GROUNDS[name])
    for turn in attitudes():
        scene = Scene.from_arrays(*moved(mesh, turn))
        normal = turn @ unit((1.0, 1.0, -1.0))
        estimate = visibility(
            scene,
            np.tile(turn @ (1.0, 1.0, 0.0), (8, 1)),
            np.tile(normal, (8, 1)),
            BakeSettings(rays=RAYS),
        )
        assert np.abs(estimate.mean - CORNER).max() < NOISE


@pytest.mark.parametrize("name", GROUNDS)
def test_at_split_corners_walls_see_half_and_the_bottom_nothing(name: str) -> None:
    own = unwelded(UNIT_BOX)
    mesh, normals = joined(own, GROUNDS[name]), fronts(UNIT_BOX)
    low = np.flatnonzero(own.vertices[:, 2] == 0.0)
    exact = np.where(normals[low, 2] < -0.5, 0.0, 0.5)
    for turn in attitudes():
        assert np.abs(baked(mesh, turn)[low] - exact).max() < NOISE


@pytest.mark.parametrize("hover", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("name", ["two triangles", "a grid", "a thick slab"])
def test_a_box_that_hovers_closely_is_as_open_as_one_that_stands(name: str, hover: float) -> None:
    mesh = joined(moved(UNIT_BOX, 1.0, (0.0, 0.0, hover)), GROUNDS[name])
    for turn in attitudes(4):
        assert np.abs(baked(mesh, turn)[:4] - CORNER).max() < NOISE


@pytest.mark.parametrize("depth", [1e-3, 1e-4, 1e-5])
def test_what_is_sunk_into_a_slab_sees_nothing_and_under_a_sheet_the_other_side(
    depth: float,
) -> None:
    sunk = moved(UNIT_BOX, 1.0, (0.0, 0.0, -depth))
    for turn in attitudes(4):
        assert baked(joined(sunk, GROUNDS["a thick slab"]), turn)[:4].max() < NOISE
        under = baked(joined(sunk, GROUNDS["two triangles"]), turn)[:4]
        assert np.abs(under - (1.0 - CORNER)).max() < NOISE


def test_what_is_sunk_by_an_ulp_stands_or_is_sunk() -> None:
    """1e-6 in a scene of size 8: either reading is right, anything else is not."""
    mesh = joined(moved(UNIT_BOX, 1.0, (0.0, 0.0, -1e-6)), GROUNDS["a thick slab"])
    for turn in attitudes(4):
        ao = baked(mesh, turn)[:4]
        assert (np.minimum(np.abs(ao - CORNER), ao) < NOISE).all()


def test_the_ground_at_the_foot_of_a_box_sees_past_it() -> None:
    """At a corner of the foot three quarters are open, along its edge one half, under it nothing."""
    ground = floor(2.0, 0.0, 8)
    mesh = joined(ground, box((0.0, 0.0, 0.0), (1.0, 1.0, 50.0)))
    x, y = ground.vertices[:, 0], ground.vertices[:, 1]
    inside = (x > 0.0) & (x < 1.0) & (y > 0.0) & (y < 1.0)
    corner = np.isin(x, (0.0, 1.0)) & np.isin(y, (0.0, 1.0))
    edge = np.isin(x, (0.0, 1.0)) & (y > 0.0) & (y < 1.0)
    for turn in attitudes():
        ao = baked(mesh, turn)[: len(x)]
        assert ao[inside].max() == 0.0
        assert np.abs(ao[corner] - 0.75).max() < NOISE
        assert np.abs(ao[edge] - 0.5).max() < NOISE


# -- rooms and creases ----------------------------------------------------------------------------


def open_room(cells: int) -> tuple[Triangles, FloatArray, FloatArray]:
    """A pit 1 x 2 x 0.8 of five unwelded sides; its mesh, exact values, and normals at the vertices.

    The values at the rims of walls are left undefined (NaN): there the opening begins.
    """
    w, d, h = 1.0, 2.0, 0.8
    bottom = patch((0, 0, 0), (w, 0, 0), (w, d, 0), (0, d, 0), cells, cells)
    near = patch((0, 0, 0), (0, d, 0), (0, d, h), (0, 0, h), cells, cells)
    far = patch((w, 0, 0), (w, 0, h), (w, d, h), (w, d, 0), cells, cells)
    left = patch((0, 0, 0), (0, 0, h), (w, 0, h), (w, 0, 0), cells, cells)
    right = patch((0, d, 0), (w, d, 0), (w, d, h), (0, d, h), cells, cells)
    exact, normals = [], []
    for part, (axis, length, across) in zip(
        (bottom, near, far, left, right),
        ((2, 0.0, 0.0), (0, d, w), (0, d, w), (1, w, d), (1, w, d)),
        strict=True,
    ):
        along = part.vertices[:, 1 - axis] if axis < 2 else part.vertices[:, 0]
        for (x, y, z), s in zip(part.vertices, along, strict=True):
            if axis == 2:
                value = sum(rectangle_factor(u, v, h) for u in (x, w - x) for v in (y, d - y))
            else:
                value = wall_factor(h - z, across, s, length - s) if h - z > 1e-9 else math.nan
            exact.append(value)
        normals.append(np.tile(fronts(part)[0], (len(part.vertices), 1)))
    mesh = joined(bottom, near, far, left, right)
    return mesh, np.array(exact), np.concatenate(normals)


@pytest.mark.parametrize("cells", [1, 4])
def test_every_vertex_of_a_pit_has_the_limit_of_its_own_side(cells: int) -> None:
    """In the middle of walls, at their feet, in edges and corners: the formulas hold up to the crease."""
    mesh, exact, _ = open_room(cells)
    known = np.isfinite(exact)
    for turn in attitudes():
        assert np.abs(baked(mesh, turn)[known] - exact[known]).max() < NOISE


def test_the_foot_of_a_high_wall_is_half_and_the_corner_of_two_a_quarter_open() -> None:
    high = 1e3
    mesh = joined(
        patch((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), 2, 2),
        patch((0, -1, 0), (0, high, 0), (0, high, high), (0, -1, high)),
    )
    corner = joined(mesh, patch((-1, 0, 0), (-1, 0, high), (high, 0, high), (high, 0, 0)))
    for turn in attitudes():
        assert abs(float(baked(mesh, turn)[1]) - 0.5) < NOISE  # at x = 0, y = 1/2
        assert abs(float(baked(corner, turn)[0]) - 0.25) < NOISE


@pytest.mark.parametrize("degrees", [20.0, 60.0, 90.0, 120.0, 170.0])
def test_on_a_crease_the_bisector_sees_the_sine_of_half_the_angle(degrees: float) -> None:
    phi, far = math.radians(degrees), 200.0
    side = np.array([0.0, 0.0, far])
    walls = [np.array([far * math.cos(a), far * math.sin(a), 0.0]) for a in (0.0, phi)]
    vertices = np.array(
        [
            -side,
            (0.0, 0.0, 0.0),
            side,
            walls[0] - side,
            walls[0] + side,
            walls[1] - side,
            walls[1] + side,
        ]
    )
    faces = np.array([(3, 1, 0), (3, 4, 1), (4, 2, 1), (0, 1, 5), (1, 6, 5), (1, 2, 6)], np.int32)
    normal = np.array([math.cos(phi / 2.0), math.sin(phi / 2.0), 0.0])
    normals = np.tile(normal, (7, 1))
    for turn in attitudes():
        value = float(baked(Triangles(vertices, faces), turn, normals)[1])
        assert abs(value - math.sin(phi / 2.0)) < NOISE


# -- bodies that are open all over ----------------------------------------------------------------


@pytest.mark.parametrize("name", ["welded box", "split box", "sphere", "tetrahedron", "spike"])
def test_a_convex_body_is_open_at_every_vertex(name: str) -> None:
    tetrahedron = Triangles(
        np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]),
        np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]], np.int32),
    )
    bodies = {
        "welded box": UNIT_BOX,
        "split box": unwelded(UNIT_BOX),
        "sphere": icosphere(2),
        "tetrahedron": tetrahedron,
        "spike": moved(tetrahedron, np.diag([1e-4, 1e-4, 1.0])),
    }
    for turn in attitudes():
        assert baked(bodies[name], turn).min() == 1.0


def test_two_boxes_in_contact_see_past_each_other() -> None:
    """Side by side: the faces that touch see nothing; at the seam on top all is open."""
    own = unwelded(UNIT_BOX)
    both = joined(own, moved(own, 1.0, (1.0, 0.0, 0.0)))
    normals = np.concatenate([fronts(UNIT_BOX), fronts(UNIT_BOX)])
    second = np.arange(len(both.vertices)) >= len(own.vertices)
    touching = (both.vertices[:, 0] == 1.0) & (np.abs(normals[:, 0]) > 0.5)
    touching &= (normals[:, 0] > 0.0) != second
    for turn in attitudes():
        ao = baked(both, turn)
        assert ao[touching].max() == 0.0
        assert ao[~touching].min() > 1.0 - NOISE


# -- gaps and shells ------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [1e-3, 1e-4, 1e-5, 1e-6])
def test_between_close_plates_it_is_dark(gap: float) -> None:
    """Four corner rectangles: next to nothing inside."""
    lower = floor(0.5, 0.0, 6)
    inside = np.abs(lower.vertices[:, :2]).max(axis=1) < 0.49
    for turn in attitudes():
        ao = baked(joined(lower, flipped(floor(0.5, gap))), turn)[: len(lower.vertices)]
        assert ao[inside].max() < 2e-3


@pytest.mark.parametrize(
    "gap",
    [1e-3, 1e-4, 1e-5, pytest.param(1e-6, marks=pytest.mark.xfail(strict=True, reason=NARROW))],
)
def test_at_the_rims_of_close_plates_half_is_open(gap: float) -> None:
    lower = floor(0.5, 0.0, 6)
    x, y = np.abs(lower.vertices[:, :2]).T
    for turn in attitudes():
        ao = baked(joined(lower, flipped(floor(0.5, gap))), turn)[: len(lower.vertices)]
        assert np.abs(ao[(x > 0.49) & (y < 0.49)] - 0.5).max() < NOISE


@pytest.mark.parametrize("thickness", [1e-3, 1e-4, 1e-5, 1e-6])
def test_a_thin_shell_is_open_outside_and_dark_inside(thickness: float) -> None:
    outer = icosphere(2)
    mesh = joined(outer, flipped(moved(outer, 1.0 - thickness)))
    for turn in attitudes(3):
        ao = baked(mesh, turn)
        assert ao[: len(outer.vertices)].min() == 1.0
        assert ao[len(outer.vertices) :].max() == 0.0


@pytest.mark.parametrize(
    "thickness",
    [
        1e-2,
        1e-3,
        1e-4,
        1e-5,
        pytest.param(1e-6, marks=pytest.mark.xfail(strict=True, reason=SLIVERS)),
    ],
)
def test_a_thin_plate_is_open_on_both_sides(thickness: float) -> None:
    plate = box((-1.0, -1.0, 0.0), (1.0, 1.0, thickness))
    for mesh in (plate, unwelded(plate)):
        for turn in attitudes():
            assert baked(mesh, turn).min() > 1.0 - 1e-2


@pytest.mark.xfail(strict=True, reason=SLIVERS)
def test_a_thin_plate_is_convex_and_so_open_to_the_last_ray() -> None:
    plate = box((-1.0, -1.0, 0.0), (1.0, 1.0, 1e-4))
    for mesh in (plate, unwelded(plate)):
        for turn in attitudes():
            assert baked(mesh, turn).min() == 1.0


def test_no_origin_leaves_the_box_it_stands_in() -> None:
    """Into the corners of a closed room no normal may lead outside, wherever the room is."""
    room = unwelded(flipped(UNIT_BOX))
    for turn in attitudes(8):
        ao = baked(moved(room, 1.0, (3.0, -2.0, 7.0)), turn)
        assert ao.max() == 0.0


# -- what is found at a point ---------------------------------------------------------------------


def test_an_ordinary_point_is_plain_and_stays_where_it_is() -> None:
    mesh = icosphere(3)
    found = placed(world_of(mesh), mesh.vertices, mesh.vertices)
    assert (found.states == PLAIN).all()
    moved_by = np.linalg.norm(found.origins - mesh.vertices, axis=1)
    assert moved_by.min() > 0.0
    assert moved_by.max() < 2e-6


def test_a_face_on_a_face_is_enclosed() -> None:
    mesh = joined(unwelded(UNIT_BOX), floor(4.0))
    low = (fronts(UNIT_BOX)[:, 2] < -0.5).nonzero()[0]
    found = placed(world_of(mesh), mesh.vertices[low], np.tile(-UP, (len(low), 1)))
    assert (found.states == ENCLOSED).all()

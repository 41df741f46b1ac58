"""What float32 can hold: the frame of a scene, and the splitting of large triangles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aobake import BakeSettings, Scene, bake_vertices
from aobake.tracing.conditioning import (
    COARSER,
    FINEST,
    NEAR,
    detail_at_vertices,
    split_long_edges,
    unit_frame,
)
from tests.known import wall_factor
from tests.scenes import (
    TURNED,
    FloatArray,
    Triangles,
    box,
    floor,
    icosphere,
    joined,
    moved,
    patch,
    unit,
)


def split(mesh: Triangles, *others: Triangles) -> Triangles:
    """The mesh, split against its own detail and that of others."""
    sizes = [detail_at_vertices(m.vertices, m.faces.astype(np.uint32)) for m in (mesh, *others)]
    details = [m.vertices for m in (mesh, *others)]
    vertices, faces = split_long_edges(mesh.vertices, mesh.faces.astype(np.uint32), details, sizes)
    return Triangles(vertices, faces.astype(np.int32))


def area(mesh: Triangles) -> FloatArray:
    """(3,) vector area."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return np.asarray(0.5 * np.cross(b - a, c - a).sum(axis=0))


def open_edges(mesh: Triangles) -> int:
    """Edges that are not run along once in each direction."""
    sides = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    there = {(int(a), int(b)) for a, b in sides}
    return sum((b, a) not in there for a, b in there)


# -- the frame ------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-300, 1e-9, 1.0, 3.7, 1e9, 1e150])
def test_a_frame_brings_a_scene_to_unit_size(scale: float) -> None:
    points = scale * icosphere(2).vertices
    frame = unit_frame([points])
    largest = float(np.abs(frame.apply(points)).max())
    assert 0.4 <= largest <= 1.0
    assert math.frexp(frame.scale)[0] == 0.5  # a power of two: nothing is rounded


def test_far_clutter_does_not_move_the_middle_away_from_the_detail() -> None:
    detail, ground = icosphere(3), moved(floor(1e6), 1.0, (7e5, 0.0, 0.0)).vertices
    frame = unit_frame([detail.vertices, ground])
    assert float(np.abs(frame.center).max()) < 1.0


@pytest.mark.parametrize(
    "parts", [[], [np.zeros((0, 3))], [np.zeros((5, 3))], [np.full((1, 3), 3.0)]]
)
def test_nothing_and_a_single_place_have_a_frame_as_well(parts: list[FloatArray]) -> None:
    frame = unit_frame(parts)
    assert frame.scale > 0.0
    assert np.isfinite(frame.center).all()
    assert np.isfinite(frame.apply(np.ones((2, 3)))).all()


# -- splitting ------------------------------------------------------------------------------------


def test_an_ordinary_mesh_stays_the_very_arrays_it_was() -> None:
    mesh = icosphere(3)
    faces = mesh.faces.astype(np.uint32)
    sizes = [detail_at_vertices(mesh.vertices, faces)]
    vertices, same = split_long_edges(mesh.vertices, faces, [mesh.vertices], sizes)
    assert vertices is mesh.vertices
    assert same is faces


@pytest.mark.parametrize("half", [1e4, 1e6, 1e8])
@pytest.mark.parametrize("turned", [False, True])
def test_a_large_ground_is_fine_beside_detail_only(half: float, turned: bool) -> None:
    detail = moved(icosphere(2, 0.5), 1.0, (0.3, 0.2, 0.5))
    ground = moved(floor(half), TURNED if turned else 1.0)
    cut = split(ground, moved(detail, TURNED if turned else 1.0))
    assert 2 < len(cut.faces) < 20_000
    assert np.allclose(area(cut), area(ground), rtol=1e-12)
    lengths = np.linalg.norm(
        cut.vertices[cut.faces] - np.roll(cut.vertices[cut.faces], 1, axis=1), axis=2
    )
    near = np.linalg.norm(cut.vertices[cut.faces], axis=2).min(axis=1) < 1.0
    # The faces of the sphere are 0.18 wide; sizes of detail are told apart by a factor of COARSER.
    assert float(lengths[near].max()) < COARSER * FINEST * 0.18


@pytest.mark.parametrize("half", [1e5, 1e7])
def test_a_closed_body_that_is_split_stays_closed(half: float) -> None:
    slab = moved(box((-half, -half, -1.0), (half, half, 0.0)), TURNED)
    cut = split(slab, moved(icosphere(2, 0.1), 1.0, TURNED @ (0.0, 0.0, 0.2)))
    assert len(cut.faces) > 12
    assert open_edges(cut) == 0
    assert np.abs(area(cut)).max() < 1e-9 * half**2


def test_needles_are_split_without_slivers_that_have_no_plane() -> None:
    """A fan of needles around a hole, as wide as a city: every part of it still faces down."""
    segments, half = 64, 1e5
    t = 2.0 * math.pi * np.arange(segments) / segments
    inner, outer = (
        np.column_stack([r * np.cos(t), r * np.sin(t), np.zeros(segments)]) for r in (0.5, half)
    )
    i = np.arange(segments)
    j = (i + 1) % segments
    faces = np.concatenate(
        [np.stack([i, j, i + segments], 1), np.stack([j, j + segments, i + segments], 1)]
    )
    fan = moved(Triangles(np.concatenate([inner, outer]), faces.astype(np.int32)), TURNED)
    cut = split(fan, moved(floor(0.1), TURNED))
    a, b, c = cut.vertices[cut.faces].transpose(1, 0, 2)
    fronts = np.cross(b - a, c - a)
    length = np.linalg.norm(fronts, axis=1)
    assert len(cut.faces) > len(fan.faces)
    assert float(length.min()) > 0.0
    assert np.abs(fronts / length[:, None] @ TURNED[:, 2] + 1.0).max() < 1e-6


def test_zero_area_and_nothing_are_no_detail() -> None:
    flat = Triangles(
        np.array([(0, 0, 0), (1, 0, 0), (0, 0, 0.0)]), np.array([(0, 1, 2), (0, 2, 0)], np.int32)
    )
    sizes = detail_at_vertices(flat.vertices, flat.faces.astype(np.uint32))
    assert np.isfinite(sizes).all()
    vertices, faces = split_long_edges(np.zeros((0, 3)), np.zeros((0, 3), np.uint32), [], [])
    assert (len(vertices), len(faces)) == (0, 0)


def test_a_tiny_edge_on_a_large_ground_does_not_split_it_without_end() -> None:
    """Detail of 1e-12 beside 1e6 is lost in float32 all the same."""
    speck = moved(icosphere(0), 1e-12, (0.1, 0.2, 0.0))
    cut = split(floor(1e6), speck, icosphere(1))
    assert len(cut.faces) < 250_000


def distance(point: FloatArray, corners: FloatArray) -> FloatArray:
    """(F,) from a point to triangles (F, 3, 3)."""
    nearest = np.full(len(corners), np.inf)
    a, b, c = corners.transpose(1, 0, 2)
    for p, q in ((a, b), (b, c), (c, a)):
        t = ((point - p) * (q - p)).sum(axis=1) / ((q - p) ** 2).sum(axis=1)
        foot = p + np.clip(t, 0.0, 1.0)[:, None] * (q - p)
        nearest = np.minimum(nearest, np.linalg.norm(foot - point, axis=1))
    front = np.cross(b - a, c - a)
    above = ((point - a) * front).sum(axis=1) / np.linalg.norm(front, axis=1)
    sides = [(np.cross(q - p, point - p) * front).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))]
    within = np.min(sides, axis=0) >= 0.0
    return np.where(within, np.minimum(nearest, np.abs(above)), nearest)


@pytest.mark.parametrize("height", [0.0, 1e-2, 1e3])
@pytest.mark.parametrize("seed", range(6))
def test_a_face_is_fine_beside_a_point_in_its_midst(height: float, seed: int) -> None:
    """Whatever the shape of the face and the place on it, as a vertex there would have it."""
    rng = np.random.default_rng(seed)
    corners = 1e6 * rng.normal(size=(3, 3)) * rng.uniform(0.01, 1.0, (1, 3))
    front = unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    corners -= rng.dirichlet(np.ones(3)) @ corners + height * front  # the point is at the origin
    size = 0.01
    vertices, faces = split_long_edges(
        corners, np.array([(0, 1, 2)], np.uint32), [np.zeros((1, 3))], [np.full(1, size)]
    )
    parts = vertices[faces]
    longest = np.linalg.norm(parts - np.roll(parts, 1, axis=1), axis=2).max(axis=1)
    allowed = COARSER * FINEST * size + NEAR * distance(np.zeros(3), parts)
    assert (longest <= 1.001 * allowed).all()
    assert len(faces) < 500


# -- what it is for -------------------------------------------------------------------------------


def cube_on(half: float, shift: FloatArray) -> tuple[Triangles, int]:
    """A gridded side of a cube, the cube, and a ground of two triangles that is shifted under it."""
    side = patch((0.5, -0.5, 0), (0.5, 0.5, 0), (0.5, 0.5, 1), (0.5, -0.5, 1), 6, 6)
    rest = box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0), without=("+x",))
    return joined(side, rest, moved(floor(half), 1.0, shift)), len(side.vertices)


@pytest.mark.parametrize("half", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("off", [0.0, 0.6])
def test_a_wall_on_a_ground_as_wide_as_a_country_sees_half(half: float, off: float) -> None:
    mesh, count = cube_on(half, np.array([off * half, -0.3 * off * half, 0.0]))
    inner = [i * 7 + j for i in range(1, 6) for j in range(1, 6)]
    for turn in (np.eye(3), TURNED):
        scene = Scene.from_arrays(*moved(mesh, turn))
        ao = bake_vertices(scene, BakeSettings(rays=1024)).ao[0][:count][inner]
        assert np.abs(ao - 0.5).max() < 0.02 + 2.0 / half
        assert abs(float(ao.mean()) - 0.5) < 3e-3 + 2.0 / half


@pytest.mark.parametrize("scale", [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9])
def test_the_size_of_a_scene_does_not_matter(scale: float) -> None:
    mesh = moved(joined(floor(2.0, 0.0, 10), box((0.1, 0.1, 0.0), (0.9, 0.7, 0.8))), TURNED)
    settings = BakeSettings(rays=256)
    one = bake_vertices(Scene.from_arrays(*mesh), settings)
    other = bake_vertices(Scene.from_arrays(*moved(mesh, scale)), settings)
    assert np.abs(one.ao[0] - other.ao[0]).max() <= 0.03
    assert float(np.abs(one.ao[0] - other.ao[0]).mean()) < 1e-3


@pytest.mark.parametrize("offset", [1e3, 1e5, 1e7])
def test_the_place_of_a_scene_does_not_matter(offset: float) -> None:
    """Up to 1e7 sizes from the origin float64 still tells 2e-9 of the size."""
    mesh = moved(joined(floor(2.0, 0.0, 10), box((0.1, 0.1, 0.0), (0.9, 0.7, 0.8))), TURNED)
    settings = BakeSettings(rays=256)
    one = bake_vertices(Scene.from_arrays(*mesh), settings)
    shifted = moved(mesh, 1.0, offset * np.array([1.0, -1.0, 0.7]))
    other = bake_vertices(Scene.from_arrays(*shifted), settings)
    assert np.abs(one.ao[0] - other.ao[0]).max() <= 0.05
    assert float(np.abs(one.ao[0] - other.ao[0]).mean()) < 2e-3


def test_a_fine_patch_beside_a_cube_is_exact_on_a_wide_ground() -> None:
    """The ground of the patch goes on for 1e5 units; its value is that of the wall beside it."""
    far = 1e5
    fine = patch((0.5, -0.5, 0), (1.5, -0.5, 0), (1.5, 0.5, 0), (0.5, 0.5, 0), 6, 6)
    cube = box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))
    frame = [
        patch((1.5, -far, 0), (far, -far, 0), (far, far, 0), (1.5, far, 0)),
        patch((-far, -far, 0), (0.5, -far, 0), (0.5, far, 0), (-far, far, 0)),
        patch((0.5, -far, 0), (1.5, -far, 0), (1.5, -0.5, 0), (0.5, -0.5, 0)),
        patch((0.5, 0.5, 0), (1.5, 0.5, 0), (1.5, far, 0), (0.5, far, 0)),
    ]
    inner = np.array([i * 7 + j for i in range(1, 6) for j in range(1, 6)])
    x, y = fine.vertices[inner, :2].T
    exact = [1.0 - wall_factor(u - 0.5, 1.0, v + 0.5, 0.5 - v) for u, v in zip(x, y, strict=True)]
    for turn in (np.eye(3), TURNED):
        mesh = moved(joined(fine, cube, *frame), turn)
        ao = bake_vertices(Scene.from_arrays(*mesh), BakeSettings(rays=1024)).ao[0][inner]
        assert np.abs(ao - exact).max() < 0.02
        assert abs(float((ao - exact).mean())) < 2e-3

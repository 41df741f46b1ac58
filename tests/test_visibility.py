"""visibility(): closed forms, the honesty of its error, what it takes and what it refuses."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from aobake import BakeSettings, Estimate, InputError, Scene, bake_vertices, visibility
from aobake.settings import Falloff
from tests.known import Known, known_scenes, plane_with_falloff
from tests.scenes import (
    ORIGIN,
    TURNED,
    UP,
    FloatArray,
    box,
    flipped,
    floor,
    hexagon_around,
    icosphere,
    joined,
    moved,
    unit,
)

COPIES = 64  # estimates of one point; each has directions of its own
ROUNDING = 1e-6  # the result is float32

SCENES = {known.name: known for known in known_scenes()}


@functools.cache
def estimated(name: str, rays: int) -> Estimate:
    return asked(SCENES[name], rays, COPIES)


def asked(known: Known, rays: int, copies: int) -> Estimate:
    return visibility(
        Scene.from_arrays(*known.mesh),
        np.tile(known.point, (copies, 1)),
        np.tile(known.normal, (copies, 1)),
        BakeSettings(rays=rays, max_distance=known.max_distance, falloff=known.falloff),
    )


@pytest.mark.parametrize("name", SCENES)
def test_the_mean_is_the_closed_form(name: str) -> None:
    """The error of the mean over independent turns is a fraction of one estimate's: bias shows."""
    known, estimate = SCENES[name], estimated(name, 1024)
    allowed = 4.0 * rms(estimate.standard_error) / math.sqrt(COPIES) + known.facets + ROUNDING
    assert abs(float(estimate.mean.mean(dtype=np.float64)) - known.openness) <= allowed


# In a tip a piece of surface would cut into the walls; in a room it has no business of its own.
@pytest.mark.parametrize("name", sorted(SCENES.keys() - {"tip of a corner", "closed room"}))
def test_a_vertex_has_the_value_of_its_point(name: str) -> None:
    """A small piece of surface lies under the point; the value is that of the point itself."""
    known = SCENES[name]
    mesh = joined(hexagon_around(known.point, known.normal, 0.02), known.mesh)
    settings = BakeSettings(rays=1024, max_distance=known.max_distance, falloff=known.falloff)
    baked = bake_vertices(Scene.from_arrays(*mesh), settings)
    allowed = 4.0 * float(baked.standard_error[0][0]) + known.facets + ROUNDING
    assert abs(float(baked.ao[0][0]) - known.openness) <= allowed


@pytest.mark.parametrize("rays", [16, 64, 256, 1024])
def test_the_standard_error_is_honest(rays: int) -> None:
    """99 % of the values lie within four of them, and on average they are not five times too wide."""
    within, widths = [], []
    for name, known in SCENES.items():
        estimate = estimated(name, rays)
        error = np.abs(estimate.mean.astype(np.float64) - known.openness) - known.facets
        within.append(error <= 4.0 * estimate.standard_error + ROUNDING)
        if known.facets < 3e-5 and rms(error) > 1e-5:
            widths.append(rms(estimate.standard_error) / rms(error))
    assert np.mean(within) >= 0.99
    assert np.mean(within, axis=1).min() >= 0.95  # in each scene, too
    assert 0.8 <= math.exp(float(np.mean(np.log(widths)))) <= 5.0


def test_a_point_where_all_rays_agree_is_not_exact() -> None:
    """An occluder that no ray meets leaves an error behind: it is said to be there."""
    small = moved(icosphere(1), 0.01, (0.0, 0.0, 1.0))
    estimate = visibility(Scene.from_arrays(*small), [ORIGIN], [UP], BakeSettings(rays=64))
    assert 0.0 < float(estimate.standard_error[0]) < 0.1


def test_the_error_falls_faster_than_that_of_random_rays() -> None:
    """rays^-0.75 on the mean of the scenes; random rays would reach rays^-0.5."""
    few, many = (
        np.mean([rms(estimated(n, rays).mean - known.openness) for n, known in SCENES.items()])
        for rays in (64, 1024)
    )
    assert math.log(float(few / many)) / math.log(16.0) > 0.6


@pytest.mark.parametrize("seed", [0, 1])
def test_the_mean_does_not_depend_on_the_attitude_of_the_scene(seed: int) -> None:
    known = SCENES["floor of a pit"]
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    scene = Scene.from_arrays(*moved(known.mesh, turn))
    points, normals = (
        np.tile(known.point @ turn.T, (64, 1)),
        np.tile(known.normal @ turn.T, (64, 1)),
    )
    estimate = visibility(scene, points, normals, BakeSettings(rays=1024))
    bound = 4.0 * rms(estimate.standard_error) / 8.0 + ROUNDING
    assert abs(float(estimate.mean.mean(dtype=np.float64)) - known.openness) <= bound


# -- ground, falloff, geometric normals -----------------------------------------------------------


@pytest.mark.parametrize("axis", ["+y", "+z"])
def test_a_convex_body_on_the_ground_sees_what_the_horizon_leaves(axis: str) -> None:
    """(1 + n.up) / 2 at every vertex; at the lowest one the ground closes everything."""
    ball = icosphere(2)
    up = "xyz".index(axis[1])
    settings = BakeSettings(rays=1024, ground="+y" if axis == "+y" else "+z")
    baked = bake_vertices(Scene.from_arrays(*ball), settings)
    error = np.abs(baked.ao[0] - 0.5 * (1.0 + ball.vertices[:, up]))
    # The normals are those of the facets around a vertex: within half a degree of the sphere's.
    assert (error <= 4.0 * baked.standard_error[0] + 5e-3).all()


def test_an_upright_wall_on_the_ground_sees_half() -> None:
    baked = bake_vertices(
        Scene.from_arrays(*box(), normals=np.tile([1.0, 0.0, 0.0], (8, 1))),
        BakeSettings(rays=1024, ground="+z"),
    )
    right = box().vertices[:, 0] > 0.0
    assert np.abs(baked.ao[0][right] - 0.5).max() <= 4.0 * float(baked.standard_error[0].max())


@pytest.mark.parametrize("falloff", ["none", "linear", "smooth"])
@pytest.mark.parametrize("height", [0.2, 0.9, 1.5])
def test_the_ground_fades_as_a_mesh_does(falloff: Falloff, height: float) -> None:
    """A plate that looks down from a height, over the tip of a spike that puts the ground in place."""
    spike = moved(icosphere(0), 1e-3, (50.0, 0.0, 1e-3 + 1e-9))
    lowest = float(spike.vertices[:, 2].min())
    scene = Scene.from_arrays(*spike)
    points = np.tile((0.0, 0.0, height + lowest), (COPIES, 1))
    settings = BakeSettings(rays=1024, max_distance=1.0, falloff=falloff, ground="+z")
    estimate = visibility(scene, points, np.tile(-UP, (COPIES, 1)), settings)
    exact = plane_with_falloff(height, falloff)
    bound = 4.0 * rms(estimate.standard_error) / math.sqrt(COPIES) + 1e-5
    assert abs(float(estimate.mean.mean(dtype=np.float64)) - exact) <= bound


def test_below_a_coarse_face_nothing_counts() -> None:
    """Inside the faces of a smoothly shaded convex body everything is open; without the geometric
    normal the hemisphere dips below the face and gives (1 + cos d) / 2."""
    ball = icosphere(0)
    corners = ball.vertices[ball.faces]
    points = np.einsum("k,fkd->fd", [0.9, 0.07, 0.03], corners)
    smooth = points / np.linalg.norm(points, axis=1)[:, None]
    fronts = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    scene, settings = Scene.from_arrays(*moved(ball, TURNED)), BakeSettings(rays=1024)
    at, around, above = (x @ TURNED.T for x in (points, smooth, fronts))
    assert visibility(scene, at, around, settings, geometric_normals=above).mean.min() == 1.0
    naive = visibility(scene, at, around, settings)
    cosine = np.einsum("ij,ij->i", smooth, fronts) / np.linalg.norm(fronts, axis=1)
    assert (np.abs(naive.mean - 0.5 * (1.0 + cosine)) <= 4.0 * naive.standard_error).all()


# -- points on triangles that are large against their distance ------------------------------------


@pytest.mark.parametrize(
    "half",
    [1e1, 1e3, 1e5],
)
def test_a_point_inside_a_large_face_does_not_hide_behind_it(half: float) -> None:
    """The rounded face may lie on either side of the point; the offset knows how far."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        slanted = joined(floor(half), moved(box(), 1.0, (0.0, 0.0, -5.0)))
        scene = Scene.from_arrays(*moved(slanted, turn))
        points = np.column_stack([rng.uniform(-3.0, 3.0, (50, 2)), np.zeros(50)]) @ turn.T
        estimate = visibility(scene, points, np.tile(turn @ UP, (50, 1)), BakeSettings(rays=16))
        assert estimate.mean.min() == 1.0


@pytest.mark.parametrize(
    "half",
    [
        1e2,
        1e3,
        1e5,
        1e6,
    ],
)
def test_the_walls_of_a_trench_may_be_far_longer_than_it_is_wide(half: float) -> None:
    trench = flipped(box((0.0, -half, 0.0), (1.0, half, 0.8), without=("+z", "-y", "+y")))
    scene = Scene.from_arrays(*moved(trench, TURNED))
    x = 0.3
    exact = 0.5 * (x / math.hypot(x, 0.8) + (1.0 - x) / math.hypot(1.0 - x, 0.8))
    points = np.tile(TURNED @ (x, 0.0, 0.0), (COPIES, 1))
    estimate = visibility(scene, points, np.tile(TURNED @ UP, (COPIES, 1)), BakeSettings(rays=1024))
    bound = 4.0 * rms(estimate.standard_error) / math.sqrt(COPIES) + 2.0 / half**2
    assert abs(float(estimate.mean.mean(dtype=np.float64)) - exact) <= bound


# -- what it takes, and what it refuses -----------------------------------------------------------


def test_the_result_has_one_float32_per_point() -> None:
    estimate = visibility(
        Scene.from_arrays(*box()), np.zeros((5, 3)), np.tile(UP, (5, 1)), BakeSettings(rays=20)
    )
    assert estimate.mean.shape == estimate.standard_error.shape == estimate.rays.shape == (5,)
    assert estimate.mean.dtype == estimate.standard_error.dtype == np.float32
    assert np.issubdtype(estimate.rays.dtype, np.integer)
    assert (estimate.rays == 20).all()  # not 24: the lanes that fill up a packet do not count


@pytest.mark.parametrize("shape", [(0, 3), (0,)])
def test_no_points_give_empty_arrays(shape: tuple[int, ...]) -> None:
    estimate = visibility(Scene.from_arrays(*box()), np.zeros(shape), np.zeros(shape))
    assert estimate.mean.shape == estimate.standard_error.shape == estimate.rays.shape == (0,)


def test_an_empty_scene_is_open() -> None:
    empty = Scene.from_arrays(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    nothing = Scene(meshes=(), instances=())
    for scene in (empty, nothing):
        assert visibility(scene, [ORIGIN], [UP]).mean.tolist() == [1.0]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_point_that_is_not_finite_is_open_and_costs_nothing(bad: float) -> None:
    scene, settings = Scene.from_arrays(*box()), BakeSettings(rays=16)
    points = [[0.0, 0.0, 0.0], [bad, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    normals = [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, bad, 1.0], [0.0, 0.0, 0.0]]
    estimate = visibility(scene, points, normals, settings)
    assert estimate.mean.tolist() == [0.0, 1.0, 1.0, 1.0]
    assert estimate.rays.tolist() == [16, 0, 0, 0]


def test_a_normal_may_have_any_length() -> None:
    known = SCENES["wall"]
    scene = Scene.from_arrays(*known.mesh)
    values = [
        visibility(
            scene, [known.point], [size * known.normal], BakeSettings(rays=256)
        ).mean.tobytes()
        for size in (1.0, 1e-300, 1e300, 7.0)
    ]
    assert len(set(values)) == 1


def test_a_point_beside_unusable_ones_keeps_its_value() -> None:
    """The index of a point makes its directions its own, whatever stands beside it."""
    known = SCENES["wall"]
    scene, settings = Scene.from_arrays(*known.mesh), BakeSettings(rays=64)
    alone = visibility(scene, np.tile(known.point, (3, 1)), np.tile(known.normal, (3, 1)), settings)
    points = np.stack([np.full(3, np.nan), known.point, known.point])
    beside = visibility(scene, points, np.tile(known.normal, (3, 1)), settings)
    assert beside.mean[1:].tobytes() == alone.mean[1:].tobytes()


@pytest.mark.parametrize(
    ("positions", "normals", "geometric", "named"),
    [
        (np.zeros((4, 2)), np.zeros((4, 3)), None, "positions"),
        (np.zeros(3), np.zeros((1, 3)), None, "positions"),
        (np.zeros((4, 3)), np.zeros((3, 3)), None, "normals"),
        (np.zeros((4, 3)), np.zeros((4, 4)), None, "normals"),
        (np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((1, 3)), "geometric_normals"),
        ([["a", "b", "c"]], np.zeros((1, 3)), None, "positions"),
        ([[1.0, 2.0, 3.0], [1.0]], np.zeros((2, 3)), None, "positions"),
    ],
)
def test_arrays_of_another_shape_are_refused_by_name(
    positions: object, normals: object, geometric: object, named: str
) -> None:
    with pytest.raises(InputError) as caught:
        visibility(Scene.from_arrays(*box()), positions, normals, None, geometric)  # type: ignore[arg-type]
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_arrays_given_are_not_changed() -> None:
    points, normals = np.full((2, 3), 0.25), np.tile(3.0 * UP, (2, 1))
    before = points.tobytes(), normals.tobytes()
    visibility(Scene.from_arrays(*box()), points, normals, BakeSettings(rays=8))
    assert (points.tobytes(), normals.tobytes()) == before


def test_a_tilted_normal_sees_less_of_the_sky_over_a_plane() -> None:
    """(1 + cos t) / 2, from straight up to straight down."""
    tilts = np.linspace(0.0, math.pi, 9)
    normals = np.stack([unit((math.sin(t), 0.0, math.cos(t))) for t in tilts])
    scene = Scene.from_arrays(*floor(1e4, -1.0))
    estimate = visibility(scene, np.zeros((9, 3)), normals, BakeSettings(rays=4096))
    error = np.abs(estimate.mean - 0.5 * (1.0 + np.cos(tilts)))
    assert (error <= 4.0 * estimate.standard_error + 2e-4).all()


def rms(values: FloatArray | np.ndarray[tuple[int, ...], np.dtype[np.float32]]) -> float:
    """The root of the mean square."""
    return math.sqrt(float(np.mean(np.square(values, dtype=np.float64))))

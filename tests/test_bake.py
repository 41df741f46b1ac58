"""bake_vertices(): ugly meshes, findings, memory. Nothing may end in a traceback or a silent wrong number."""

from __future__ import annotations

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from aobake import BakedVertices, BakeSettings, Instance, Scene, bake_vertices, visibility
from tests.known import rectangle_factor
from tests.scenes import (
    TURNED,
    UP,
    FloatArray,
    IntArray,
    Triangles,
    affine,
    box,
    flipped,
    floor,
    icosphere,
    joined,
    mesh_of,
    moved,
    patch,
    unwelded,
)
from tests.support import ROOT

RAYS = 512
NOISE = 0.025


def baked(mesh: Triangles, normals: FloatArray | None = None, rays: int = RAYS) -> BakedVertices:
    return bake_vertices(Scene.from_arrays(*mesh, normals=normals), BakeSettings(rays=rays))


def sound(result: BakedVertices) -> bool:
    """Every vertex has a finite float32 value in [0, 1] and an error."""
    return all(
        ao.dtype == error.dtype == np.float32
        and ao.shape == error.shape
        and bool(np.isfinite(ao).all() and np.isfinite(error).all())
        and float(ao.min(initial=0.0)) >= 0.0
        and float(ao.max(initial=0.0)) <= 1.0
        for ao, error in zip(result.ao, result.standard_error, strict=True)
    )


def pit() -> tuple[Triangles, IntArray, FloatArray]:
    """An open pit in an attitude of its own, inner floor vertices, and how open they are."""
    w, d, h = 1.0, 2.0, 0.8
    bottom = patch((0, 0, 0), (w, 0, 0), (w, d, 0), (0, d, 0), 6, 8)
    walls = flipped(box((0.0, 0.0, 0.0), (w, d, h), without=("+z", "-z")))
    x, y = bottom.vertices[:, 0], bottom.vertices[:, 1]
    inner = np.flatnonzero((x > 0.0) & (x < w) & (y > 0.0) & (y < d))
    exact = [
        sum(rectangle_factor(u, v, h) for u in (a, w - a) for v in (b, d - b))
        for a, b in zip(x[inner], y[inner], strict=True)
    ]
    return moved(joined(bottom, walls), TURNED), inner.astype(np.int32), np.array(exact)


PIT, INNER, EXACT = pit()


def right(mesh: Triangles, normals: FloatArray | None = None) -> bool:
    """Whether the floor of the pit within a mesh is as open as it should be, and all else sound."""
    result = baked(mesh, normals)
    error = np.abs(result.ao[0][INNER] - EXACT)
    return sound(result) and float(error.max()) < NOISE and float(error.mean()) < 0.006


# -- a pit, and what must not change it -----------------------------------------------------------


def test_a_pit_is_as_open_as_its_mouth() -> None:
    assert right(PIT)


@pytest.mark.parametrize("scale", [1e-9, 1e-6, 1e6, 1e9])
def test_a_pit_of_any_size(scale: float) -> None:
    assert right(moved(PIT, scale))


@pytest.mark.parametrize("offset", [1e3, 1e5, 1e7])
def test_a_pit_far_from_the_origin(offset: float) -> None:
    assert right(moved(PIT, 1.0, (offset, offset, offset)))


def with_faces(*faces: object) -> Triangles:
    return Triangles(
        PIT.vertices, np.concatenate([PIT.faces, *map(np.asarray, faces)]).astype(np.int32)
    )


def with_vertices(vertices: object, faces: object = ()) -> Triangles:
    more = np.asarray(faces, np.int32).reshape(-1, 3) + len(PIT.vertices)
    return Triangles(
        np.concatenate([PIT.vertices, np.asarray(vertices)]),
        np.concatenate([PIT.faces, more]).astype(np.int32),
    )


K = np.arange(0, len(PIT.vertices) - 3, 3)
BESIDE = {
    "faces that use a vertex twice": with_faces(np.stack([K, K, K + 1], 1), np.stack([K, K, K], 1)),
    "faces given two and three times": with_faces(PIT.faces[::2], PIT.faces[::3]),
    "vertices that no face uses": with_vertices(np.full((5, 3), 7.0)),
    "unused vertices far away": with_vertices(np.full((2, 3), 1e30)),
    "a face without area": with_vertices([(3, 3, 3), (4, 4, 4), (5, 5, 5)], [(0, 1, 2)]),
    "a vertex that is NaN": with_vertices([(np.nan, 0, 0), (3, 3, 3), (3, 4, 3)], [(0, 1, 2)]),
    "a vertex that is infinite": with_vertices([(np.inf, 0, 0), (3, 3, 3), (3, 4, 3)], [(0, 1, 2)]),
    "an unused NaN": with_vertices([(np.nan, np.nan, np.nan)]),
    "walls from both sides, unwelded": joined(PIT, flipped(PIT)),
    "the whole pit twice": joined(PIT, PIT),
    "a soup": joined(PIT, unwelded(PIT)),
    "a speck of dust": joined(PIT, moved(icosphere(0), 1e-12, (5.0, 5.0, 5.0))),
    "needles": joined(PIT, patch((9, 0, 0), (9, 1, 0), (9, 1, 1e-7), (9, 0, 1e-7), 50, 1)),
}


@pytest.mark.parametrize("name", BESIDE)
def test_a_pit_with_something_that_must_not_matter(name: str) -> None:
    assert right(BESIDE[name])


def test_welded_walls_with_two_sides_are_asked_from_the_side_of_their_normals() -> None:
    both = with_faces(PIT.faces[:, ::-1])
    normals = np.tile(TURNED @ UP, (len(both.vertices), 1))
    assert right(both, normals)


def test_faces_in_another_order_give_the_same_values() -> None:
    order = np.random.default_rng(4).permutation(len(PIT.faces))
    other = baked(Triangles(PIT.vertices, PIT.faces[order])).ao[0]
    assert np.abs(baked(PIT).ao[0] - other).max() <= 2.0 / RAYS  # only a ray at an edge may differ


# -- single cases ---------------------------------------------------------------------------------


@pytest.mark.parametrize("flip", [False, True])
def test_coincident_bodies_are_open_outside(flip: bool) -> None:
    ball = moved(icosphere(2), TURNED)
    result = baked(joined(ball, flipped(ball) if flip else ball))
    assert sound(result)
    assert result.ao[0][: len(ball.vertices)].min() == 1.0


def test_bodies_that_pass_through_each_other_are_dark_inside_and_open_outside() -> None:
    ball, other = icosphere(3), moved(icosphere(3), 1.0, (1.0, 0.0, 0.0))
    ao = baked(joined(ball, other)).ao[0]
    inside = np.linalg.norm(ball.vertices - (1.0, 0.0, 0.0), axis=1) < 0.99
    far = ball.vertices[:, 0] < -0.9
    assert ao[: len(inside)][inside].max() == 0.0
    assert ao[: len(inside)][far].min() == 1.0


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_a_body_of_mixed_winding_is_repaired(share: float) -> None:
    ball = icosphere(2)
    over = np.random.default_rng(0).random(len(ball.faces)) < share
    tangled = np.where(over[:, None], ball.faces[:, ::-1], ball.faces).astype(np.int32)
    result = baked(Triangles(ball.vertices, tangled))
    assert result.ao[0].min() == 1.0
    assert len(result.warnings) == 1


def test_a_body_turned_inside_out_is_a_room_or_repaired_but_not_both() -> None:
    ao = baked(flipped(icosphere(2))).ao[0]
    assert float(ao.max()) == 0.0 or float(ao.min()) == 1.0


def test_a_fold_of_two_opposite_triangles_is_finite() -> None:
    fold = Triangles(
        np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0.0)]), np.array([(0, 1, 2), (0, 2, 1)], np.int32)
    )
    assert sound(baked(fold))
    assert sound(baked(joined(fold, floor(2.0))))


def test_fins_on_an_edge_are_seen_by_both_sides() -> None:
    """A floor with a fin in its middle: half of the sky is left at its foot, on either side."""
    high = 1e3
    fin = patch((0, -high, 0), (0, high, 0), (0, high, high), (0, -high, high))
    left, right_ = (
        patch((-1, 0, 0), (0, 0, 0), (0, 1, 0), (-1, 1, 0), 2, 2),
        patch((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), 2, 2),
    )
    mesh = joined(left, right_, fin)
    for turn in (np.eye(3), TURNED):
        ao = baked(moved(mesh, turn), rays=2048).ao[0]
        floor_x = mesh.vertices[:18, 0]
        assert np.abs(ao[:18][floor_x == 0.0] - 0.5).max() < NOISE


def test_a_moebius_band_is_sound() -> None:
    n = 60
    t = 2.0 * math.pi * np.arange(n) / n
    out = np.stack([np.cos(t / 2) * np.cos(t), np.cos(t / 2) * np.sin(t), np.sin(t / 2)], axis=1)
    middle = np.stack([np.cos(t), np.sin(t), np.zeros(n)], axis=1)
    faces = []
    for k in range(n):
        a, b = k, k + n
        c, d = ((k + 1), (k + 1) + n) if k + 1 < n else (n, 0)
        faces += [(a, c, b), (b, c, d)]
    band = Triangles(
        np.concatenate([middle - 0.3 * out, middle + 0.3 * out]), np.array(faces, np.int32)
    )
    result = baked(band)
    assert sound(result)
    assert 0.3 < float(result.ao[0].mean()) < 1.0


def test_a_single_triangle_is_open() -> None:
    alone = Triangles(
        np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0.0)]), np.array([(0, 1, 2)], np.int32)
    )
    assert baked(alone).ao[0].tolist() == [1.0, 1.0, 1.0]


def test_nothing_gives_nothing() -> None:
    empty = baked(Triangles(np.zeros((0, 3)), np.zeros((0, 3), np.int32)))
    assert [ao.shape for ao in empty.ao] == [(0,)]
    assert empty.rays == 0
    assert bake_vertices(Scene(meshes=(), instances=())).ao == []
    loose = baked(Triangles(np.zeros((3, 3)), np.zeros((0, 3), np.int32)))
    assert loose.ao[0].tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    "vertices",
    [
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
        np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0.0)]),
        np.array([(0, 0, 0), (1e-320, 0, 0), (0, 1e-320, 0)]),
        np.array([(0, 0, 0), (1e300, 0, 0), (0, 1e300, 0)]),
        np.array([(-1.7e308, 0, 0), (1.7e308, 0, 0), (0, 1.7e308, 0)]),
        np.array([(1e30, 1e30, 1e30), (1e30, 1e30, 1e30), (1e30, 1e30, 1.0)]),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning", "ignore:invalid value:RuntimeWarning")
def test_a_face_of_any_numbers_is_sound(vertices: FloatArray) -> None:
    assert sound(baked(Triangles(vertices, np.array([(0, 1, 2)], np.int32)), rays=16))


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
def test_normals_without_direction_are_replaced_and_said(bad: float) -> None:
    ball = icosphere(1)
    normals = ball.vertices.copy()
    normals[::3] = bad
    result = baked(ball, normals)
    assert result.ao[0].min() == 1.0
    assert len(result.warnings) == 1


def test_a_scene_without_fault_has_no_warning() -> None:
    assert baked(PIT).warnings == ()


@pytest.mark.parametrize("name", ["faces that use a vertex twice", "a vertex that is NaN"])
def test_what_is_passed_over_is_said_in_one_line(name: str) -> None:
    warnings = baked(BESIDE[name]).warnings
    assert warnings
    assert all("\n" not in warning for warning in warnings)


# -- what bake_vertices gives ---------------------------------------------------------------------


def test_every_instance_has_its_own_values_in_order() -> None:
    ball, ground = icosphere(1), floor(50.0, -1.0)
    away = affine(1.0, (0.0, 0.0, 1e3))
    scene = Scene(
        meshes=(mesh_of(ball), mesh_of(ground)),
        instances=(Instance(mesh=0, transform=away), Instance(mesh=1), Instance(mesh=0)),
    )
    result = bake_vertices(scene, BakeSettings(rays=64))
    assert [len(ao) for ao in result.ao] == [42, 4, 42]
    assert float(result.ao[0].min()) > 0.95 > float(result.ao[2].min())


def test_unwelded_vertices_that_are_smoothed_have_one_value_at_one_place() -> None:
    soup = unwelded(icosphere(2))
    result = baked(joined(soup, floor(3.0, -1.0)))
    places, which = np.unique(soup.vertices.round(9), axis=0, return_inverse=True)
    for number in range(0, len(places), 7):
        assert np.ptp(result.ao[0][: len(soup.vertices)][which.reshape(-1) == number]) == 0.0


def test_a_bake_gives_its_settings_plan_rays_and_seconds() -> None:
    settings = BakeSettings(rays=40)
    result = bake_vertices(Scene.from_arrays(*icosphere(1)), settings)
    assert result.settings is settings
    assert result.rays == 40 * 42
    assert result.plan.effects["occlusion"].on
    assert {"prepare", "build", "trace"} <= result.seconds.keys()
    assert min(result.seconds.values()) >= 0.0


def test_vertices_and_points_agree() -> None:
    """The same quantity by both ways in, within both errors."""
    result = baked(PIT)
    normals = np.tile(TURNED @ UP, (len(INNER), 1))
    points = visibility(
        Scene.from_arrays(*PIT), PIT.vertices[INNER], normals, BakeSettings(rays=RAYS)
    )
    allowed = 4.0 * np.hypot(points.standard_error, result.standard_error[0][INNER])
    assert (np.abs(points.mean - result.ao[0][INNER]) <= allowed).all()


# -- memory ---------------------------------------------------------------------------------------

MEASURE = """
import resource, sys
import numpy as np
from aobake import BakeSettings, Scene, bake_vertices
from tests.scenes import icosphere, patch, Triangles

def grid(cells):
    mesh = patch((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), cells, cells)
    mesh.vertices[:, 2] = 0.02 * np.sin(40.0 * mesh.vertices[:, 0]) * np.sin(31.0 * mesh.vertices[:, 1])
    return Scene.from_arrays(*mesh)

def peak():
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return kilobytes * (1 if sys.platform == "darwin" else 1024)

settings = BakeSettings(rays=8, threads=2)
bake_vertices(grid(40), settings)           # kernels, Embree, threads
scenes = [grid(cells) for cells in (150, 450)]
before = peak()
bake_vertices(scenes[0], settings)
small = peak()
bake_vertices(scenes[1], settings)
large = peak()
print(scenes[1].vertices, (large - before) / scenes[1].vertices)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no getrusage")
def test_a_bake_of_a_fifth_of_a_million_vertices_takes_no_more_memory_than_stated() -> None:
    """Peak of the process less what it held before, per vertex. Of these, Embree's tree and the float32
    copies that it shares take about 2 faces of (12 + 12 / 2 + 100) bytes; 200 are allowed beside them."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURE],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    count, each = done.stdout.split()
    assert int(count) > 200_000
    assert float(each) < 200.0 + 2.0 * 118.0

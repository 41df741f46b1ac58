"""Instances against the same scene in one piece, and what a world is built of."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake import BakedVertices, BakeSettings, Instance, Scene, bake_vertices, visibility
from tests.scenes import (
    TURNED,
    UP,
    FloatArray,
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
    rotation,
    unwelded,
)

RAYS = 512


def in_one_piece(scene: Scene) -> tuple[Scene, NDArray[np.int64]]:
    """Every instance put in place in float64, and where each one's vertices begin.

    The normals come along: from the faces anew, a stretched box would be smoothed at other edges.
    """
    parts, normals = [], []
    for instance, mesh in scene.placed():
        linear, shift = instance.transform[:3, :3], instance.transform[:3, 3]
        placed = moved(Triangles(mesh.vertices, mesh.faces), linear, shift)
        parts.append(flipped(placed) if np.linalg.det(linear) < 0.0 else placed)
        assert mesh.normals is not None
        normals.append(mesh.normals @ np.linalg.inv(linear))
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return Scene.from_arrays(*joined(*parts), normals=np.concatenate(normals)), starts


def differs(one: BakedVertices, other: BakedVertices, starts: NDArray[np.int64]) -> float:
    """Share of the vertices that differ by more than both errors allow."""
    far = []
    for number, (ao, error) in enumerate(zip(one.ao, one.standard_error, strict=True)):
        chosen = slice(starts[number], starts[number + 1])
        allowed = 4.0 * np.hypot(error, other.standard_error[0][chosen]) + 1e-5
        far.append(np.abs(ao - other.ao[0][chosen]) > allowed)
    return float(np.concatenate(far).mean())


ROW = [affine(1.0, (x, 0.0, 0.0)) for x in (0.0, 1.1, 2.3)]
TRANSFORMS = {
    "moved": ROW,
    "turned": [affine(rotation((1, 2, 3), a), (1.2 * a, 0.0, 0.0)) for a in (0.0, 1.0, 2.0)],
    "mirrored": [affine(np.diag([-1.0, 1.0, 1.0]), (3.0, 0.0, 0.0)), *ROW],
    "mirrored alone": [affine(np.diag([1.0, 1.0, -1.0]) @ TURNED)],
    "stretched": [
        affine(np.diag([3.0, 0.2, 1.0]) @ TURNED),
        *ROW[1:],
        affine(np.diag([1.0, 1.0, 7.0]), (0, 2, 0)),
    ],
    "sheared": [affine([[1.0, 0.9, 0.0], [0.0, 1.0, 0.0], [0.0, 0.4, 1.0]]), *ROW[1:]],
    "of sizes from 1e-3 to 1e3": [
        affine(1e-3, (0, 0, 2)),
        affine(1.0, (2, 0, 0)),
        affine(1e3, (0, 0, -2e3)),
    ],
    "far away": [affine(TURNED, (1e6 + 1.2 * k, 1e6, -1e6)) for k in range(3)],
}


@pytest.mark.parametrize("name", TRANSFORMS)
def test_instances_are_as_open_as_the_scene_in_one_piece(name: str) -> None:
    """A cup-like body: a box without lid, on which the others throw shade."""
    cup = unwelded(joined(box(without=("+z",)), moved(box(), 0.3, (0.0, 0.0, 0.1))))
    a, b, c = cup.vertices[cup.faces].transpose(1, 0, 2)
    normals = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    instances = tuple(Instance(mesh=0, transform=transform) for transform in TRANSFORMS[name])
    scene = Scene(meshes=(mesh_of(cup, normals=normals),), instances=instances)
    whole, starts = in_one_piece(scene)
    settings = BakeSettings(rays=RAYS)
    one, other = bake_vertices(scene, settings), bake_vertices(whole, settings)
    assert differs(one, other, starts) <= 0.02
    assert [len(ao) for ao in one.ao] == np.diff(starts).tolist()


@pytest.mark.parametrize(
    "flat", [np.diag([1.0, 1.0, 0.0]), np.diag([1.0, 0.0, 0.0]), np.zeros((3, 3))]
)
def test_a_singular_transform_gives_finite_values_and_leaves_others_alone(flat: FloatArray) -> None:
    body = mesh_of(icosphere(1))
    settings = BakeSettings(rays=64)
    scene = Scene(
        meshes=(body,),
        instances=tuple(
            Instance(mesh=0, transform=t) for t in (*ROW, affine(flat, (0.0, 0.0, 40.0)))
        ),
    )
    baked = bake_vertices(scene, settings)
    for ao in baked.ao:
        assert np.isfinite(ao).all()
        assert ao.min() >= 0.0
        assert ao.max() <= 1.0
    without = bake_vertices(Scene(meshes=(body,), instances=scene.instances[:3]), settings)
    for ao, expected in zip(baked.ao[:3], without.ao, strict=True):
        assert np.abs(ao - expected).max() < 0.05


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_transform_that_is_not_finite_is_passed_over_and_said(bad: float) -> None:
    scene = Scene(
        meshes=(mesh_of(icosphere(1)),),
        instances=(
            Instance(mesh=0),
            Instance(mesh=0, transform=affine(1.0, (bad, 0.0, 0.0)), name="lost"),
        ),
    )
    baked = bake_vertices(scene, BakeSettings(rays=16))
    assert baked.ao[0].min() == 1.0
    assert baked.ao[1].tolist() == [1.0] * 42
    assert any("lost" in warning for warning in baked.warnings)


def test_a_mirrored_body_shows_its_outside() -> None:
    """Its normals point outward still: a mirrored convex body is open, a mirrored room dark."""
    for mesh, expected in ((unwelded(box()), 1.0), (unwelded(flipped(box())), 0.0)):
        for count in (1, 2):
            transforms = [affine(np.diag([-1.0, 1.0, 1.0]), (5.0 * k, 0, 0)) for k in range(count)]
            scene = Scene(
                meshes=(mesh_of(mesh),),
                instances=tuple(Instance(mesh=0, transform=t) for t in transforms),
            )
            baked = bake_vertices(scene, BakeSettings(rays=128))
            if expected == 1.0:
                assert min(float(ao.min()) for ao in baked.ao) > 0.8  # the other one is in sight
            else:
                assert max(float(ao.max()) for ao in baked.ao) == 0.0


def test_normals_of_a_stretched_instance_stay_upright() -> None:
    """By the inverse transpose: a slope of 45 degrees stretched to 1 in 10 looks nearly up."""
    slope = patch((-1, -1, -1), (1, -1, 1), (1, 1, 1), (-1, 1, -1))
    ground = floor(1e4, -30.0)
    scene = Scene(
        meshes=(mesh_of(slope), mesh_of(ground)),
        instances=(Instance(mesh=0, transform=affine(np.diag([10.0, 1.0, 1.0]))), Instance(mesh=1)),
    )
    baked = bake_vertices(scene, BakeSettings(rays=4096))
    exact = 0.5 * (1.0 + 10.0 / math.hypot(1.0, 10.0))
    assert np.abs(baked.ao[0] - exact).max() < 4.0 * float(baked.standard_error[0].max()) + 5e-3


@pytest.mark.parametrize("count", [1, 3])
def test_bodies_in_contact_across_instances(count: int) -> None:
    """A box on another: the faces that touch see nothing, whether they are instances or not."""
    transforms = [affine(TURNED), affine(TURNED, TURNED @ UP)]
    transforms += [affine(TURNED, TURNED @ (9.0 * k, 0.0, 0.0)) for k in range(1, count)]
    own = unwelded(box())
    scene = Scene(
        meshes=(mesh_of(own),), instances=tuple(Instance(mesh=0, transform=t) for t in transforms)
    )
    baked = bake_vertices(scene, BakeSettings(rays=RAYS))
    face = own.vertices[own.faces]
    up = np.repeat(np.cross(face[:, 1] - face[:, 0], face[:, 2] - face[:, 0])[:, 2], 3)
    assert baked.ao[0][up > 0.5].max() == 0.0
    assert baked.ao[1][up < -0.5].max() == 0.0
    assert baked.ao[0][np.abs(up) < 0.5].min() > 0.9
    assert baked.ao[1][up > 0.5].min() > 0.98


@pytest.mark.parametrize("share", [1, 2])
def test_a_distance_limit_and_a_falloff_are_in_units_of_the_scene(share: int) -> None:
    """Under a ceiling of an instance that is scaled: (h/D)^2, and 1 - (1 - h/D)^2 with a falloff."""
    ceiling = mesh_of(flipped(floor(50.0)))
    transforms = [affine(2.0, (0.0, 0.0, 0.4)), affine(2.0, (0.0, 0.0, 900.0))][:share]
    scene = Scene(
        meshes=(ceiling,), instances=tuple(Instance(mesh=0, transform=t) for t in transforms)
    )
    points = np.zeros((16, 3))
    for falloff, exact in (("none", 0.16), ("linear", 1.0 - 0.6**2)):
        settings = BakeSettings(
            rays=1024, max_distance=1.0, falloff="linear" if falloff == "linear" else "none"
        )
        estimate = visibility(scene, points, np.tile(UP, (16, 1)), settings)
        assert abs(float(estimate.mean.mean()) - exact) <= float(estimate.standard_error.max())


def test_a_forest_keeps_the_value_of_its_one_tree() -> None:
    """A hundred instances out of each other's reach: each is as open as one alone, within the errors."""
    body = mesh_of(unwelded(joined(box(without=("+z",)), moved(icosphere(1), 0.2))))
    alone = bake_vertices(
        Scene(meshes=(body,), instances=(Instance(mesh=0),)), BakeSettings(rays=RAYS)
    )
    transforms = [
        affine(rotation((0, 0, 1), 0.1 * k), (1e3 * (k % 10), 1e3 * (k // 10), 0.0))
        for k in range(100)
    ]
    scene = Scene(
        meshes=(body,), instances=tuple(Instance(mesh=0, transform=t) for t in transforms)
    )
    forest = bake_vertices(scene, BakeSettings(rays=64))
    mean = np.mean(forest.ao, axis=0, dtype=np.float64)
    error = float(np.max(forest.standard_error)) / 10.0
    assert np.abs(mean - alone.ao[0]).max() <= 4.0 * (error + float(alone.standard_error[0].max()))

"""Rays aimed at the edges and vertices of closed meshes; random rays would hide a leak."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake import BakeSettings, Scene, visibility
from tests.scenes import (
    TURNED,
    FloatArray,
    Triangles,
    box,
    disc,
    flipped,
    icosphere,
    joined,
    moved,
    subdivided,
    tube,
)
from tests.tracing.rays import occluded, world_of

RAYS = 250_000


def welded(mesh: Triangles) -> Triangles:
    """Vertices at one place as one."""
    vertices, which = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return Triangles(vertices, which.reshape(-1)[mesh.faces].astype(np.int32))


def can(segments: int) -> Triangles:
    """A cylinder of needles with fans of needles at both ends."""
    top = disc(1.0, 4.0, segments)
    bottom = moved(flipped(top), 1.0, (0.0, 0.0, -8.0))
    return welded(joined(tube(1.0, -4.0, 4.0, segments), top, bottom))


CLOSED = {
    "box": box(),
    "turned box": moved(subdivided(subdivided(box())), TURNED),
    "sphere": moved(icosphere(4), TURNED),
    "needles": moved(can(4000), TURNED),
}


def sides(mesh: Triangles) -> NDArray[np.int64]:
    """(E, 2) each edge once."""
    pairs = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0).astype(np.int64)


def aimed(
    targets: FloatArray, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Origins near the middle, and directions to the targets in float64, rounded at the end."""
    origins = (0.2 * rng.uniform(-1.0, 1.0, targets.shape)).astype(np.float32)
    return origins, (targets - origins).astype(np.float32)


def leaks_at_edges(mesh: Triangles) -> int:
    """How many of RAYS rays towards the edges of a closed mesh meet nothing."""
    rng = np.random.default_rng(11)
    world = world_of(mesh)
    vertices, faces, first_vertex, first_face, *_ = world.arrays
    corners = vertices[: first_vertex[1]].astype(np.float64)
    edges = sides(Triangles(corners, faces[: first_face[1]].astype(np.int32)))
    a, b = corners[rng.choice(edges, RAYS)].transpose(1, 0, 2)
    t = rng.uniform(0.02, 0.98, (RAYS, 1))
    return int((~occluded(world.tree, *aimed((1.0 - t) * a + t * b, rng))).sum())


@pytest.mark.parametrize("name", ["box", "turned box", "sphere"])
def test_no_ray_leaves_through_an_edge(name: str) -> None:
    assert leaks_at_edges(CLOSED[name]) == 0


def test_next_to_no_ray_leaves_where_needles_meet() -> None:
    """The robust scene's own limit: 4 in 1,000 rays aimed at a rim between two fans of needles slip
    through. None is aimed in a bake; see below."""
    assert leaks_at_edges(CLOSED["needles"]) <= RAYS // 100


@pytest.mark.parametrize("name", CLOSED)
def test_next_to_no_ray_leaves_through_a_vertex(name: str) -> None:
    """Along edges the robust scene is closed, at vertices not quite: 3 in 1,000 of the rays aimed at
    those of a sphere slip through."""
    rng = np.random.default_rng(12)
    world = world_of(CLOSED[name])
    vertices, _, first_vertex, *_ = world.arrays
    targets = rng.choice(vertices[: first_vertex[1]].astype(np.float64), RAYS)
    hits = occluded(world.tree, *aimed(targets, rng))
    assert int((~hits).sum()) <= RAYS // 100


@pytest.mark.parametrize("name", CLOSED)
def test_no_ray_of_a_bake_leaves_a_closed_mesh(name: str) -> None:
    """A quarter of a million rays that are spread as a bake spreads them, some along the axis."""
    rng = np.random.default_rng(13)
    points = 0.2 * rng.uniform(-1.0, 1.0, (16, 3))
    normals = np.concatenate([[TURNED[:, 2], -TURNED[:, 2]], rng.standard_normal((14, 3))])
    scene = Scene.from_arrays(*CLOSED[name])
    estimate = visibility(scene, points, normals, BakeSettings(rays=16_384))
    assert float(estimate.mean.max()) == 0.0

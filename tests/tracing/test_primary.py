"""Rays of a picture against a slow oracle, and their misses."""

from __future__ import annotations

import numpy as np

from aobake.tracing import embree
from aobake.tracing.primary import nearest_hits, reach
from tests.scenes import FloatArray, Triangles, icosphere, joined, moved


def tree_of(mesh: Triangles) -> embree.Tree:
    vertices = np.zeros((len(mesh.vertices) + 2, 3), np.float32)
    vertices[:-2] = mesh.vertices
    return embree.build_tree([embree.Body(vertices[:-2], mesh.faces.view(np.uint32))], [], [])


def first_hit(
    mesh: Triangles, origin: FloatArray, direction: FloatArray, near: float
) -> tuple[float, int]:
    """(distance, face) by Cramer's rule over all faces; (infinity, -1) for none."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    matrix = np.stack([b - a, c - a, np.broadcast_to(-direction, a.shape)], axis=2)
    solved = np.linalg.solve(matrix, (origin - a)[..., None])[..., 0]
    u, v, t = solved.T
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > near)
    if not met.any():
        return np.inf, -1
    distance = np.where(met, t, np.inf)
    return float(distance.min()), int(distance.argmin())


def test_rays_meet_the_face_that_is_nearest_beyond_where_they_begin() -> None:
    mesh = joined(icosphere(1), moved(icosphere(1), 0.5, (0.3, 0.1, 0.2)))
    random = np.random.default_rng(4)
    origins, directions = random.normal(size=(2, 3, 203)) * 2.0  # no multiple of eight
    near = random.uniform(0.0, 1.0, 203)
    rays = [array.astype(np.float32) for array in (origins, directions, near)]
    hits = nearest_hits(tree_of(mesh), *rays)
    corners = mesh.vertices[mesh.faces[hits.face]]
    for k in range(203):
        distance, face = first_hit(
            mesh, rays[0][:, k].astype(float), rays[1][:, k].astype(float), near[k]
        )
        assert (hits.thing[k] >= 0) == (face >= 0)
        if face >= 0:
            assert hits.face[k] == face
            assert abs(hits.distance[k] - distance) < 1e-4
            at = hits.weights[:, k] @ corners[k]
            assert np.abs(at - rays[0][:, k] - hits.distance[k] * rays[1][:, k]).max() < 1e-4
        else:
            assert np.isinf(hits.distance[k])


def test_rays_reach_what_nothing_stands_before() -> None:
    tree = tree_of(icosphere(2))
    origins = np.array([[0, 0, 5], [0, 0, 5], [3, 0, 5]], np.float32).T.copy()
    down = np.repeat(np.array([[0], [0], [-1]], np.float32), 3, axis=1)
    far = np.array([3.5, np.inf, np.inf], np.float32)
    assert reach(tree, origins, down, far).tolist() == [True, False, True]


def test_no_rays_give_empty_arrays() -> None:
    tree, none = tree_of(icosphere(0)), np.zeros((3, 0), np.float32)
    hits = nearest_hits(tree, none, none, np.zeros(0, np.float32))
    assert hits.thing.shape == (0,)
    assert hits.weights.shape == (3, 0)
    assert reach(tree, none, none, np.zeros(0, np.float32)).shape == (0,)

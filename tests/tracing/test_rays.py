"""The compiled tracer against slow and against foreign ones, ray for ray."""

from __future__ import annotations

import numpy as np
import pytest
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from numpy.typing import NDArray

from aobake import BakeSettings, Scene, visibility
from aobake.tracing import embree
from aobake.tracing.compiled import kernel
from aobake.tracing.kernels import LINEAR, SUMS, mix, scratch, trace, turned_frame
from aobake.tracing.sampling import direction_sets
from aobake.tracing.sized_sets import SizedSets
from tests.scenes import FloatArray, Triangles, box, icosphere, joined, moved, patch, rotation, unit
from tests.tracing.rays import (
    brute_force,
    directions_of,
    mixed_bits,
    occluded,
    placed,
    sums_of,
    world_of,
)

IntArray = NDArray[np.int64]
SLANTED = np.tile(np.array([0.2, 0.1, 1.0], np.float32), (200, 1))


def clutter(seed: int, faces: int = 60) -> Triangles:
    """Triangles of all sizes, anywhere in the unit cube."""
    rng = np.random.default_rng(seed)
    middles = rng.uniform(-1.0, 1.0, (faces, 1, 3))
    corners = middles + rng.uniform(0.05, 0.6, (faces, 1, 1)) * rng.standard_normal((faces, 3, 3))
    return Triangles(corners.reshape(-1, 3), np.arange(3 * faces, dtype=np.int32).reshape(-1, 3))


MESHES = {
    "clutter": clutter(1),
    "more clutter": clutter(2),
    "box beside a sphere": joined(
        moved(box(), rotation((1, 2, 3), 0.6)), icosphere(1, 0.4, (0.9, 0.1, 0.3))
    ),
    "steps": joined(
        *(patch((x, -1, x), (x + 1, -1, x), (x + 1, 1, x), (x, 1, x)) for x in (-1.0, 0.0, 0.7))
    ),
}


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize(("rays", "seed"), [(256, 0), (100, 12345678901234567890)])
def test_a_slow_tracer_counts_the_same_hits_around_points_in_the_open(
    name: str, rays: int, seed: int
) -> None:
    mesh, rng = MESHES[name], np.random.default_rng(7)
    points, normals = rng.uniform(-1.2, 1.2, (40, 3)), rng.standard_normal((40, 3))
    estimate = visibility(
        Scene.from_arrays(*mesh), points, normals, BakeSettings(rays=rays, seed=seed)
    )
    for number, (point, normal, mean) in enumerate(
        zip(points, normals, estimate.mean, strict=True)
    ):
        directions = directions_of(seed, number, normal, rays)
        hit, close = brute_force(np.tile(point, (rays, 1)), directions, mesh)
        assert abs(round(rays * (1.0 - float(mean))) - int(hit.sum())) <= int(close.sum())


@pytest.mark.parametrize("name", ["box beside a sphere", "steps"])
def test_a_slow_tracer_counts_the_same_hits_from_the_surface(name: str) -> None:
    """From where the rays truly start, so that the surface itself is traced as well."""
    mesh = MESHES[name]
    faces = mesh.vertices[mesh.faces]
    points = np.einsum("k,fkd->fd", [0.5, 0.3, 0.2], faces)
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    estimate = visibility(Scene.from_arrays(*mesh), points, normals, BakeSettings(rays=128))
    starts = placed(world_of(mesh), points, normals).origins
    for number, (start, normal, mean) in enumerate(
        zip(starts, normals, estimate.mean, strict=True)
    ):
        directions = directions_of(0, number, normal, 128)
        hit, close = brute_force(np.tile(start, (128, 1)), directions, mesh, 1e-7)
        assert abs(round(128 * (1.0 - float(mean))) - int(hit.sum())) <= int(close.sum())


@pytest.mark.parametrize("name", MESHES)
def test_packets_hit_what_the_scene_class_of_embreex_hits(name: str) -> None:
    world, rng = world_of(MESHES[name]), np.random.default_rng(3)
    vertices, faces, first_vertex, first_face, *_ = world.arrays
    origins = rng.uniform(-1.0, 1.0, (50_003, 3)).astype(np.float32)
    directions = rng.standard_normal(origins.shape).astype(np.float32)
    foreign = rtcore_scene.EmbreeScene(robust=True)
    TriangleMesh(
        foreign, vertices[: first_vertex[1]].copy(), faces[: first_face[1]].astype(np.int32)
    )
    expected = foreign.run(origins, directions, query="OCCLUDED") >= 0
    found = occluded(world.tree, origins, directions)
    assert 0.01 < found.mean() < 0.99
    assert (found == expected).all()


def test_the_kernel_counts_what_the_scene_class_of_embreex_counts() -> None:
    """The same origins and directions, asked for one by one from Python; only rays at edges may differ."""
    mesh, rng = clutter(4, 300), np.random.default_rng(8)
    foreign = rtcore_scene.EmbreeScene(robust=True)
    TriangleMesh(foreign, mesh.vertices.astype(np.float32), mesh.faces)
    points, normals = rng.uniform(-0.5, 0.5, (200, 3)), rng.standard_normal((200, 3))
    estimate = visibility(Scene.from_arrays(*mesh), points, normals, BakeSettings(rays=256))
    directions = np.concatenate(
        [directions_of(0, n, normal, 256) for n, normal in enumerate(normals)]
    )
    origins = np.repeat(points, 256, axis=0).astype(np.float32)
    hits = foreign.run(origins, directions.astype(np.float32), query="OCCLUDED") >= 0
    counted = np.rint(256 * (1.0 - estimate.mean)).astype(int)
    differences = np.abs(counted - hits.reshape(200, 256).sum(axis=1))
    assert differences.sum() <= 10
    assert differences.max() <= 2


def sums_of_kernel(
    functions: tuple[int, int, int, int],
    rays: int | IntArray,
    *,
    ground: bool = False,
    geometric: NDArray[np.float32] | None = None,
    falloff: int | None = None,
) -> FloatArray:
    """What the kernel adds up for 200 points among clutter, asked in packets of one kind or another.

    rays : of all points, or (200,) of each
    """
    world, rng = world_of(clutter(4, 300)), np.random.default_rng(8)
    origins = rng.uniform(-0.5, 0.5, (200, 3)).astype(np.float32)
    normals = rng.standard_normal((200, 3)).astype(np.float32)
    heights = origins[:, 2] + np.float32(0.6)
    each, sums = np.broadcast_to(np.asarray(rays), 200), np.empty((200, SUMS))
    sets = SizedSets.of({size: direction_sets(size) for size in np.unique(each).tolist()})
    trace(
        functions,
        world.tree.address,
        origins,
        normals,
        geometric,
        np.arange(200),
        np.uint64(0),
        sets,
        sets.of_each(each),
        np.float32(np.inf if falloff is None else 0.7),
        (2, heights) if ground else None,
        falloff,
        scratch(),
        sums,
        None,
        None,
    )
    return sums


def test_points_with_sets_of_several_sizes_get_what_they_get_alone() -> None:
    """Of 2^15 rays there are fewer sets than of others."""
    sizes = np.tile([100, 5, 16, 64, 100], 40)
    sizes[::50] = 1 << 15
    together = sums_of_kernel(embree.packets(), sizes)
    for rays in (5, 16, 64, 100, 1 << 15):
        alone = sums_of_kernel(embree.packets(), rays)
        assert np.array_equal(together[sizes == rays], alone[sizes == rays])


@pytest.mark.parametrize("rays", [5, 64, 100])
def test_the_kernel_adds_up_what_its_rays_tell(rays: int) -> None:
    """As many rays one by one; only those at edges may differ, which changes sums of few points."""
    world, rng = world_of(clutter(4, 300)), np.random.default_rng(8)
    origins = rng.uniform(-0.5, 0.5, (200, 3)).astype(np.float32)
    normals = rng.standard_normal((200, 3)).astype(np.float32)
    around = [directions_of(0, number, normal, rays) for number, normal in enumerate(normals)]
    directions = np.concatenate(around).astype(np.float32)
    hits = occluded(world.tree, np.repeat(origins, rays, axis=0), directions)
    expected = sums_of(1.0 - hits.reshape(200, rays).astype(np.float64))
    sums = sums_of_kernel(embree.packets(), rays)
    assert (np.abs(sums - expected) < 1e-9).all(axis=1).mean() > 0.95


@pytest.mark.parametrize(
    ("ground", "geometric"),
    [(False, None), (True, None), (False, SLANTED)],
    ids=["plain", "ground", "geometric"],
)
@pytest.mark.parametrize("rays", [5, 13, 40, 64])
def test_packets_of_eight_and_sixteen_followed_together_or_not_add_up_alike(
    rays: int, ground: bool, geometric: NDArray[np.float32] | None
) -> None:
    """Five fill part of a packet, forty an odd number of eights. Embree takes sixteen on any processor."""
    ways = [
        embree.packets(lanes=lanes, coherent=coherent)
        for lanes in (8, 16)
        for coherent in (False, True)
    ]
    first, *others = (sums_of_kernel(way, rays, ground=ground, geometric=geometric) for way in ways)
    for other in others:
        np.testing.assert_array_equal(other, first)


@pytest.mark.parametrize("rays", [5, 40])
def test_nearest_hits_of_eight_and_of_sixteen_fall_off_alike(rays: int) -> None:
    ways = [embree.packets(lanes=lanes) for lanes in (8, 16)]
    eight, sixteen = (sums_of_kernel(way, rays, falloff=LINEAR) for way in ways)
    np.testing.assert_array_equal(eight, sixteen)


@pytest.mark.parametrize("seed", [0, 1, 2**63, 2**64 - 1])
def test_bits_are_mixed_as_in_whole_numbers(seed: int) -> None:
    compiled = kernel(mix)
    for index in (0, 1, 2**31, 10**12):
        assert int(compiled(np.uint64(seed), np.int64(index))) == mixed_bits(seed, index)


@pytest.mark.parametrize(
    "normal",
    [
        (0, 0, 1),
        (0, 0, -1),
        (1, 0, 0),
        (0, -1, 0),
        (1, 2, 3),
        (1e-9, 0, -1),
        (-3, 1e-20, -1e-20),
        (0.0, 0.0, -0.0 - 5),
    ],
)
def test_a_frame_is_orthonormal_and_right_handed(normal: tuple[float, float, float]) -> None:
    frame = np.empty((3, 3))
    kernel(turned_frame)(np.array(normal, np.float64), np.uint64(mixed_bits(3, 4)), frame)
    assert np.allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) > 0.0
    assert np.allclose(frame[2], unit(normal), atol=1e-15)

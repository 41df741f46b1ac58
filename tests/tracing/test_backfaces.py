"""Hits from behind: they occlude, or are passed through."""

from __future__ import annotations

import numpy as np
import pytest

from aobake import BakeSettings, Instance, Material, Mesh, Scene, bake_vertices, visibility
from aobake.settings import Backfaces
from tests.known import plane_with_falloff
from tests.scenes import UP, FloatArray, Triangles, flipped, floor, icosphere, moved

BALL = icosphere(2)


def scene_of(mesh: Triangles, *transforms: FloatArray, double_sided: bool = False) -> Scene:
    instances = tuple(Instance(mesh=0, transform=t) for t in transforms or (np.eye(4),))
    made = Mesh(vertices=mesh.vertices, faces=mesh.faces, material=0)
    return Scene(
        meshes=(made,), instances=instances, materials=(Material(double_sided=double_sided),)
    )


def inside(scene: Scene, backfaces: Backfaces) -> float:
    settings = BakeSettings(rays=256, backfaces=backfaces)
    return float(visibility(scene, np.zeros((4, 3)), np.eye(4, 3) + UP, settings).mean.max())


def test_a_closed_body_is_open_from_within_when_backs_are_ignored() -> None:
    assert inside(scene_of(BALL), "occlude") == 0.0
    assert inside(scene_of(BALL), "ignore") == 1.0
    assert inside(scene_of(flipped(BALL)), "ignore") == 0.0


def test_a_double_sided_material_occludes_from_both_sides() -> None:
    assert inside(scene_of(BALL, double_sided=True), "ignore") == 0.0


def test_a_material_decides_for_its_own_mesh_only() -> None:
    """One of two sheets overhead has two sides; the other is seen from behind and does not count."""
    sheets = [
        Mesh(vertices=floor(50.0, z).vertices, faces=floor(1.0).faces, material=m)
        for m, z in ((0, 1.0), (1, 2.0))
    ]
    for two_sided in ((False, True), (True, False), (False, False)):
        scene = Scene(
            meshes=tuple(sheets),
            instances=(Instance(mesh=0), Instance(mesh=1)),
            materials=tuple(Material(double_sided=sided) for sided in two_sided),
        )
        estimate = visibility(
            scene, [(0.0, 0.0, 0.0)], [UP], BakeSettings(rays=256, backfaces="ignore")
        )
        assert (float(estimate.mean[0]) > 0.99) == (not any(two_sided))


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("count", [1, 2])
def test_what_is_front_survives_instances_and_mirrors(mirrored: bool, count: int) -> None:
    transform = np.diag([-1.0 if mirrored else 1.0, 2.0, 1.0, 1.0])
    away = transform.copy()
    away[:3, 3] = 100.0
    transforms = [transform, away][:count]
    assert inside(scene_of(BALL, *transforms), "ignore") > 0.99
    assert inside(scene_of(flipped(BALL), *transforms), "ignore") == 0.0


def test_a_falloff_looks_past_backs_for_the_nearest_front() -> None:
    """The back of a near sheet is passed through; the front of a farther one fades with its distance."""
    near, far = floor(50.0, 0.2), flipped(floor(50.0, 0.6))
    meshes = tuple(Mesh(vertices=m.vertices, faces=m.faces) for m in (near, far))
    scene = Scene(meshes=meshes, instances=(Instance(mesh=0), Instance(mesh=1)))
    settings = BakeSettings(rays=1024, max_distance=1.0, falloff="linear", backfaces="ignore")
    estimate = visibility(scene, np.zeros((8, 3)), np.tile(UP, (8, 1)), settings)
    assert np.abs(estimate.mean - plane_with_falloff(0.6, "linear")).max() < 5e-3
    both = BakeSettings(rays=1024, max_distance=1.0, falloff="linear")
    nearer = visibility(scene, np.zeros((8, 3)), np.tile(UP, (8, 1)), both)
    assert np.abs(nearer.mean - plane_with_falloff(0.2, "linear")).max() < 5e-3


def test_a_closed_scene_seen_from_outside_does_not_care() -> None:
    """All that is met first is a front: ignoring backs changes nothing but rays at edges."""
    mesh = Triangles(
        np.concatenate([BALL.vertices, moved(BALL, 0.5, (1.8, 0.0, 0.0)).vertices]),
        np.concatenate([BALL.faces, BALL.faces + len(BALL.vertices)]),
    )
    one, other = (
        bake_vertices(Scene.from_arrays(*mesh), BakeSettings(rays=256, backfaces=kind)).ao[0]
        for kind in ("occlude", "ignore")
    )
    assert np.abs(one - other).max() <= 2.0 / 256.0
    assert float(one.min()) < 0.9


def test_the_ground_occludes_whatever_backs_do() -> None:
    baked = bake_vertices(scene_of(BALL), BakeSettings(rays=256, backfaces="ignore", ground="+z"))
    exact = 0.5 * (1.0 + BALL.vertices[:, 2])
    assert np.abs(baked.ao[0] - exact).max() < 0.05

"""Mean distances: how far one sees in the mean, from the same rays, and where that is kept."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aobake import (
    BakedVertices,
    BakeSettings,
    Instance,
    OutputError,
    Scene,
    SettingsError,
    bake_texture,
    bake_vertices,
    load,
    plan,
    save,
)
from aobake.meshes.formats.gltf.means import mean_direction, mean_length, mean_occlusion
from aobake.settings import StoreSettings
from tests.conftest import Run
from tests.scenes import (
    BESIDE_A_WALL,
    ORIGIN,
    TURNED,
    UP,
    WIDE,
    Triangles,
    affine,
    box,
    flipped,
    floor,
    hexagon_around,
    icosphere,
    joined,
    mesh_of,
    right_angle,
)
from tests.support import one_line

BELOW_A_PLANE = joined(hexagon_around(ORIGIN, UP, 1e-3), flipped(floor(WIDE, 1.0)))
FAR = BakeSettings(rays=4096, mean_distance=True)


def baked(mesh: Triangles, settings: BakeSettings = FAR) -> BakedVertices:
    return bake_vertices(Scene.from_arrays(*mesh), settings)


def distances(found: BakedVertices) -> list[np.ndarray]:
    assert found.mean_distance is not None
    return list(found.mean_distance)


def beside_a_wall(reach: float) -> float:
    """For a wall at distance 1: directions lean by s towards it with the density 2 / pi sqrt(1 - s^2)."""
    a = 1.0 / reach
    root = math.sqrt(1.0 - a * a)
    closed = (math.acos(a) - a * root) / 2.0 - a * (math.log((1.0 + root) / a) - root)
    return reach * (1.0 - 2.0 / math.pi * closed)


@pytest.mark.parametrize("reach", [1.5, 4.0, 20.0])
def test_beside_a_wall_it_is_the_closed_form(reach: float) -> None:
    found = distances(baked(BESIDE_A_WALL, replace(FAR, max_distance=reach)))[0][0]
    assert found == pytest.approx(beside_a_wall(reach), rel=2e-3)


@pytest.mark.parametrize("reach", [0.5, 1.5, 4.0])
def test_below_a_plane_it_is_the_closed_form(reach: float) -> None:
    """With u the squared cosine, which is even, min(1 / sqrt(u), D) comes to 2 - 1 / D, or to D below 1."""
    found = distances(baked(BELOW_A_PLANE, replace(FAR, max_distance=reach)))[0][0]
    assert found == pytest.approx(2.0 - 1.0 / reach if reach > 1.0 else reach, rel=2e-3)


def test_without_a_limit_a_ray_counts_up_to_the_diagonal() -> None:
    found = distances(baked(BESIDE_A_WALL))[0]
    diagonal = math.hypot(1.001, 2.0 * WIDE, 2.0 * WIDE)
    assert found[0] == pytest.approx(beside_a_wall(diagonal), rel=5e-3)
    assert found.max() <= diagonal * (1.0 + 1e-6)


@pytest.mark.parametrize(
    "settings",
    [{}, {"bent_normals": True}, {"ground": "+z"}, {"backfaces": "ignore"}, {"spread": 120.0}],
    ids=["alone", "bent normals", "ground", "backfaces", "cone"],
)
def test_occlusion_is_the_same_with_it_as_without(settings: dict[str, object]) -> None:
    """Whether anything is in the way, and what is nearest, are different questions to the tree."""
    mesh = joined(box(), box((0.1, 0.1, 0.6), (0.4, 0.4, 0.9)))
    plain = BakeSettings(rays=256, max_distance=0.7, **settings)  # type: ignore[arg-type]
    without, found = baked(mesh, plain), baked(mesh, replace(plain, mean_distance=True))
    assert without.mean_distance is None
    assert np.array_equal(found.ao[0], without.ao[0])
    faded = baked(mesh, replace(plain, falloff="linear"))
    assert np.abs(distances(found)[0] - 0.7 * faded.ao[0]).max() < 1e-6


def test_towards_a_tolerance_all_rays_count() -> None:
    settings = BakeSettings(tolerance=0.003, mean_distance=True, max_distance=4.0)
    found = distances(baked(BESIDE_A_WALL, settings))[0][0]
    assert found == pytest.approx(beside_a_wall(4.0), rel=5e-3)


def test_inside_a_ball_it_is_the_mean_chord() -> None:
    """From the sphere a chord has the length 2 R cos, of which the mean is 4 R / 3."""
    ball = icosphere(4)
    scene = Scene.from_arrays(ball.vertices, ball.faces[:, ::-1].copy(), normals=-ball.vertices)
    found = distances(bake_vertices(scene, replace(FAR, rays=1024)))[0]
    assert np.abs(found - 4.0 / 3.0).max() < 0.01


def test_what_needs_no_ray_is_as_far_as_counts_or_at_nothing() -> None:
    above = distances(baked(icosphere(2), replace(FAR, max_distance=3.0)))[0]
    assert (above == 3.0).all(), "under an open sky"
    lying = flipped(floor(0.5, 0.0, 4))
    under = baked(joined(lying, floor(1.0)), replace(FAR, rays=16))
    inner = np.abs(lying.vertices[:, :2]).max(axis=1) < 0.5
    assert (distances(under)[0][: len(inner)][inner] == 0.0).all(), "face to face with the floor"


def test_it_grows_with_the_scene() -> None:
    """In float32 tripled coordinates round in another way, and a few rays beside edges with them."""
    small = distances(baked(right_angle(4.0), replace(FAR, max_distance=2.0)))[0]
    large = distances(baked(right_angle(12.0), replace(FAR, max_distance=6.0)))[0]
    assert np.abs(3.0 * small - large).max() < 0.02


def test_a_larger_placement_is_not_a_copy() -> None:
    """Its occlusion is the same and could be shared, but not its distances."""
    larger = affine(3.0 * TURNED, (30.0, 0.0, 0.0))
    scene = Scene(
        meshes=(mesh_of(right_angle(4.0), name="corner"),),
        instances=(Instance(mesh=0), Instance(mesh=0, transform=larger)),
    )
    settings = BakeSettings(rays=256, occluders=("own",), mean_distance=True)
    small, large = distances(bake_vertices(scene, settings))
    assert np.abs(small - large).max() > 1.0


def two() -> Scene:
    """A floor and a box over it."""
    shapes = {"floor": floor(1.0, 0.0, 4), "box": box((-0.2, -0.2, 0.1), (0.2, 0.2, 0.5))}
    return Scene.from_meshes([mesh_of(shape, name=name) for name, shape in shapes.items()])


@pytest.mark.parametrize("name", ["new.glb", "new.gltf", "new.ply"])
def test_a_new_file_holds_it(tmp_path: Path, name: str) -> None:
    found = bake_vertices(two(), replace(FAR, rays=64))
    save(found, tmp_path / name)
    values = [mesh.attributes["_MEAN_DISTANCE"].values for mesh in load(tmp_path / name).meshes]
    assert np.array_equal(np.concatenate(values)[:, 0], np.concatenate(distances(found)))


ASCII = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property uchar mean_distance
property int room
element face 2
property list uchar int vertex_indices
end_header
0 0 0 7 1
1 0 0 7 2
1 1 0.2 7 3
0 1 0 7 4
3 0 1 2
3 0 2 3
"""


def test_a_ply_file_is_patched_and_an_earlier_property_replaced(tmp_path: Path) -> None:
    source, target, again = (tmp_path / name for name in ("a.ply", "b.ply", "c.ply"))
    source.write_text(ASCII)
    found = bake_vertices(load(source), replace(FAR, rays=64))
    save(found, target, store=StoreSettings(store="attribute"))
    text = target.read_text()
    assert text.count("mean_distance") == 1
    assert "property float mean_distance" in text
    rows = text.split("end_header\n")[1].splitlines()[:4]
    assert [row.split()[3] for row in rows] == ["1", "2", "3", "4"]
    held = load(target).meshes[0].attributes["_MEAN_DISTANCE"].values[:, 0]
    assert np.abs(held - distances(found)[0]).max() < 1e-6 * held.max()
    save(bake_vertices(load(target), replace(FAR, rays=16, max_distance=0.5)), again)
    assert again.read_text().count("mean_distance") == 1
    assert load(again).meshes[0].attributes["_MEAN_DISTANCE"].values.max() <= 0.5


def test_baking_a_gltf_file_again_replaces_it(tmp_path: Path, run: Run) -> None:
    plain, first, second = (tmp_path / name for name in ("a.glb", "b.glb", "c.glb"))
    save(bake_vertices(two(), BakeSettings(rays=16)), plain)
    flags = ("--rays=64", "--mean-distance")
    assert run("vertex", plain, "-o", first, *flags).status == 0
    assert run("vertex", first, "-o", second, *flags, "--max-distance=0.3").status == 0
    far, near = (
        load(path).meshes[0].attributes["_MEAN_DISTANCE"].values for path in (first, second)
    )
    assert far.max() > 1.0
    assert near.max() <= 0.3 + 1e-6


def test_gpu_instances_of_a_node_share_the_mean() -> None:
    one, other = np.array([1.0, 4.0], np.float32), np.array([3.0, np.nan], np.float32)
    assert mean_length([one, other]).tolist() == [2.0, 2.0]
    assert mean_occlusion([one / 4.0, other / 4.0]).tolist() == [0.5, 1.0]
    along = np.array([(2.0, 0.0, 0.0)], np.float32), np.array([(0.0, 2.0, 0.0)], np.float32)
    assert np.abs(mean_direction(along) - math.sqrt(0.5) * np.array([(1, 1, 0)])).max() < 1e-6


def test_a_format_without_a_place_for_it_refuses_before_the_bake(
    tmp_path: Path, corner: Path, run: Run
) -> None:
    ran = run("vertex", corner, "-o", tmp_path / "out.obj", "--mean-distance")
    assert ran.status == 1
    assert one_line(ran.err, "OBJ is not written with mean distance", "-o NAME.glb"), ran.err
    with pytest.raises(OutputError, match="mean distance"):
        save(baked(box(), replace(FAR, rays=1)), tmp_path / "out.usda")


def test_a_texture_has_no_place_for_it_and_says_what_has() -> None:
    with pytest.raises(SettingsError, match="falloff linear"):
        bake_texture(Scene.from_arrays(*box()), FAR)


def test_fitted_values_have_none_and_the_plan_says_what_is_kept() -> None:
    with pytest.raises(SettingsError, match=r"mean_distance is found at points.*lsq"):
        BakeSettings(method="lsq", mean_distance=True)
    effects = plan(two(), BakeSettings(method="auto", mean_distance=True)).effects
    assert not effects["method"].on
    assert effects["mean_distance"].on
    assert effects["mean_distance"].cost > 1.0
    assert not plan(two()).effects["mean_distance"].on

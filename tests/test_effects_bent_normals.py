"""Bent normals: the mean open direction, from the same rays."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from aobake import (
    BakeSettings,
    Instance,
    OutputError,
    Scene,
    SettingsError,
    bake_vertices,
    load,
    plan,
    save,
)
from tests.conftest import Run
from tests.scenes import (
    BESIDE_A_WALL,
    TURNED,
    Triangles,
    affine,
    box,
    floor,
    icosphere,
    joined,
    mesh_of,
    right_angle,
    unit,
)

# 1 / pi times the integral of (x, z) times the cosine over the quarter of the sphere that is open.
LEANING = unit((2.0 / (3.0 * math.pi), 0.0, 1.0 / 3.0))
BENT = BakeSettings(rays=2048, bent_normals=True)


def bent(mesh: Triangles, settings: BakeSettings = BENT) -> np.ndarray:
    found = bake_vertices(Scene.from_arrays(*mesh), settings).bent_normals
    assert found is not None
    return found[0]


def test_beside_a_wall_it_leans_away_by_the_closed_form() -> None:
    assert np.abs(bent(BESIDE_A_WALL)[0] - LEANING).max() < 3e-3


def test_with_uniform_directions_it_leans_more() -> None:
    """Without the cosine the means of x and z over a quarter of the sphere are the same: 45 degrees."""
    uniform = BakeSettings(rays=2048, bent_normals=True, distribution="uniform")
    assert np.abs(bent(BESIDE_A_WALL, uniform)[0] - unit((1.0, 0.0, 1.0))).max() < 5e-3


@pytest.mark.parametrize("effect", [(), ("open_sky=off",)])
def test_where_all_is_open_it_is_the_normal(effect: tuple[str, ...]) -> None:
    ball = icosphere(2)
    scene = Scene.from_arrays(*ball, normals=ball.vertices)
    found = bake_vertices(scene, BakeSettings(rays=1024, bent_normals=True, effect=effect))
    assert found.bent_normals is not None
    assert np.abs(found.bent_normals[0] - ball.vertices).max() < 2e-3


def test_where_nothing_is_open_it_is_the_normal() -> None:
    room = Triangles(icosphere(2).vertices, icosphere(2).faces[:, ::-1].copy())
    scene = Scene.from_arrays(room.vertices, room.faces, -room.vertices)
    found = bake_vertices(scene, BakeSettings(rays=64, bent_normals=True))
    assert found.bent_normals is not None
    assert not found.ao[0].any()
    assert np.abs(found.bent_normals[0] + room.vertices).max() < 1e-6


@pytest.mark.parametrize(
    "settings",
    [
        {"tolerance": 0.005},
        {"falloff": "linear", "max_distance": 1e6},
        {"ground": "+z"},
    ],
    ids=["tolerance", "falloff", "ground"],
)
def test_it_goes_with_other_effects(settings: dict[str, object]) -> None:
    """The ground is under all of it and changes nothing; far falloff hardly does."""
    given = BakeSettings(rays=1024, bent_normals=True, **settings)  # type: ignore[arg-type]
    assert np.abs(bent(BESIDE_A_WALL, given)[0] - LEANING).max() < 0.01


def corners() -> Scene:
    """A corner that stands as it is, turned, mirrored and sheared, far apart."""
    shear = np.eye(3)
    shear[0, 1] = 0.5
    linears = [np.eye(3), 2.0 * TURNED, np.diag([-1.0, 1.0, 1.0]), shear]
    return Scene(
        meshes=(mesh_of(right_angle(4.0), name="corner"),),
        instances=tuple(
            Instance(mesh=0, transform=affine(linear, (1e3 * k, 0.0, 0.0)), name=f"{k}")
            for k, linear in enumerate(linears)
        ),
    )


def test_it_is_in_the_space_of_the_mesh_as_normals_are() -> None:
    found = bake_vertices(corners(), BENT).bent_normals
    assert found is not None
    assert np.abs(found[1] - found[0]).max() < 0.02
    assert np.abs(found[2] - found[0]).max() < 0.02
    assert all(np.abs(np.linalg.norm(own, axis=1) - 1.0).max() < 1e-5 for own in found)


def test_bent_normals_survive_a_file_whatever_the_transforms(tmp_path: Path) -> None:
    """Read back and placed, they are the directions that were baked."""
    scene = corners()
    baked = bake_vertices(scene, BakeSettings(rays=256, bent_normals=True))
    assert baked.bent_normals is not None
    save(baked, tmp_path / "corners.glb")
    again = load(tmp_path / "corners.glb")
    for number, (instance, mesh) in enumerate(again.placed()):
        stored = mesh.attributes["_BENT_NORMAL"].values
        turned = stored @ np.linalg.inv(instance.transform[:3, :3])
        linear = scene.instances[number].transform[:3, :3]
        expected = baked.bent_normals[number] @ np.linalg.inv(linear)
        assert np.abs(unit_rows(turned) - unit_rows(expected)).max() < 1e-5


def unit_rows(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def test_baking_a_file_again_replaces_them(tmp_path: Path, run: Run) -> None:
    first, second, plain = (tmp_path / name for name in ("a.glb", "b.glb", "c.glb"))
    scene = Scene.from_arrays(*joined(floor(1.0, 0.0, 4), box((-0.2, -0.2, 0.1), (0.2, 0.2, 0.5))))
    save(bake_vertices(scene, BakeSettings(rays=16)), plain)
    assert run("vertex", plain, "-o", first, "--rays=64", "--bent-normals").status == 0
    assert run("vertex", first, "-o", second, "--rays=256", "--bent-normals").status == 0
    values = [load(path).meshes[0].attributes["_BENT_NORMAL"].values for path in (first, second)]
    assert not np.array_equal(values[0], values[1])
    assert np.abs(values[0] - values[1]).max() < 0.3


def test_a_format_without_a_place_for_them_refuses_before_the_bake(
    tmp_path: Path, corner: Path, run: Run
) -> None:
    ran = run("vertex", corner, "-o", tmp_path / "out.ply", "--bent-normals")
    assert ran.status == 1
    assert "PLY is not written with bent normals" in ran.err
    with pytest.raises(OutputError, match="bent normals"):
        save(bake_vertices(load(corner), BENT), tmp_path / "out.ply")


def test_fitted_values_have_none() -> None:
    with pytest.raises(SettingsError, match="lsq"):
        BakeSettings(method="lsq", bent_normals=True)
    chosen = plan(corners(), BakeSettings(method="auto", bent_normals=True))
    assert not chosen.effects["method"].on
    assert chosen.effects["bent_normals"].on


def test_without_them_there_is_nothing() -> None:
    assert bake_vertices(Scene.from_arrays(*box()), BakeSettings(rays=16)).bent_normals is None

"""Who occludes whom: by name, by itself alone, and where placements must look the same."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from aobake import (
    BakeSettings,
    Instance,
    Material,
    Scene,
    SettingsError,
    bake_texture,
    bake_vertices,
    plan,
    visibility,
)
from tests.scenes import FloatArray, Triangles, affine, box, floor, joined, mesh_of, moved, rotation

PLATE = floor(3.0, -0.5, 6)
CORNER = joined(box(), moved(box(), 0.5, (0.1, 0.0, 0.6)))  # occludes itself
TURNED = rotation((0.0, 0.0, 1.0), 0.5)


def scene(*extra: Instance) -> Scene:
    """A plate, and two of one body on it, one of them turned and larger."""
    return Scene(
        meshes=(mesh_of(PLATE, name="plate", material=0), mesh_of(CORNER, name="body")),
        instances=(
            Instance(mesh=0, name="ground plate"),
            Instance(mesh=1, transform=affine(1.0, (-1.0, 0.0, 0.01)), name="left"),
            Instance(mesh=1, transform=affine(1.3 * TURNED, (1.2, 0.0, 0.2)), name="right"),
            *extra,
        ),
        materials=(Material(name="stone"),),
    )


def baked(settings: BakeSettings, of: Scene | None = None) -> list[np.ndarray]:
    return list(bake_vertices(of or scene(), settings).ao)


def alone(shape: Triangles, **settings: object) -> np.ndarray:
    given = BakeSettings(rays=1024, **settings)  # type: ignore[arg-type]
    return bake_vertices(Scene.from_arrays(*shape), given).ao[0]


def test_by_itself_each_object_is_as_it_would_be_alone() -> None:
    plate, left, right = baked(BakeSettings(rays=1024, occluders=("own",)))
    assert (plate == 1.0).all()
    assert np.abs(left - alone(CORNER)).max() < 0.01
    assert np.array_equal(left, right), "turned and larger, but the same"


def test_by_itself_on_a_ground_each_object_has_the_ground_too() -> None:
    settings = BakeSettings(rays=1024, occluders=("own",), ground="+z", max_distance=100.0)
    _, left, right = baked(settings)
    standing = moved(CORNER, 1.0, (-1.0, 0.0, 0.01))
    ground = moved(floor(1.0), 1e4, (0.0, 0.0, -0.5))
    both = alone(joined(standing, ground), max_distance=100.0)[: len(left)]
    assert np.abs(left - both).max() < 0.01
    assert not np.array_equal(left, right)


@pytest.mark.parametrize(
    "names", [("plate",), ("ground plate",), ("stone",), ("gr*",), ("plate", "ston?")]
)
def test_names_are_those_of_meshes_nodes_and_materials(names: tuple[str, ...]) -> None:
    plate, left, _ = baked(BakeSettings(rays=256, occluders=names))
    assert (plate == 1.0).all(), "nothing stands on it that occludes"
    by_all = baked(BakeSettings(rays=256))[1]
    assert (left >= by_all - 0.05).all()
    assert by_all.mean() + 0.1 < left.mean() < 0.9, "occluded by the plate, and not by itself"


def test_what_is_excluded_is_baked_and_hides_nothing() -> None:
    everything = baked(BakeSettings(rays=256))
    without = baked(BakeSettings(rays=256, exclude=("left",)))
    gone = baked(BakeSettings(rays=256, exclude=("body",)))
    assert (gone[0] == 1.0).all()
    assert without[0].mean() > everything[0].mean() + 0.01
    assert without[1].mean() < 0.95, "the plate occludes it"
    assert np.array_equal(gone[1], baked(BakeSettings(rays=256, occluders=("plate",)))[1])


def test_the_same_holds_in_textures() -> None:
    settings = BakeSettings(rays=64, size=64, denoise="off", occluders=("plate",), atlas="mesh")
    images = bake_texture(scene(), settings).images
    assert (images[0] == 1.0).all()
    by_itself = BakeSettings(rays=64, size=64, denoise="off", occluders=("own",), atlas="mesh")
    assert (bake_texture(scene(), by_itself).images[0] == 1.0).all()


@pytest.mark.parametrize(
    ("field", "settings"),
    [
        ("occluders", BakeSettings(occluders=("lft",))),
        ("exclude", BakeSettings(exclude=("lft",))),
    ],
)
def test_an_unknown_name_is_refused_with_the_nearest_one(
    field: str, settings: BakeSettings
) -> None:
    bakes: tuple[Callable[[Scene, BakeSettings], object], ...] = (bake_vertices, bake_texture, plan)
    for bake in bakes:
        with pytest.raises(SettingsError, match=f"{field} is 'lft'.*Did you mean \"left\""):
            bake(scene(), settings)


def test_a_scene_without_names_says_so() -> None:
    with pytest.raises(SettingsError, match="nothing in the scene has a name"):
        bake_vertices(Scene.from_arrays(*box()), BakeSettings(exclude=("box",)))


def test_points_that_are_on_no_object_have_no_occluders_of_their_own() -> None:
    with pytest.raises(SettingsError, match="on no object"):
        visibility(scene(), [(0, 0, 2)], [(0, 0, 1)], BakeSettings(occluders=("own",)))


def test_one_word_is_a_name_too() -> None:
    assert BakeSettings(occluders="own").occluders == ("own",)  # type: ignore[arg-type]
    assert BakeSettings(exclude=["a", "b"]).exclude == ("a", "b")  # type: ignore[arg-type]


FAR_APART = [
    Instance(mesh=1, transform=affine(rotation((1, 2, 3), float(k)), (20.0 * k, 50.0, 0.0)))
    for k in range(4)
]


def test_placements_that_nothing_reaches_share_one_bake() -> None:
    limited = BakeSettings(rays=256, max_distance=2.0)
    found = bake_vertices(scene(*FAR_APART), limited)
    assert all(np.array_equal(found.ao[3], ao) for ao in found.ao[4:])
    traced = bake_vertices(
        scene(*FAR_APART), BakeSettings(rays=256, max_distance=2.0, effect=("sharing=off",))
    )
    assert traced.rays - found.rays == 3 * 256 * len(CORNER.vertices)
    for copy, own in zip(found.ao, traced.ao, strict=True):
        assert np.abs(copy - own).max() < 0.05
    assert "3 placements copy others" in found.plan.effects["sharing"].reason
    assert found.plan.effects["sharing"].on
    assert not traced.plan.effects["sharing"].on


@pytest.mark.parametrize(
    ("other", "settings"),
    [
        (affine(1.0, (-17.0, 50.0, 0.0)), BakeSettings(rays=64, max_distance=20.0)),
        (affine(2.0, (30.0, 50.0, 0.0)), BakeSettings(rays=64, max_distance=2.0)),
        (affine(np.diag([1, 1, 2]), (30.0, 50.0, 0.0)), BakeSettings(rays=64, max_distance=2.0)),
        (affine(1.0, (30.0, 50.0, 0.0)), BakeSettings(rays=64)),
        (affine(1.0, (30.0, 50.0, 0.0)), BakeSettings(rays=64, max_distance=2.0, ground="+z")),
    ],
    ids=["within reach", "larger", "stretched", "no limit", "near the ground"],
)
def test_placements_that_may_differ_are_all_traced(
    other: FloatArray, settings: BakeSettings
) -> None:
    first = Instance(mesh=1, transform=affine(1.0, (0.0, 50.0, 0.0)))
    found = plan(scene(first, Instance(mesh=1, transform=other)), settings)
    assert not found.effects["sharing"].on


def test_a_mirrored_copy_is_shared_and_bent_normals_are_not_turned() -> None:
    mirrored = Instance(mesh=1, transform=affine(np.diag([-1, 1, 1]), (30.0, 50.0, 0.0)))
    first = Instance(mesh=1, transform=affine(1.0, (0.0, 50.0, 0.0)))
    limited = BakeSettings(rays=64, max_distance=2.0)
    assert plan(scene(first, mirrored), limited).effects["sharing"].on
    bent = BakeSettings(rays=64, max_distance=2.0, bent_normals=True)
    assert not plan(scene(first, mirrored), bent).effects["sharing"].on

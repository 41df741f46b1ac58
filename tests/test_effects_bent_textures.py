"""Bent normals as a texture: the mean open direction at each texel, as a normal map would hold it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake import (
    BakedTexture,
    BakeSettings,
    ImageSettings,
    Instance,
    OutputError,
    Scene,
    bake_texture,
    bake_vertices,
    load,
    save,
)
from aobake.atlas.lookup import sample
from aobake.images import decode
from aobake.meshes.formats.gltf.document import open_document
from aobake.meshes.lightmap import Unwrapped
from aobake.meshes.scene import Attribute
from aobake.plan import texture_plan
from tests.conftest import Run
from tests.scenes import (
    UP,
    WALL,
    FloatArray,
    affine,
    flipped,
    floor,
    icosphere,
    mesh_of,
    moved,
    patch,
    rotation,
    unit,
)

WALL_AT_1 = moved(flipped(WALL), 1.0, (1.0, 0.0, 0.0))
# Of the quarter of the sphere that is open beside an endless wall: as in test_effects_bent_normals.py.
LEANING = unit((-2.0 / math.pi, 0.0, 1.0))
SETTINGS = BakeSettings(size=32, rays=256, denoise="off", atlas="mesh", bent_normals=True)
GROUND = floor(0.6, cells=4)


def uv_of(vertices: FloatArray, way: str = "upright") -> Attribute:
    """Texture coordinates of the floor; v runs down, so that upright y does too."""
    x, y = (vertices[:, 0] / 0.6 + 1.0) / 2.0, (vertices[:, 1] / 0.6 + 1.0) / 2.0
    ways = {
        "upright": (x, y),
        "mirrored": (1.0 - x, y),
        "turned": (y, 1.0 - x),
    }
    return Attribute(values=np.stack(ways[way], axis=1))


def beside_a_wall(way: str = "upright", transform: FloatArray | None = None) -> Scene:
    """The floor, laid out that way and standing there, before a wall without an end at x = 1."""
    uv = uv_of(GROUND.vertices, way)
    ground = mesh_of(GROUND, name="floor", attributes={"TEXCOORD_0": uv})
    stands = affine() if transform is None else transform
    return Scene(
        meshes=(ground, mesh_of(WALL_AT_1, name="wall")),
        instances=(Instance(mesh=0, transform=stands), Instance(mesh=1)),
    )


def directions(found: BakedTexture, page: int = 0) -> NDArray[np.float32]:
    """(T, 3) of the texels of a page."""
    assert found.bent_normals is not None
    return found.bent_normals[page][found.coverages[page]]


@pytest.mark.parametrize("space", ["tangent", "object"])
def test_on_a_flat_floor_it_is_straight_up_in_the_gutters_as_well(space: Any) -> None:
    strip = patch((-1, -0.2, 0), (1, -0.2, 0), (1, 0.2, 0), (-1, 0.2, 0))
    found = bake_texture(
        Scene.from_arrays(*strip),
        BakeSettings(size=128, rays=256, bent_normals=True, bent_space=space, uv="unwrap"),
    )
    assert found.bent_normals is not None
    assert found.bent_normals[0].shape == (128, 128, 3)
    assert found.coverage.mean() < 0.4  # and much of the rest is far from it
    assert np.abs(found.bent_normals[0] - UP).max() < 1 / 255


@pytest.mark.parametrize("way", ["upright", "mirrored", "turned"])
@pytest.mark.parametrize(
    "linear",
    [np.eye(3), rotation((0, 0, 1), 1.0), np.diag([-1.0, 1.0, 1.0]), np.diag([1.0, 0.5, 3.0])],
    ids=["as it is", "turned", "mirrored", "stretched"],
)
def test_along_tangents_it_leans_away_from_a_wall_however_the_floor_is_laid_out(
    way: str, linear: FloatArray
) -> None:
    """Put back together from the tangents of the layout, and those from its gradients."""
    found = bake_texture(beside_a_wall(way, affine(linear)), SETTINGS)
    along = {"upright": (1, 0, 0), "mirrored": (-1, 0, 0), "turned": (0, 1, 0)}[way]
    down = {"upright": (0, 1, 0), "mirrored": (0, 1, 0), "turned": (-1, 0, 0)}[way]
    axes = [linear @ along, -(linear @ down), UP]
    frame = np.stack([axis / np.linalg.norm(axis) for axis in axes])
    held = directions(found)
    assert np.abs(held @ frame - LEANING).max() < 0.06
    assert np.abs((held @ frame).mean(axis=0) - LEANING).max() < 0.004
    assert np.abs(np.linalg.norm(held, axis=1) - 1.0).max() < 1e-6


@pytest.mark.parametrize("supersample", [1, 2])
def test_in_the_space_of_the_mesh_it_is_what_vertices_have(supersample: int) -> None:
    scene = beside_a_wall("turned", affine(rotation((0, 0, 1), 0.5)))
    settings = BakeSettings(
        size=32, rays=512, denoise="off", atlas="mesh", bent_normals=True,
        bent_space="object", supersample=supersample, method="point",
    )  # fmt: skip
    at_vertices = bake_vertices(scene, settings).bent_normals
    found = bake_texture(scene, settings).bent_normals
    assert at_vertices is not None
    assert found is not None
    texels = sample(found[0], scene.meshes[0].attributes["TEXCOORD_0"].values, ("clamp", "clamp"))
    assert np.abs(texels - at_vertices[0]).max() < 0.03


def test_a_mesh_that_has_no_coordinates_takes_those_of_its_new_layout() -> None:
    """A ball under a lid: what its texels hold leans from the normal as far as in the space of the mesh."""
    ball = icosphere(3)
    lid = patch((-9, -9, 1.2), (-9, 9, 1.2), (9, 9, 1.2), (9, -9, 1.2))
    meshes = (
        mesh_of(ball, normals=ball.vertices, name="ball"),
        mesh_of(lid, name="lid"),
    )
    scene = Scene(meshes=meshes, instances=(Instance(mesh=0), Instance(mesh=1)))
    settings = replace(SETTINGS, size=96)
    along = bake_texture(scene, settings)
    own = bake_texture(scene, replace(settings, bent_space="object"))
    placing = along.lightmap.placings[0]
    assert placing is not None
    layout = placing.layout
    assert isinstance(layout, Unwrapped)
    places = layout.uv[layout.faces].mean(axis=1)
    normal = ball.vertices[ball.faces].mean(axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    assert along.bent_normals is not None
    assert own.bent_normals is not None
    lean = sample(along.bent_normals[0], places)[:, 2]
    held = sample(own.bent_normals[0], places)
    assert np.abs((held * normal).sum(axis=1) - lean).max() < 0.05
    assert lean.min() < 0.8
    assert held[normal[:, 2] > 0.0, 2].mean() < normal[normal[:, 2] > 0.0, 2].mean() - 0.1


def test_what_is_stored_together_has_the_mean_of_its_instances() -> None:
    """One floor beside the wall, one far from it: between leaning and straight up, by how open each is."""
    scene = beside_a_wall()
    away = affine(1.0, (-1e6, 0.0, 0.0))
    both = Scene(
        meshes=scene.meshes,
        instances=(
            Instance(mesh=0, stored_with=0),
            Instance(mesh=0, transform=away, stored_with=0),
            Instance(mesh=1),
        ),
    )
    expected = 0.5 * LEANING + 1.0 * UP  # half of the sky is open beside the wall
    expected /= np.linalg.norm(expected)
    held = directions(bake_texture(both, SETTINGS)) * (1.0, -1.0, 1.0)
    assert np.abs(held.mean(axis=0) - expected).max() < 0.01


def test_it_changes_nothing_of_the_occlusion_and_the_plan_says_what_it_costs() -> None:
    scene = beside_a_wall()
    plain = replace(SETTINGS, bent_normals=False)
    with_it, without = bake_texture(scene, SETTINGS), bake_texture(scene, plain)
    assert without.bent_normals is None
    for one, other in zip(with_it.images, without.images, strict=True):
        assert one.tobytes() == other.tobytes()
    effect = texture_plan(scene, SETTINGS).effects["bent_normals"]
    assert effect.on
    assert effect.cost > 1.0
    assert not texture_plan(scene, plain).effects["bent_normals"].on


def pixels(path: Path) -> NDArray[np.float32]:
    """(H, W, 3) directions that an image holds."""
    return 2.0 * decode(path.read_bytes(), path.name) - 1.0


@pytest.mark.parametrize("name", ["a.png", "a.exr", "a.tif"])
def test_an_image_alone_gets_one_beside_it(tmp_path: Path, name: str) -> None:
    found = bake_texture(beside_a_wall(), SETTINGS)
    assert found.bent_normals is not None
    written = save(found, tmp_path / name, image=ImageSettings())
    ending = Path(name).suffix
    assert [path.name for path in written] == [
        name, f"a_2{ending}", f"a_bent_normal{ending}", f"a_bent_normal_2{ending}",
    ]  # fmt: skip
    for path, held in zip(written[2:], found.bent_normals, strict=True):
        assert np.abs(pixels(path) - held).max() < 2.1 / 255


@pytest.mark.parametrize("name", ["a.glb", "a.gltf"])
def test_a_material_of_gltf_names_them_in_its_extras(tmp_path: Path, name: str) -> None:
    found = bake_texture(beside_a_wall(), replace(SETTINGS, bent_space="object"))
    assert found.bent_normals is not None
    written = save(found, tmp_path / name)
    if name == "a.gltf":
        assert {"a_bent_normal.png", "a_bent_normal2.png"} <= {path.name for path in written}
        assert np.abs(pixels(tmp_path / "a_bent_normal.png") - found.bent_normals[0]).max() < 0.01
    document = open_document(written[0], None).json
    materials: Any = document["materials"]
    textures: Any = document["textures"]
    images: Any = document["images"]
    for material in materials:
        held = material["extras"]["bentNormalTexture"]
        assert held["space"] == "object"
        assert held["index"] != material["occlusionTexture"]["index"]
        assert held.get("texCoord", 0) == material["occlusionTexture"].get("texCoord", 0)
        assert textures[held["index"]]["source"] < len(images)


def test_a_bake_without_them_takes_them_out_and_leaves_other_extras(tmp_path: Path) -> None:
    found = bake_texture(beside_a_wall(), SETTINGS)
    save(found, tmp_path / "a.gltf")
    text = (tmp_path / "a.gltf").read_text()
    (tmp_path / "a.gltf").write_text(
        text.replace('"bentNormalTexture"', '"mine":3,"bentNormalTexture"')
    )
    again = bake_texture(load(tmp_path / "a.gltf"), replace(SETTINGS, bent_normals=False))
    save(again, tmp_path / "b.gltf")
    materials: Any = open_document(tmp_path / "b.gltf", None).json["materials"]
    assert [material["extras"] for material in materials] == [{"mine": 3}] * 2


def test_extras_that_are_no_object_are_refused(tmp_path: Path) -> None:
    save(bake_texture(beside_a_wall(), replace(SETTINGS, bent_normals=False)), tmp_path / "a.gltf")
    text = (tmp_path / "a.gltf").read_text()
    (tmp_path / "a.gltf").write_text(
        text.replace('"occlusionTexture"', '"extras":7,"occlusionTexture"')
    )
    found = bake_texture(load(tmp_path / "a.gltf"), SETTINGS)
    with pytest.raises(OutputError, match="extras are no object"):
        save(found, tmp_path / "b.gltf")


def test_an_obj_file_names_them_in_its_library_and_takes_the_same_name_again(
    tmp_path: Path,
) -> None:
    found = bake_texture(beside_a_wall(), SETTINGS)
    for _ in range(2):
        written = save(found, tmp_path / "a.obj", force=True)
        names = {path.name for path in written}
        assert names == {
            "a.obj", "a.mtl", "a_ao.png", "a_ao2.png", "a_bent_normal.png", "a_bent_normal2.png",
        }  # fmt: skip
    assert "map_bent_normal a_bent_normal.png" in (tmp_path / "a.mtl").read_text()
    assert found.bent_normals is not None
    assert np.abs(pixels(tmp_path / "a_bent_normal.png") - found.bent_normals[0]).max() < 0.01


def test_an_obj_file_whose_new_coordinates_would_bend_the_tangents_is_refused(
    tmp_path: Path,
) -> None:
    found = bake_texture(beside_a_wall(), replace(SETTINGS, uv="unwrap"))
    with pytest.raises(OutputError, match="--bent-space object"):
        save(found, tmp_path / "a.obj")
    own = bake_texture(beside_a_wall(), replace(SETTINGS, uv="unwrap", bent_space="object"))
    assert save(own, tmp_path / "a.obj")


def test_the_command_writes_them(run: Run, tmp_path: Path) -> None:
    save(bake_texture(beside_a_wall(), replace(SETTINGS, bent_normals=False)), tmp_path / "a.glb")
    ran = run(
        "texture", tmp_path / "a.glb", "-o", tmp_path / "b.png", "--bent-normals",
        "--bent-space", "object", "--size", "32", "--rays", "16",
    )  # fmt: skip
    assert ran.status == 0, ran.err
    assert (tmp_path / "b_bent_normal.png").is_file()

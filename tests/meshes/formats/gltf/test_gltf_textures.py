"""Materials with their textures: which image, through which set, turned and wrapped how."""

from __future__ import annotations

import base64
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from aobake.errors import InputError
from aobake.meshes.formats.gltf.gradient import gradient_png
from aobake.meshes.materials import Material, Texture
from aobake.meshes.scene import Scene
from tests.meshes.formats.gltf.build import Builder, Json, load

PNG = gradient_png()


def scene_with(path: Path, material: Json, **lists: list[Json]) -> Scene:
    """A square of this material, read from a file; one texture of one image unless others are given."""
    builder = Builder()
    builder.json |= {"textures": [{"source": 0}], "images": [{"uri": "a.png"}], **lists}
    number = builder.put("materials", material)
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(material=number))))
    return load(builder.glb(path / "a.glb"))


def material_with(path: Path, material: Json, **lists: list[Json]) -> Material:
    return scene_with(path, material, **lists).materials[0]


def texture_with(path: Path, info: Json, **lists: list[Json]) -> Texture | None:
    """The base colour texture of a textureInfo."""
    look = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **info}}}
    return material_with(path, look, **lists).base_color_texture


def moved(**transform: Any) -> Json:
    return {"extensions": {"KHR_texture_transform": transform}}


def looked_up(texture: Texture | None, u: float, v: float) -> list[float]:
    assert texture is not None
    assert texture.transform is not None
    assert texture.transform.shape == (2, 3)
    return [float(value) for value in texture.transform @ (u, v, 1.0)]


def test_every_texture_of_a_material_is_read(tmp_path: Path) -> None:
    look = {
        "name": "wood",
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0},
            "metallicRoughnessTexture": {"index": 1, "texCoord": 1},
            "baseColorFactor": [0.5, 0.25, 1, 0.75],
            "metallicFactor": 0.125,
            "roughnessFactor": 0.375,
        },
        "normalTexture": {"index": 2, "scale": 0.5},
        "occlusionTexture": {"index": 1, "strength": 0.25, "texCoord": 2},
        "emissiveTexture": {"index": 0},
        "emissiveFactor": [1, 0.5, 0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}},
        "alphaMode": "MASK",
        "alphaCutoff": 0.25,
        "doubleSided": True,
    }
    textures = [{"source": 2}, {"source": 0}, {"source": 1}]
    found = material_with(
        tmp_path, look, textures=textures, images=[{"uri": f"{k}"} for k in range(3)]
    )
    pairs = [
        (texture.image, texture.uv_set)
        for texture in (
            found.base_color_texture,
            found.metallic_roughness_texture,
            found.normal_texture,
            found.occlusion_texture,
            found.emissive_texture,
        )
        if texture is not None
    ]
    assert pairs == [(2, 0), (0, 1), (1, 0), (0, 2), (2, 0)]
    assert (found.base_color, found.metallic, found.roughness) == (
        (0.5, 0.25, 1, 0.75),
        0.125,
        0.375,
    )
    assert (found.normal_scale, found.occlusion_strength, found.emissive) == (0.5, 0.25, (4, 2, 0))
    assert (found.name, found.alpha_mode, found.alpha_cutoff, found.double_sided) == (
        "wood", "MASK", 0.25, True,
    )  # fmt: skip


def test_a_plain_material_has_the_defaults_of_gltf(tmp_path: Path) -> None:
    found = material_with(tmp_path, {})
    assert (found.base_color, found.metallic, found.roughness) == ((1, 1, 1, 1), 1, 1)
    assert (found.emissive, found.normal_scale, found.occlusion_strength) == ((0, 0, 0), 1, 1)
    assert (found.base_color_texture, found.normal_texture, found.occlusion_texture) == (None,) * 3


def test_a_texture_lies_where_it_is_unless_it_is_moved(tmp_path: Path) -> None:
    for info in ({}, moved(), moved(offset=[0, 0], scale=[1, 1], rotation=0)):
        texture = texture_with(tmp_path, info)
        assert texture is not None
        assert texture.transform is None


def test_a_rotation_is_counter_clockwise_as_the_image_is_seen(tmp_path: Path) -> None:
    """v runs down, so a quarter turn takes what lies right of the corner to above it."""
    texture = texture_with(tmp_path, moved(rotation=math.pi / 2))
    assert_allclose(looked_up(texture, 1.0, 0.0), [0.0, -1.0], atol=1e-15)
    assert_allclose(looked_up(texture, 0.0, 1.0), [1.0, 0.0], atol=1e-15)


def test_scale_comes_before_rotation_and_the_offset_last(tmp_path: Path) -> None:
    texture = texture_with(tmp_path, moved(offset=[0.5, 0.25], rotation=math.pi / 2, scale=[2, 3]))
    assert_allclose(looked_up(texture, 1.0, 0.0), [0.5, -2.0 + 0.25], atol=1e-15)
    assert_allclose(looked_up(texture, 0.0, 1.0), [3.0 + 0.5, 0.25], atol=1e-15)


def test_the_transform_may_name_another_set(tmp_path: Path) -> None:
    plain = texture_with(tmp_path, {"texCoord": 1, **moved(scale=[2, 2])})
    other = texture_with(tmp_path, {"texCoord": 1, **moved(texCoord=3)})
    assert plain is not None
    assert other is not None
    assert (plain.uv_set, other.uv_set) == (1, 3)


def test_samplers_say_how_a_texture_goes_on_and_is_filtered(tmp_path: Path) -> None:
    samplers: list[Json] = [
        {"wrapS": 33071, "wrapT": 33648, "magFilter": 9728},
        {"wrapS": 10497, "magFilter": 9729, "minFilter": 9728},
    ]
    found = [
        texture_with(tmp_path, {}, samplers=samplers, textures=[{"source": 0, **more}])
        for more in ({"sampler": 0}, {"sampler": 1}, {})
    ]
    assert [(t.wrap, t.nearest) for t in found if t is not None] == [
        (("clamp", "mirror"), True),
        (("repeat", "repeat"), False),
        (("repeat", "repeat"), False),
    ]


@pytest.mark.parametrize(
    "extension",
    ["EXT_texture_webp", "EXT_texture_avif", "KHR_texture_basisu", "MSFT_texture_dds"],
)
def test_an_image_in_another_encoding_is_taken_where_there_is_no_plain_one(
    tmp_path: Path, extension: str
) -> None:
    images: list[Json] = [{"uri": "plain.png"}, {"uri": "other"}]
    other = {"extensions": {extension: {"source": 1}}}
    both = texture_with(tmp_path, {}, images=images, textures=[{"source": 0, **other}])
    alone = texture_with(tmp_path, {}, images=images, textures=[other])
    assert both is not None
    assert alone is not None
    assert (both.image, alone.image) == (0, 1)


def test_a_texture_without_any_image_is_none(tmp_path: Path) -> None:
    assert texture_with(tmp_path, {}, textures=[{}]) is None


GLOSSY = {
    "KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 0.25, 0, 1],
        "diffuseTexture": {"index": 0},
        "glossinessFactor": 0.75,
    }
}


def test_specular_glossiness_gives_its_diffuse_color(tmp_path: Path) -> None:
    found = material_with(tmp_path, {"extensions": GLOSSY})
    assert (found.base_color, found.metallic, found.roughness) == ((0.5, 0.25, 0, 1), 0, 0.25)
    assert found.base_color_texture is not None


def test_a_material_that_has_both_models_is_of_ours(tmp_path: Path) -> None:
    look = {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}, "extensions": GLOSSY}
    found = material_with(tmp_path, look)
    assert (found.base_color, found.base_color_texture) == ((1, 0, 0, 1), None)


@pytest.mark.parametrize(
    ("info", "lists", "said"),
    [
        ({"index": 7}, {}, "index is 7, and the file has 1 textures"),
        ({"index": -1}, {}, "index is -1"),
        ({}, {"textures": [{"source": 5}]}, "source is 5, and the file has 1 images"),
        ({}, {"textures": [{"source": 0, "sampler": 2}]}, "sampler is 2"),
        ({}, {"textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 1}]}, "wrapS is 1"),
        (moved(rotation="x"), {}, "rotation is 'x'"),
    ],
)
def test_a_texture_that_points_nowhere_is_passed_over_with_a_line(
    tmp_path: Path, info: Json, lists: dict[str, list[Json]], said: str
) -> None:
    look = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **info}}}
    scene = scene_with(tmp_path, look, **lists)
    assert scene.materials[0].base_color_texture is None
    assert len(scene.warnings) == 1
    assert said in scene.warnings[0]
    assert "\n" not in scene.warnings[0]


def test_images_lie_in_views_in_data_and_beside_the_file(tmp_path: Path) -> None:
    builder = Builder()
    (tmp_path / "a b.png").write_bytes(PNG)
    view = builder.view(PNG)
    data = "data:image/png;base64," + base64.b64encode(PNG).decode()
    builder.json["images"] = [
        {"bufferView": view, "mimeType": "image/png", "name": "inside"}, {"uri": data}, {"uri": "a%20b.png"},
    ]  # fmt: skip
    builder.show(builder.node(mesh=builder.mesh()))
    images = load(builder.glb(tmp_path / "a.glb")).images
    assert [image.data() for image in images] == [PNG] * 3
    assert images[0].name.endswith('a.glb: image 0 "inside"')


@pytest.mark.parametrize(
    ("image", "said"),
    [
        ({"uri": "missing.png"}, "there is no such file"),
        ({"uri": "../above.png"}, "--root"),
        ({"uri": "https://example.org/a.png"}, "nothing is fetched"),
        ({"uri": "data:image/png;base64,§"}, "no base64"),
        ({"bufferView": 99}, "bufferView is 99"),
        ({}, "neither a uri nor a bufferView"),
    ],
)
def test_an_image_that_cannot_be_had_stops_no_load_and_is_one_line_when_wanted(
    tmp_path: Path, image: Json, said: str
) -> None:
    (tmp_path / "above.png").write_bytes(PNG)
    folder = tmp_path / "inner"
    folder.mkdir()
    scene = scene_with(folder, {}, images=[image])
    assert scene.warnings == ()
    with pytest.raises(InputError) as caught:
        scene.images[0].data()
    assert said in str(caught.value)
    assert "image 0" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_transforms_are_read_only(tmp_path: Path) -> None:
    texture = texture_with(tmp_path, moved(scale=[2, 2]))
    assert texture is not None
    assert texture.transform is not None
    assert_array_equal(texture.transform, [[2, 0, 0], [0, 2, 0]])
    with pytest.raises(ValueError, match="read-only"):
        texture.transform[0, 0] = np.float64(3)

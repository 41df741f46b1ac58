"""Lightmaps in glTF: materials and images, packed or beside, and those of a bake before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aobake import files
from aobake.errors import OutputError
from aobake.images import decode, encode
from aobake.meshes.formats import check_texture_target
from aobake.meshes.formats.gltf.document import open_document
from aobake.meshes.lightmap import Kept
from aobake.settings import Encoding, ImageSettings
from tests.meshes.formats.gltf.build import (
    UV,
    Builder,
    load,
    mapped,
    square_builder,
    textures_of,
    unpack_glb,
)
from tests.meshes.formats.lightmaps import (
    at_corners,
    explode_all,
    exploded,
    lightmap,
    page,
    smooth,
    steps,
    write,
)


def test_materials_are_copied_where_something_else_needs_them(tmp_path: Path) -> None:
    """Points keep the original; each image has a copy; variants lead to copies as well."""
    builder = Builder()
    builder.put("materials", {"name": "wood"})
    builder.put("materials", {"name": "gold"})
    variants = {
        "KHR_materials_variants": {"mappings": [{"material": 1, "variants": [0]}]},
    }
    first = builder.primitive(material=0, extensions=variants)
    second = builder.primitive(material=0)
    points = {**builder.primitive(indices=None), "mode": 0, "material": 0}
    bare = builder.primitive()
    builder.show(builder.node(mesh=builder.mesh(first, second, points, bare)))
    scene = load(builder.glb(tmp_path / "a.glb"))
    found = lightmap(*map(smooth, scene.meshes), pages=(page(0), page(1)))
    write(scene, found, tmp_path / "b.glb")
    json = unpack_glb(tmp_path / "b.glb")[0]
    materials = json["materials"]
    parts = json["meshes"][0]["primitives"]
    assert materials[0] == {"name": "wood"}
    assert parts[2] == unpack_glb(tmp_path / "a.glb")[0]["meshes"][0]["primitives"][2]
    named = [materials[parts[number]["material"]] for number in (0, 1, 3)]
    assert [material.get("name") for material in named] == ["wood_ao", "wood_ao", None]
    images = textures_of(tmp_path / "b.glb")
    for number, value in ((0, page(0)), (1, page(1)), (3, page(1))):
        image = images[f"{parts[number]['material']} occlusionTexture"]
        np.testing.assert_array_equal(steps(image[:, :, 0]), steps(value))
    mapping = parts[0]["extensions"]["KHR_materials_variants"]["mappings"][0]
    assert materials[mapping["material"]]["name"] == "gold"
    assert materials[mapping["material"]]["occlusionTexture"] == named[0]["occlusionTexture"]


def test_a_material_on_two_images_becomes_two(tmp_path: Path) -> None:
    builder = Builder()
    builder.put("materials", {"name": "wood"})
    parts = [builder.primitive(material=0) for _ in range(3)]
    scene = load(builder.show(builder.node(mesh=builder.mesh(*parts))).glb(tmp_path / "a.glb"))
    found = lightmap(*map(smooth, scene.meshes), pages=(page(0), page(1)))
    write(scene, found, tmp_path / "b.glb")
    json = unpack_glb(tmp_path / "b.glb")[0]
    assert [part["material"] for part in json["meshes"][0]["primitives"]] == [0, 1, 1]
    images = textures_of(tmp_path / "b.glb")
    for number in (0, 1):
        image = images[f"{number} occlusionTexture"]
        np.testing.assert_array_equal(steps(image[:, :, 0]), steps(page(number)))


def orm_square(size: int = 8, encoding: Encoding = "8", **info: Any) -> Builder:
    """A square whose metallic-roughness image is (size, size); info: of its texture reference."""
    pixels = np.stack([page(n, size, size) for n in (1, 2, 3)], axis=2)
    pixels[0, 0] = 1 / 65535  # a step of 16 bits alone
    builder = mapped(
        {
            "name": "metal",
            "pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0, **info}},
        }
    )
    view = builder.view(encode(pixels, "png", encoding))
    builder.put("images", {"bufferView": view, "mimeType": "image/png"})
    builder.put("samplers", {"wrapS": 33648})
    builder.put("textures", {"source": 0, "sampler": 0})
    return builder


@pytest.mark.parametrize(("before", "encoding"), [("8", "8"), ("8", "16"), ("16", "8")])
def test_packing_changes_the_red_of_a_copy(
    tmp_path: Path, before: Encoding, encoding: Encoding
) -> None:
    """Green and blue are what they were, in 16 bits if they had as many."""
    source = orm_square(encoding=before).glb(tmp_path / "a.glb")
    settings = ImageSettings(pack="orm", encoding=encoding)
    scene, found = load(source), lightmap(Kept(uv_set=0))
    assert check_texture_target(scene, tmp_path / "b.glb", settings, found) == ()
    write(scene, found, tmp_path / "b.glb", settings)
    json = unpack_glb(tmp_path / "b.glb")[0]
    assert json["textures"] == [{"source": 0, "sampler": 0}, {"sampler": 0, "source": 1}]
    assert json["materials"][0]["occlusionTexture"] == {"index": 1}
    images = textures_of(tmp_path / "b.glb")
    np.testing.assert_array_equal(
        images["0 metallicRoughnessTexture"], images["0 occlusionTexture"]
    )
    old, new = textures_of(source)["0 metallicRoughnessTexture"], images["0 occlusionTexture"]
    np.testing.assert_allclose(new[:, :, 0], page(), atol=1e-6)
    np.testing.assert_allclose(new[:, :, 1:], old[:, :, 1:], rtol=0, atol=1e-6)
    assert not np.array_equal(old[:, :, 0], new[:, :, 0])


@pytest.mark.parametrize(
    ("builder", "layout", "words"),
    [
        (lambda: orm_square(16), Kept(uv_set=0), "has 16 x 16 pixels, and the occlusion 8 x 8"),
        (orm_square, None, "is on TEXCOORD_0, and the occlusion on TEXCOORD_1"),
        (
            lambda: orm_square(extensions={"KHR_texture_transform": {"scale": [2, 2]}}),
            Kept(uv_set=0),
            "is transformed",
        ),
        (lambda: mapped({"name": "metal"}), Kept(uv_set=0), "has no metallic-roughness image"),
    ],
)
def test_what_cannot_be_packed_stays_apart_and_says_why(
    tmp_path: Path, builder: Any, layout: Kept | None, words: str
) -> None:
    scene = load(builder().glb(tmp_path / "a.glb"))
    found = lightmap(layout or exploded(scene.meshes[0]))
    settings = ImageSettings(pack="orm")
    (note,) = check_texture_target(scene, tmp_path / "b.glb", settings, found)
    assert 'material 0 "metal"' in note
    assert words in note
    write(scene, found, tmp_path / "b.glb", settings)
    json = unpack_glb(tmp_path / "b.glb")[0]
    before = unpack_glb(tmp_path / "a.glb")[0]["materials"][0]
    material = json["materials"][0]
    occlusion = material.pop("occlusionTexture")
    assert material == before
    image = textures_of(tmp_path / "b.glb")["0 occlusionTexture"]
    assert occlusion["index"] == len(json["textures"]) - 1
    np.testing.assert_array_equal(steps(image[:, :, 0]), steps(page()))


def test_images_lie_beside_a_gltf_under_its_name(tmp_path: Path) -> None:
    builder = Builder()
    builder.show(builder.node(mesh=builder.mesh()), builder.node(mesh=builder.mesh()))
    scene = load(builder.gltf(tmp_path / "a.gltf", embed=True))
    pages = (page(0), page(1))
    target = tmp_path / "my chair.gltf"
    written = write(scene, explode_all(scene, pages), target)
    assert [path.name for path in written] == [
        "my chair.gltf",
        "my chair_ao.png",
        "my chair_ao2.png",
    ]
    document = open_document(target, None)
    assert [entry.text("uri") for entry in document.entries("images")] == [
        "my%20chair_ao.png",
        "my%20chair_ao2.png",
    ]
    for path, value in zip(written[1:], pages, strict=True):
        image = decode(path.read_bytes(), path.name)
        np.testing.assert_array_equal(steps(image[:, :, 0]), steps(value))


def test_a_file_of_somebody_else_is_not_taken_for_the_image(tmp_path: Path) -> None:
    scene = load(square_builder().gltf(tmp_path / "a.gltf"))
    (tmp_path / "b_ao.png").write_bytes(b"mine")
    for _ in range(2):  # the second time, b_ao2.png belongs to b.gltf
        write(scene, explode_all(scene), tmp_path / "b.gltf")
    assert (tmp_path / "b_ao.png").read_bytes() == b"mine"
    assert sorted(path.name for path in tmp_path.glob("*.png")) == ["b_ao.png", "b_ao2.png"]


def test_nothing_is_written_where_the_image_cannot_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load(square_builder().gltf(tmp_path / "a.gltf"))
    before = sorted(tmp_path.iterdir())
    stage = files._stage

    def failing(target: Path, content: files.Content, sync: bool) -> str:
        if target.suffix == ".gltf":  # the last one of all
            raise OSError(28, "No space left on device")
        return stage(target, content, sync)

    monkeypatch.setattr(files, "_stage", failing)
    with pytest.raises(OutputError, match="No space left"):
        write(scene, explode_all(scene), tmp_path / "b.gltf")
    assert sorted(tmp_path.iterdir()) == before


def test_a_second_bake_replaces_the_first_one(tmp_path: Path) -> None:
    builder = mapped({"name": "wood"})
    scene = load(builder.glb(tmp_path / "a.glb"))
    for before, after in (("a", "b"), ("b", "c")):
        scene = load(tmp_path / f"{before}.glb")
        write(scene, explode_all(scene), tmp_path / f"{after}.glb")
    assert check_texture_target(scene, tmp_path / "c.glb", ImageSettings()) == ()
    json = unpack_glb(tmp_path / "c.glb")[0]
    part = json["meshes"][0]["primitives"][0]
    assert sorted(part["attributes"]) == ["POSITION", "TEXCOORD_0", "TEXCOORD_1"]
    assert len(json["materials"]) == 1
    layout = exploded(scene.meshes[0])
    found = at_corners(tmp_path / "c.glb")["TEXCOORD_1"]
    np.testing.assert_array_equal(found, layout.uv[layout.faces])


def test_coordinates_that_a_texture_has_come_to_need_are_not_replaced(tmp_path: Path) -> None:
    builder = mapped({"normalTexture": {"index": 0, "texCoord": 1}})
    builder.put("textures", {})
    number = builder.accessor(UV, name="ambient occlusion")
    builder.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = number
    scene = load(builder.glb(tmp_path / "a.glb"))
    write(scene, explode_all(scene), tmp_path / "b.glb")
    assert "TEXCOORD_2" in at_corners(tmp_path / "b.glb")


def test_an_occlusion_texture_of_somebody_else_is_named(tmp_path: Path) -> None:
    builder = mapped({"name": "wood", "occlusionTexture": {"index": 0}})
    builder.put("textures", {"source": builder.put("images", {"uri": "old.png"})})
    scene = load(builder.glb(tmp_path / "a.glb"))
    (note,) = check_texture_target(scene, tmp_path / "b.glb", ImageSettings())
    assert 'material 0 "wood" has an occlusion texture, which gives way to the new one' in note


def test_an_occlusion_texture_that_points_at_nothing_gives_way(tmp_path: Path) -> None:
    scene = load(mapped({"occlusionTexture": {"index": 7}}).glb(tmp_path / "a.glb"))
    (note,) = check_texture_target(scene, tmp_path / "b.glb", ImageSettings())
    assert "gives way" in note
    write(scene, lightmap(Kept(uv_set=0)), tmp_path / "b.glb")
    assert "0 occlusionTexture" in textures_of(tmp_path / "b.glb")

"""Values of vertices as an occlusion texture: a gradient, and a set of coordinates that looks them up."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats import gltf
from aobake.meshes.formats.gltf.gradient import HEIGHT, WIDTH, coordinate, gradient_png
from aobake.settings import StoreSettings
from tests.meshes.formats.gltf.build import (
    Builder,
    attribute,
    bake,
    constant,
    load,
    ramp,
    square_builder,
    unpack_glb,
)


def decoded_png(data: bytes) -> NDArray[np.uint8]:
    """(H, W) of an 8-bit grey PNG without filters; checks the sums."""
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    at, parts = 8, {}
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + size]
        assert struct.unpack_from(">I", data, at + 8 + size)[0] == zlib.crc32(kind + body)
        parts[kind] = body
        at += 12 + size
    width, height, depth, color = struct.unpack_from(">IIBB", parts[b"IHDR"])
    assert (depth, color) == (8, 0)
    rows = np.frombuffer(zlib.decompress(parts[b"IDAT"]), np.uint8).reshape(height, width + 1)
    assert not rows[:, 0].any()
    return rows[:, 1:]


def sampled(image: NDArray[np.uint8], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """A linear filter with edges clamped, of the first row."""
    x = u * image.shape[1] - 0.5
    low = np.floor(x)
    row = image[0] / 255
    at = [row[np.clip(low + k, 0, len(row) - 1).astype(int)] for k in (0, 1)]
    return np.asarray(at[0] + (x - low) * (at[1] - at[0]))


def test_the_gradient_gives_back_the_value_that_looks_it_up() -> None:
    image = decoded_png(gradient_png())
    assert image.shape == (HEIGHT, WIDTH)
    values = np.linspace(0, 1, 1001, dtype=np.float32)
    np.testing.assert_allclose(sampled(image, coordinate(values)), values, rtol=0, atol=1e-7)
    np.testing.assert_array_equal(sampled(image, coordinate(np.array([0, 1], np.float32))), [0, 1])


def test_an_occlusion_texture_shows_the_values_through_its_own_set(tmp_path: Path) -> None:
    builder = Builder()
    uv = builder.accessor([[0, 0]] * 4)
    builder.put(
        "materials",
        {"name": "wood", "occlusionTexture": {"index": 0, "strength": 0.3, "texCoord": 0}},
    )
    builder.put("textures", {})
    builder.show(
        builder.node(
            mesh=builder.mesh(builder.primitive(material=0, attributes={"TEXCOORD_0": uv}))
        )
    )
    source = builder.glb(tmp_path / "a.glb")
    values = ramp(load(source))
    bake(source, tmp_path / "b.glb", "occlusion", values)
    after, binary, _ = unpack_glb(tmp_path / "b.glb")
    assert after["materials"] == [{"name": "wood", "occlusionTexture": {"index": 1, "texCoord": 1}}]
    texture = after["textures"][1]
    assert after["samplers"][texture["sampler"]] == {
        "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071,
    }  # fmt: skip
    view = after["bufferViews"][after["images"][texture["source"]]["bufferView"]]
    image = decoded_png(binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]])
    found = attribute(tmp_path / "b.glb", "TEXCOORD_1")
    np.testing.assert_allclose(sampled(image, found[:, 0]), values[0], rtol=0, atol=1e-5)
    apart = attribute(tmp_path / "b.glb", "_AO")  # the same bytes, read as an attribute
    np.testing.assert_array_equal(apart[:, 0], values[0])
    starts = [after["accessors"][n].get("byteOffset", 0) for n in (-2, -1)]
    assert [start % 4 for start in starts] == [0, 0]
    assert len(after["bufferViews"]) == len(unpack_glb(source)[0]["bufferViews"]) + 2
    warnings = gltf.check(load(source), StoreSettings(store="occlusion"), tmp_path / "out.glb")
    assert len(warnings) == 1
    assert (
        'material 0 "wood" has an occlusion texture, which gives way to the new one' in warnings[0]
    )


def test_materials_are_copied_where_something_else_uses_them(tmp_path: Path) -> None:
    """Points keep the original; two sets of coordinates need two copies; no material becomes a new one."""
    builder = Builder()
    builder.put("materials", {"name": "wood", "doubleSided": True})
    uv = builder.accessor([[0, 0]] * 4)
    parts = [
        builder.primitive(material=0, mode=0),
        builder.primitive(material=0),
        builder.primitive(material=0, attributes={"TEXCOORD_0": uv}),
        builder.primitive(),
    ]
    builder.show(builder.node(mesh=builder.mesh(*parts)))
    bake(builder.glb(tmp_path / "a.glb"), tmp_path / "b.glb", "occlusion")
    after = unpack_glb(tmp_path / "b.glb")[0]
    named = [primitive["material"] for primitive in after["meshes"][0]["primitives"]]
    wood = {"name": "wood_ao", "doubleSided": True}
    assert named == [0, 1, 2, 3]
    assert after["materials"] == [
        {"name": "wood", "doubleSided": True},
        {**wood, "occlusionTexture": {"index": 0}},
        {**wood, "occlusionTexture": {"index": 0, "texCoord": 1}},
        {"occlusionTexture": {"index": 0}},
    ]
    assert len(after["images"]) == len(after["textures"]) == len(after["samplers"]) == 1
    assert "TEXCOORD_0" not in after["meshes"][0]["primitives"][0]["attributes"]


def test_a_material_used_with_two_sets_serves_one_and_is_copied_for_the_other(
    tmp_path: Path,
) -> None:
    builder = Builder()
    builder.put("materials", {"name": "wood"})
    uv = {"TEXCOORD_0": builder.accessor([[0, 0]] * 4)}
    parts = [builder.primitive(material=0), builder.primitive(material=0, attributes=uv)]
    builder.show(builder.node(mesh=builder.mesh(*parts)))
    bake(builder.glb(tmp_path / "a.glb"), tmp_path / "b.glb", "occlusion")
    assert unpack_glb(tmp_path / "b.glb")[0]["materials"] == [
        {"name": "wood", "occlusionTexture": {"index": 0}},
        {"name": "wood_ao", "occlusionTexture": {"index": 0, "texCoord": 1}},
    ]


def test_variants_point_at_materials_that_read_the_new_set(tmp_path: Path) -> None:
    builder = Builder()
    for name in ("red", "blue"):
        builder.put("materials", {"name": name})
    mappings = [{"material": 0, "variants": [0]}, {"material": 1, "variants": [1]}]
    variants = {"KHR_materials_variants": {"mappings": mappings}}
    parts = [
        builder.primitive(material=0, extensions=variants),
        builder.primitive(material=1, mode=1),
    ]
    builder.show(builder.node(mesh=builder.mesh(*parts)))
    bake(builder.glb(tmp_path / "a.glb"), tmp_path / "b.glb", "occlusion")
    after = unpack_glb(tmp_path / "b.glb")[0]
    primitive = after["meshes"][0]["primitives"][0]
    new = primitive["extensions"]["KHR_materials_variants"]["mappings"]
    assert [mapping["variants"] for mapping in new] == [[0], [1]]
    assert [after["materials"][mapping["material"]]["name"] for mapping in new] == [
        "red",
        "blue_ao",
    ]
    assert all("occlusionTexture" in after["materials"][mapping["material"]] for mapping in new)
    assert "occlusionTexture" not in after["materials"][1]


def test_a_primitive_with_eight_sets_of_coordinates_is_refused(tmp_path: Path) -> None:
    builder = Builder()
    sets = {f"TEXCOORD_{n}": builder.accessor([[0, 0]] * 4) for n in range(8)}
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(attributes=sets))))
    scene = load(builder.glb(tmp_path / "a.glb"))
    with pytest.raises(OutputError, match=r"8 texture coordinate sets already.*--store color"):
        gltf.check(scene, StoreSettings(store="occlusion"), tmp_path / "out.glb")


def test_a_second_bake_with_an_occlusion_texture_replaces_the_first(tmp_path: Path) -> None:
    source = square_builder().glb(tmp_path / "a.glb")
    first, second = constant(0.25), constant(0.75)
    bake(source, tmp_path / "b.glb", "occlusion", first)
    settings = StoreSettings(store="occlusion")
    assert gltf.check(load(tmp_path / "b.glb"), settings, tmp_path / "c.glb") == ()
    bake(tmp_path / "b.glb", tmp_path / "c.glb", "occlusion", second)
    after = unpack_glb(tmp_path / "c.glb")[0]
    primitive = after["meshes"][0]["primitives"][0]
    assert sorted(primitive["attributes"]) == ["POSITION", "TEXCOORD_0", "_AO"]
    assert len(after["materials"]) == 1
    np.testing.assert_array_equal(attribute(tmp_path / "c.glb", "_AO"), np.full((4, 1), 0.75))

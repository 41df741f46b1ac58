"""Writing: only what must change changes, and every viewer finds it."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aobake.errors import OutputError
from aobake.meshes.formats import gltf
from aobake.settings import Store, StoreSettings
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

STORES: tuple[Store, ...] = ("color", "occlusion", "attribute")


def without_additions(document: dict[str, Any], before: dict[str, Any]) -> dict[str, Any]:
    """The document as it was, if a bake only added to it."""
    found = copy.deepcopy(document)
    for name in (
        "accessors",
        "bufferViews",
        "materials",
        "meshes",
        "images",
        "samplers",
        "textures",
    ):
        if name in before:
            found[name] = found[name][: len(before[name])]
        else:
            found.pop(name, None)
    for mesh, old in zip(found["meshes"], before["meshes"], strict=True):
        for primitive, was in zip(mesh["primitives"], old["primitives"], strict=True):
            primitive["attributes"] = {
                k: v for k, v in primitive["attributes"].items() if k in was["attributes"]
            }
            if "material" not in was:
                primitive.pop("material", None)
    found["buffers"][0]["byteLength"] = before["buffers"][0]["byteLength"]
    return found


@pytest.mark.parametrize("store", STORES)
def test_a_bake_adds_to_a_glb_and_changes_nothing_else(tmp_path: Path, store: Store) -> None:
    builder = square_builder(extras={"a": [1, 2.5, None]})
    builder.json["extras"] = {"b": "c"}
    source = builder.glb(tmp_path / "a.glb")
    kept = source.read_bytes()
    bake(source, tmp_path / "b.glb", store)
    before, binary, _ = unpack_glb(source)
    after, grown, _ = unpack_glb(tmp_path / "b.glb")
    assert without_additions(after, before) == before
    assert list(after)[: len(before)] == list(before)
    assert grown.startswith(binary)
    assert after["buffers"][0]["byteLength"] == len(grown)
    assert source.read_bytes() == kept


@pytest.mark.parametrize("store", STORES)
def test_the_same_input_gives_the_same_bytes(tmp_path: Path, store: Store) -> None:
    source = square_builder().glb(tmp_path / "a.glb")
    for name in ("b.glb", "c.glb"):
        bake(source, tmp_path / name, store)
    assert (tmp_path / "b.glb").read_bytes() == (tmp_path / "c.glb").read_bytes()


def test_new_colours_are_grey_in_16_bits_with_full_alpha(tmp_path: Path) -> None:
    source = square_builder().glb(tmp_path / "a.glb")
    values = np.array([0.0, 0.25, 0.5, 1.0], np.float32)
    bake(source, tmp_path / "b.glb", ao=[values])
    found = attribute(tmp_path / "b.glb", "COLOR_0")
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found, [[v, v, v, 65535] for v in (0, 16384, 32768, 65535)])
    after = unpack_glb(tmp_path / "b.glb")[0]
    assert after["accessors"][-1]["normalized"] is True
    assert after["bufferViews"][-1]["byteStride"] == 8


@pytest.mark.parametrize("width", [3, 4])
@pytest.mark.parametrize(("dtype", "full"), [("u1", 255), ("u2", 65535), ("f4", 1.0)])
def test_existing_colours_are_multiplied_and_alpha_is_kept(
    tmp_path: Path, dtype: str, full: float, width: int
) -> None:
    builder = Builder()
    rng = np.random.default_rng(3)
    stored = rng.random((4, width)) * full
    number = builder.accessor(stored, dtype, **({} if dtype == "f4" else {"normalized": True}))
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(attributes={"COLOR_0": number}))))
    source = builder.glb(tmp_path / "a.glb")
    before = attribute(source, "COLOR_0") / full
    values = ramp(load(source))
    bake(source, tmp_path / "b.glb", ao=values)
    found = attribute(tmp_path / "b.glb", "COLOR_0")
    assert found.dtype == (np.float32 if dtype == "f4" else np.uint16)
    after = found / (1.0 if dtype == "f4" else 65535)
    step = 1e-7 if dtype == "f4" else 0.51 / 65535
    np.testing.assert_allclose(after[:, :3], before[:, :3] * values[0][:, None], rtol=0, atol=step)
    if width == 4:
        np.testing.assert_array_equal(after[:, 3], before[:, 3])
    view = unpack_glb(tmp_path / "b.glb")[0]["bufferViews"][-1]
    assert view["byteStride"] % 4 == 0
    assert view["byteLength"] == 4 * view["byteStride"]


def test_colours_that_are_no_colours_are_refused_before_the_bake(tmp_path: Path) -> None:
    builder = Builder()
    number = builder.accessor([[1, 2, 3]] * 4, "i2")
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(attributes={"COLOR_0": number}))))
    scene = load(builder.glb(tmp_path / "a.glb"))
    with pytest.raises(OutputError, match=r"COLOR_0 is int16.*--store attribute"):
        gltf.check(scene, StoreSettings(), tmp_path / "out.glb")
    assert gltf.check(scene, StoreSettings(store="attribute"), tmp_path / "out.glb") == ()


def test_colours_that_are_too_few_are_refused_before_the_bake(tmp_path: Path) -> None:
    builder = Builder()
    colors = {"COLOR_0": builder.accessor([[1, 1, 1]] * 3)}
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(attributes=colors))))
    with pytest.raises(OutputError, match="COLOR_0 has 3 values for 4 vertices"):
        gltf.check(load(builder.glb(tmp_path / "a.glb")), StoreSettings(), tmp_path / "out.glb")


def test_the_attribute_holds_the_values_exactly(tmp_path: Path) -> None:
    source = square_builder().glb(tmp_path / "a.glb")
    values = ramp(load(source))
    bake(source, tmp_path / "b.glb", "attribute", values)
    found = attribute(tmp_path / "b.glb", "_AO")
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found[:, 0], values[0])


def three_nodes(tmp_path: Path, *, hidden: bool = False) -> Path:
    builder = Builder()
    mesh = builder.mesh(name="wheel")
    nodes = [builder.node(mesh=mesh, translation=[x, 0, 0]) for x in range(3)]
    return builder.show(*nodes[:2] if hidden else nodes).glb(tmp_path / "a.glb")


@pytest.mark.parametrize("store", STORES)
def test_nodes_that_share_a_mesh_get_copies_only_where_their_values_differ(
    tmp_path: Path, store: Store
) -> None:
    bake(three_nodes(tmp_path), tmp_path / "b.glb", store, constant(0.5, 0.25, 0.5))
    after = unpack_glb(tmp_path / "b.glb")[0]
    assert [node["mesh"] for node in after["nodes"]] == [0, 1, 0]
    first, second = after["meshes"]
    assert first["name"] == "wheel"
    assert second["name"].startswith("wheel_")
    a, b = first["primitives"][0], second["primitives"][0]
    different = {key for key in a["attributes"] if a["attributes"][key] != b["attributes"][key]}
    assert len(different) == (2 if store == "occlusion" else 1)
    assert a["indices"] == b["indices"]


def test_nodes_with_equal_values_go_on_sharing(tmp_path: Path) -> None:
    bake(three_nodes(tmp_path), tmp_path / "b.glb", ao=constant(0.5, 0.5, 0.5))
    after = unpack_glb(tmp_path / "b.glb")[0]
    assert (len(after["meshes"]), len(after["accessors"])) == (1, 3)


def test_a_mesh_that_a_node_outside_of_the_scene_shows_stays_as_it_is(tmp_path: Path) -> None:
    source = three_nodes(tmp_path, hidden=True)
    bake(source, tmp_path / "b.glb", ao=constant(0.5, 0.5))
    before, after = unpack_glb(source)[0], unpack_glb(tmp_path / "b.glb")[0]
    assert [node["mesh"] for node in after["nodes"]] == [1, 1, 0]
    assert after["meshes"][0] == before["meshes"][0]


def test_gpu_instances_share_their_mean_and_say_so(tmp_path: Path) -> None:
    builder = Builder()
    translation = builder.accessor([[1, 0, 0], [2, 0, 0]])
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translation}}}
    builder.show(builder.node(mesh=builder.mesh(), extensions=extension, name="grass"))
    source = builder.glb(tmp_path / "a.glb")
    bake(source, tmp_path / "b.glb", "attribute", constant(0.25, 0.75))
    np.testing.assert_array_equal(attribute(tmp_path / "b.glb", "_AO"), [[0.5]] * 4)
    (warning,) = gltf.check(load(source), StoreSettings(), tmp_path / "out.glb")
    assert '"grass"' in warning
    assert "mean" in warning


def shared_vertices(tmp_path: Path, *indices: list[int]) -> Path:
    builder = Builder()
    positions = builder.accessor(np.arange(18.0).reshape(6, 3))
    parts = [
        {"attributes": {"POSITION": positions}, "indices": builder.accessor(corner, "u2")}
        for corner in indices
    ]
    builder.show(builder.node(mesh=builder.mesh(*parts)))
    return builder.glb(tmp_path / "a.glb")


def test_primitives_that_share_their_vertices_share_one_column(tmp_path: Path) -> None:
    source = shared_vertices(tmp_path, [0, 1, 2], [3, 4, 5])
    values = [np.full(6, value, np.float32) for value in (0.25, 0.75)]
    bake(source, tmp_path / "b.glb", "attribute", values)
    parts = unpack_glb(tmp_path / "b.glb")[0]["meshes"][0]["primitives"]
    assert parts[0]["attributes"] == parts[1]["attributes"]
    np.testing.assert_array_equal(
        attribute(tmp_path / "b.glb", "_AO")[:, 0], [0.25] * 3 + [0.75] * 3
    )


def test_primitives_that_disagree_about_a_vertex_get_columns_of_their_own(tmp_path: Path) -> None:
    source = shared_vertices(tmp_path, [0, 1, 2], [2, 3, 4])
    values = [np.full(6, value, np.float32) for value in (0.25, 0.75)]
    bake(source, tmp_path / "b.glb", "attribute", values)
    for number, value in enumerate((0.25, 0.75)):
        found = attribute(tmp_path / "b.glb", "_AO", primitive=number)
        used = [0, 1, 2] if number == 0 else [2, 3, 4]
        np.testing.assert_array_equal(found[used, 0], value)


def test_values_of_another_scene_are_refused(tmp_path: Path) -> None:
    scene = load(three_nodes(tmp_path))
    for values, words in (
        (constant(1.0), "values for 1 instances"),
        ([*constant(1, 1), np.ones(3, np.float32)], "shape"),
    ):
        with pytest.raises(OutputError, match=words):
            gltf.write(scene, values, tmp_path / "b.glb", StoreSettings())
    assert not (tmp_path / "b.glb").exists()


def test_values_that_are_no_numbers_count_as_open(tmp_path: Path) -> None:
    values = np.array([np.nan, -1.0, 2.0, 0.5], np.float32)
    bake(square_builder().glb(tmp_path / "a.glb"), tmp_path / "b.glb", "attribute", [values])
    np.testing.assert_array_equal(attribute(tmp_path / "b.glb", "_AO")[:, 0], [1.0, 0.0, 1.0, 0.5])


@pytest.mark.parametrize("embed", [True, False])
@pytest.mark.parametrize("target", ["b.gltf", "b.glb"])
def test_a_gltf_is_written_as_either_kind(tmp_path: Path, embed: bool, target: str) -> None:
    """One file stays one file; buffers beside it stay beside it, the first one goes into a GLB."""
    source = square_builder().gltf(tmp_path / "a.gltf", embed=embed)
    (tmp_path / "out").mkdir()
    bake(source, tmp_path / "out" / target)
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ([target] if embed or target == "b.glb" else ["a.bin", "b.gltf", "b_ao.bin"])
    np.testing.assert_array_equal(
        load(tmp_path / "out" / target).meshes[0].vertices, load(source).meshes[0].vertices
    )
    assert attribute(tmp_path / "out" / target, "COLOR_0").shape == (4, 4)


def test_a_glb_is_written_as_gltf_with_its_bytes_beside_it(tmp_path: Path) -> None:
    builder = square_builder()
    bake(builder.glb(tmp_path / "a.glb"), tmp_path / "b.gltf")
    document = json.loads((tmp_path / "b.gltf").read_text())
    assert document["buffers"][0]["uri"] == "b_ao.bin"
    assert (tmp_path / "b_ao.bin").read_bytes().startswith(bytes(builder.data))
    assert load(tmp_path / "b.gltf").triangles == 2


def test_a_glb_with_chunks_that_a_gltf_cannot_hold_is_refused(tmp_path: Path) -> None:
    source = square_builder().glb(tmp_path / "a.glb", (1, b"more"))
    with pytest.raises(OutputError, match=r"Write a \.glb instead"):
        bake(source, tmp_path / "b.gltf")
    with pytest.raises(OutputError, match=r"Write a \.glb instead"):
        gltf.check(load(source), StoreSettings(), tmp_path / "b.gltf")


def test_a_glb_whose_buffer_is_beside_it_gets_another_beside_it(tmp_path: Path) -> None:
    builder = square_builder()
    (tmp_path / "far.bin").write_bytes(builder.data)
    path = tmp_path / "a.glb"
    data, builder.data = bytes(builder.data), bytearray()
    builder.json["buffers"] = [{"byteLength": len(data), "uri": "far.bin"}]
    builder.glb(path)
    bake(path, tmp_path / "b.glb")
    after, binary, _ = unpack_glb(tmp_path / "b.glb")
    assert binary == b""
    assert [buffer["uri"] for buffer in after["buffers"]] == ["far.bin", "b_ao.bin"]
    assert attribute(tmp_path / "b.glb", "COLOR_0").shape == (4, 4)


def test_facts_say_what_is_in_the_file_and_what_a_bake_touches(tmp_path: Path) -> None:
    builder = Builder()
    mesh = builder.mesh(builder.primitive(), builder.primitive(mode=0), name="seat")
    spare = builder.mesh(name="spare")
    nodes = [builder.node(mesh=mesh), builder.node(mesh=mesh), builder.node(mesh=spare)]
    builder.json["images"] = [{"uri": "missing.png"}]
    builder.show(*nodes[:2])
    source = load(builder.glb(tmp_path / "a.glb")).source
    assert source is not None
    facts = source.facts()
    expected = {
        "nodes": 3,
        "meshes": 2,
        "primitives": 3,
        "triangles": 4,
        "points and lines": 1,
        "UV sets": 0,
    }
    assert {key: facts[key] for key in expected} == expected
    assert facts["a bake touches"] == ['mesh 0 "seat" (1 of 2 primitives, 2 nodes)']
    assert facts["problems"] == [
        "'missing.png' is missing",
        'mesh 1 "spare" is not part of the scene, and is left as it is',
        'mesh 0 "seat" primitive 0 has no normals: it is shaded flat, and baked so',
    ]
    assert source.format == "GLB"


def test_colours_that_were_baked_before_are_darkened_again_and_it_is_said(tmp_path: Path) -> None:
    bake(square_builder().glb(tmp_path / "a.glb"), tmp_path / "b.glb")
    found = gltf.check(load(tmp_path / "b.glb"), StoreSettings(), tmp_path / "c.glb")
    assert len(found) == 1
    assert "b.glb: the vertex colours of 1 primitives hold the occlusion of an earlier" in found[0]
    attribute_alone = StoreSettings(store="attribute")
    assert gltf.check(load(tmp_path / "b.glb"), attribute_alone, tmp_path / "c.glb") == ()


def test_an_attribute_that_is_taken_off_again_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    """What a bake adds stands behind what was there: all bytes of the buffer, and all entries of the lists."""
    builder = square_builder(translation=[1, 2, 3])
    builder.json["extras"] = {"b": [1e-7, "\u00e9"]}
    source = builder.glb(tmp_path / "a.glb", (0x4B4E5542, b"a chunk of its own  "))
    before, binary, chunks = unpack_glb(source)
    bake(source, tmp_path / "b.glb", "attribute", constant(1.0))
    after, grown, others = unpack_glb(tmp_path / "b.glb")
    del after["meshes"][0]["primitives"][0]["attributes"]["_AO"]
    for name in ("accessors", "bufferViews"):
        after[name] = after[name][: len(before[name])]
    after["buffers"][0]["byteLength"] = before["buffers"][0]["byteLength"]
    assert json.dumps(after) == json.dumps(before)  # the order of the keys as well
    assert grown[: len(binary)] == binary
    assert others == chunks
    np.testing.assert_array_equal(np.frombuffer(grown[len(binary) :], "<f4"), np.ones(4))

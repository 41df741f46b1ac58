"""Lightmaps in glTF: new coordinates, every attribute regathered, and nothing else changed."""

from __future__ import annotations

import copy
from pathlib import Path

import DracoPy
import numpy as np
import pytest

from aobake.errors import OutputError
from aobake.meshes.formats import check_texture_target
from aobake.meshes.formats.gltf.document import Document
from aobake.meshes.formats.gltf.edit import Edit
from aobake.meshes.lightmap import Kept, Unwrapped
from aobake.settings import ImageSettings
from tests.meshes.formats.gltf.build import (
    SQUARE,
    TWO_TRIANGLES,
    UV,
    Builder,
    attribute,
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

RNG = np.random.default_rng(5)


def test_kept_coordinates_change_the_material_alone(tmp_path: Path) -> None:
    old = {
        "index": 0,
        "strength": 0.25,
        "texCoord": 3,
        "extensions": {"KHR_texture_transform": {"scale": [2, 2]}},
    }
    builder = mapped({"name": "wood", "doubleSided": True, "occlusionTexture": old})
    builder.put("textures", {"source": builder.put("images", {"uri": "old.png"})})
    source = builder.glb(tmp_path / "a.glb")
    write(load(source), lightmap(Kept(uv_set=0)), tmp_path / "b.glb")
    before, after = unpack_glb(source)[0], unpack_glb(tmp_path / "b.glb")[0]
    assert after["materials"] == [
        {"name": "wood", "doubleSided": True, "occlusionTexture": {"index": 1}}
    ]
    for name in ("meshes", "accessors", "nodes"):
        assert after[name] == before[name]
    sampler = after["samplers"][after["textures"][1]["sampler"]]
    assert sampler == {"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}
    image = textures_of(tmp_path / "b.glb")["0 occlusionTexture"]
    np.testing.assert_array_equal(steps(image[:, :, 0]), steps(page()))


def test_a_set_that_is_not_there_cannot_be_kept(tmp_path: Path) -> None:
    scene = load(mapped().glb(tmp_path / "a.glb"))
    with pytest.raises(OutputError, match="has no TEXCOORD_1 to keep"):
        write(scene, lightmap(Kept(uv_set=1)), tmp_path / "b.glb")
    assert not (tmp_path / "b.glb").exists()


def rich_square(mode: int, indices: list[int] | None) -> Builder:
    """Every kind of attribute and of component, and a sparse morph target."""
    builder = Builder()
    n = 4
    sparse = {
        "count": 1,
        "indices": {"bufferView": builder.view(b"\2"), "componentType": 5121},
        "values": {"bufferView": builder.view(np.array([0, 0, 5], "<f4").tobytes())},
    }
    moved = builder.put(
        "accessors",
        {
            "componentType": 5126,
            "count": n,
            "type": "VEC3",
            "sparse": sparse,
            "min": [0, 0, 0],
            "max": [0, 0, 5],
        },
    )
    matrix = {"componentType": 5121, "count": n, "type": "MAT3", "name": "turns"}
    matrices = builder.put(
        "accessors",
        {**matrix, "bufferView": builder.view(RNG.bytes(n * 12), byteStride=12)},
    )
    attributes = {
        "NORMAL": builder.accessor(np.tile([0, 0, 127, 0], (n, 1))[:, :3], "i1", normalized=True),
        "TANGENT": builder.accessor([[1, 0, 0, -1]] * n),
        "TEXCOORD_0": builder.accessor(RNG.integers(0, 65536, (n, 2)), "u2", normalized=True),
        "COLOR_0": builder.accessor(RNG.integers(0, 256, (n, 4)), "u1", normalized=True),
        "JOINTS_0": builder.accessor(RNG.integers(0, 9, (n, 4)), "u1"),
        "WEIGHTS_0": builder.accessor([[65535, 0, 0, 0]] * n, "u2", normalized=True),
        "_FEATURE_ID_0": builder.accessor(RNG.random(n)),
        "_TURN": matrices,
    }
    part = builder.primitive(SQUARE, indices, attributes=attributes, mode=mode)
    part["targets"] = [{"POSITION": moved}]
    return builder.show(builder.node(mesh=builder.mesh(part, weights=[0.5])))


@pytest.mark.parametrize(
    ("mode", "indices"), [(4, TWO_TRIANGLES), (5, [0, 1, 3, 2]), (6, None), (5, None)]
)
def test_split_vertices_keep_every_value_in_its_type(
    tmp_path: Path, mode: int, indices: list[int] | None
) -> None:
    source = rich_square(mode, indices).glb(tmp_path / "a.glb")
    scene = load(source)
    found = explode_all(scene)
    write(scene, found, tmp_path / "b.glb")
    before, after = at_corners(source), at_corners(tmp_path / "b.glb")
    layout = found.placings[0].layout if found.placings[0] else None
    assert isinstance(layout, Unwrapped)
    np.testing.assert_array_equal(after.pop("TEXCOORD_1"), layout.uv[layout.faces])
    assert after.keys() == before.keys()
    for name, values in before.items():
        np.testing.assert_array_equal(after[name], values, err_msg=name)
    old, new = (unpack_glb(path)[0] for path in (source, tmp_path / "b.glb"))
    was, now = (document["meshes"][0]["primitives"][0] for document in (old, new))
    assert now["mode"] == 4
    for name, number in was["attributes"].items():
        types = [
            {key: entry.get(key) for key in ("componentType", "normalized", "type", "name")}
            for entry in (old["accessors"][number], new["accessors"][now["attributes"][name]])
        ]
        assert types[0] == types[1]
    for number in now["attributes"].values():
        assert new["bufferViews"][new["accessors"][number]["bufferView"]]["byteStride"] % 4 == 0
    position = new["accessors"][now["attributes"]["POSITION"]]
    assert (position["min"], position["max"]) == ([0, 0, 0], [1, 1, 0])
    assert new["accessors"][now["targets"][0]["POSITION"]]["max"] == [0, 0, 5]
    assert new["accessors"][: len(old["accessors"])] == old["accessors"]
    assert new["accessors"][now["indices"]]["componentType"] == 5123


def test_where_nothing_is_split_only_coordinates_are_added(tmp_path: Path) -> None:
    source = rich_square(5, [0, 1, 3, 2]).glb(tmp_path / "a.glb")
    scene = load(source)
    layout = smooth(scene.meshes[0])
    write(scene, lightmap(layout), tmp_path / "b.glb")
    before, after = (unpack_glb(tmp_path / name)[0] for name in ("a.glb", "b.glb"))
    part = copy.deepcopy(after["meshes"][0]["primitives"][0])
    number = part["attributes"].pop("TEXCOORD_1")
    part.pop("material")
    assert part == before["meshes"][0]["primitives"][0]
    assert number == len(before["accessors"]) == len(after["accessors"]) - 1
    np.testing.assert_array_equal(attribute(tmp_path / "b.glb", "TEXCOORD_1"), layout.uv)


def test_copies_of_a_mesh_differ_in_their_coordinates_alone(tmp_path: Path) -> None:
    builder = Builder()
    mesh = builder.mesh(name="square")
    nodes = [builder.node(mesh=mesh, translation=[x, 0, 0]) for x in (0, 2, 4)]
    scene = load(builder.show(*nodes).glb(tmp_path / "a.glb"))
    first = exploded(scene.meshes[0], 0)
    other = exploded(scene.meshes[0], 1, like=first)
    write(scene, lightmap(first, other, first), tmp_path / "b.glb")
    after = unpack_glb(tmp_path / "b.glb")[0]
    assert [node["mesh"] for node in after["nodes"]] == [0, 1, 0]
    a, b = (mesh["primitives"][0] for mesh in after["meshes"])
    assert a["attributes"]["POSITION"] == b["attributes"]["POSITION"]
    assert a["indices"] == b["indices"]
    assert a["material"] == b["material"]
    for number, layout in ((0, first), (1, other)):
        found = at_corners(tmp_path / "b.glb", number)["TEXCOORD_0"]
        np.testing.assert_array_equal(found, layout.uv[layout.faces])


def test_a_mesh_that_another_scene_shows_keeps_its_vertices(tmp_path: Path) -> None:
    builder = Builder()
    mesh = builder.mesh()
    builder.show(builder.node(mesh=mesh)).show(builder.node(mesh=mesh))
    scene = load(builder.glb(tmp_path / "a.glb"))
    write(scene, explode_all(scene), tmp_path / "b.glb")
    before, after = (unpack_glb(tmp_path / name)[0] for name in ("a.glb", "b.glb"))
    assert [node["mesh"] for node in after["nodes"]] == [1, 0]
    assert after["meshes"][0] == before["meshes"][0]


def two_primitives(path: Path) -> Path:
    """The two triangles of a square, each a primitive, with the same four vertices."""
    builder = Builder()
    shared = builder.accessor(SQUARE)
    parts = [
        {"attributes": {"POSITION": shared}, "indices": builder.accessor(corners, "u2")}
        for corners in ([0, 1, 2], [0, 2, 3])
    ]
    return builder.show(builder.node(mesh=builder.mesh(*parts))).glb(path)


def test_vertices_that_a_primitive_does_not_use_are_not_gathered(tmp_path: Path) -> None:
    """Exporters give all primitives of a mesh the same vertices."""
    scene = load(two_primitives(tmp_path / "a.glb"))
    layouts = []
    for mesh in scene.meshes:
        source = np.concatenate([np.arange(4), mesh.faces[0, :1]]).astype(np.int32)
        faces = mesh.faces.copy()
        faces[0, 0] = 4
        layouts.append(Unwrapped(source=source, faces=faces, uv=RNG.random((5, 2))))
    write(scene, lightmap(*layouts), tmp_path / "b.glb")
    for number in (0, 1):
        assert len(attribute(tmp_path / "b.glb", "POSITION", primitive=number)) == 3
        found = at_corners(tmp_path / "b.glb", primitive=number)
        np.testing.assert_array_equal(
            found["POSITION"], at_corners(tmp_path / "a.glb", primitive=number)["POSITION"]
        )
        expected = layouts[number].uv[layouts[number].faces].astype(np.float32)
        np.testing.assert_array_equal(found["TEXCOORD_0"], expected)


def test_primitives_with_the_same_vertices_share_their_coordinates(tmp_path: Path) -> None:
    scene = load(two_primitives(tmp_path / "a.glb"))
    write(scene, lightmap(*map(smooth, scene.meshes)), tmp_path / "b.glb")
    primitives = unpack_glb(tmp_path / "b.glb")[0]["meshes"][0]["primitives"]
    assert primitives[0]["attributes"] == primitives[1]["attributes"]


def test_a_split_draco_primitive_is_stored_plainly(tmp_path: Path) -> None:
    builder = Builder()
    data = DracoPy.encode(
        np.array(SQUARE), np.reshape(TWO_TRIANGLES, (2, 3)), quantization_bits=14,
        preserve_order=True,
    )  # fmt: skip
    view = builder.view(bytes(data))
    position = builder.put("accessors", {"componentType": 5126, "count": 4, "type": "VEC3"})
    indices = builder.put("accessors", {"componentType": 5123, "count": 6, "type": "SCALAR"})
    extension = {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 0}}}
    part = {"attributes": {"POSITION": position}, "indices": indices, "extensions": extension}
    source = builder.show(builder.node(mesh=builder.mesh(part))).glb(tmp_path / "a.glb")
    scene = load(source)
    write(scene, explode_all(scene), tmp_path / "b.glb")
    assert "extensions" not in unpack_glb(tmp_path / "b.glb")[0]["meshes"][0]["primitives"][0]
    before, after = at_corners(source), at_corners(tmp_path / "b.glb")
    np.testing.assert_array_equal(after["POSITION"], before["POSITION"])


def test_a_mirroring_skin_leaves_the_winding_of_the_file(tmp_path: Path) -> None:
    """The scene has the faces turned; the file must not."""
    builder = Builder()
    attributes = {
        "NORMAL": builder.accessor([[0, 0, 1]] * 4),
        "JOINTS_0": builder.accessor([[0, 0, 0, 0]] * 4, "u1"),
        "WEIGHTS_0": builder.accessor([[1, 0, 0, 0]] * 4),
    }
    mesh = builder.mesh(builder.primitive(attributes=attributes))
    joint = builder.node(scale=[-1, 1, 1])
    builder.put("skins", {"joints": [joint]})
    source = builder.show(joint, builder.node(mesh=mesh, skin=0)).glb(tmp_path / "a.glb")
    scene = load(source)
    found = explode_all(scene)
    write(scene, found, tmp_path / "b.glb")
    before, after = at_corners(source), at_corners(tmp_path / "b.glb")
    for name, values in before.items():
        np.testing.assert_array_equal(after[name], values)


def test_gpu_instances_share_one_layout(tmp_path: Path) -> None:
    builder = Builder()
    places = {"TRANSLATION": builder.accessor([[0, 0, 0], [3, 0, 0]])}
    extension = {"EXT_mesh_gpu_instancing": {"attributes": places}}
    builder.show(builder.node(mesh=builder.mesh(), extensions=extension))
    scene = load(builder.glb(tmp_path / "a.glb"))
    layout = exploded(scene.meshes[0])
    notes = check_texture_target(scene, tmp_path / "b.glb", ImageSettings())
    assert any("share one part of the lightmap" in note for note in notes)
    write(scene, lightmap(layout, layout), tmp_path / "b.glb")
    assert len(unpack_glb(tmp_path / "b.glb")[0]["meshes"]) == 1


def test_a_fifth_set_is_warned_of(tmp_path: Path) -> None:
    builder = Builder()
    attributes = {f"TEXCOORD_{n}": builder.accessor(UV) for n in range(4)}
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(attributes=attributes))))
    scene = load(builder.glb(tmp_path / "a.glb"))
    target = tmp_path / "b.glb"
    assert check_texture_target(scene, target, ImageSettings(), lightmap(Kept(uv_set=3))) == ()
    (note,) = check_texture_target(scene, target, ImageSettings(), explode_all(scene))
    assert "mesh 0 primitive 0 gets TEXCOORD_4" in note


def test_an_extension_that_numbers_vertices_is_warned_of(tmp_path: Path) -> None:
    builder = Builder()
    outline = {"CESIUM_primitive_outline": {"indices": builder.accessor([0, 1], "u2")}}
    builder.show(builder.node(mesh=builder.mesh(builder.primitive(extensions=outline))))
    scene = load(builder.glb(tmp_path / "a.glb"))
    (note,) = check_texture_target(scene, tmp_path / "b.glb", ImageSettings(), explode_all(scene))
    assert "CESIUM_primitive_outline" in note


def test_floating_point_images_are_refused_before_the_bake(tmp_path: Path) -> None:
    scene = load(square_builder().glb(tmp_path / "a.glb"))
    for encoding in ("half", "float"):
        with pytest.raises(OutputError, match="glTF holds PNG images of 8 or 16 bits") as caught:
            check_texture_target(scene, tmp_path / "b.glb", ImageSettings(encoding=encoding))
        assert "\n" not in str(caught.value)


def test_a_lightmap_of_another_scene_is_refused(tmp_path: Path) -> None:
    scene = load(square_builder().glb(tmp_path / "a.glb"))
    good = exploded(scene.meshes[0])
    turned = Unwrapped(source=good.source[::-1].copy(), faces=good.faces, uv=good.uv)
    with pytest.raises(OutputError, match="the layout is one of other faces"):
        write(scene, lightmap(turned), tmp_path / "b.glb")
    with pytest.raises(OutputError, match="places 2 instances, and the scene has 1"):
        write(scene, lightmap(good, good), tmp_path / "b.glb")
    with pytest.raises(OutputError, match="is on image 0 of the lightmap, which has 0"):
        write(scene, lightmap(good, pages=()), tmp_path / "b.glb")
    assert not (tmp_path / "b.glb").exists()


def test_attributes_of_another_length_are_refused(tmp_path: Path) -> None:
    builder = Builder()
    part = builder.primitive(attributes={"_WIND": builder.accessor([1.0, 2.0])})
    scene = load(builder.show(builder.node(mesh=builder.mesh(part))).glb(tmp_path / "a.glb"))
    with pytest.raises(OutputError, match="_WIND has 2 values for 4 vertices"):
        write(scene, explode_all(scene), tmp_path / "b.glb")


def test_an_instance_that_is_on_no_image_stays_as_it_is(tmp_path: Path) -> None:
    builder = Builder()
    builder.show(builder.node(mesh=builder.mesh()), builder.node(mesh=builder.mesh()))
    scene = load(builder.glb(tmp_path / "a.glb"))
    write(scene, lightmap(None, exploded(scene.meshes[1])), tmp_path / "b.glb")
    before, after = (unpack_glb(tmp_path / name)[0] for name in ("a.glb", "b.glb"))
    assert after["meshes"][0] == before["meshes"][0]
    assert after["meshes"][1] != before["meshes"][1]


def test_indices_are_wide_where_they_must_be() -> None:
    empty = Document.__new__(Document)
    object.__setattr__(empty, "json", {})
    edit = Edit(empty, 0, 0)
    corners = np.array([[0, 1, 2]], np.int32)
    kinds = []
    for vertices in (65535, 65536):
        number = edit.add_indices(corners, vertices)
        kinds.append(edit.entries("accessors")[number]["componentType"])
    assert kinds == [5123, 5125]


def test_the_same_lightmap_gives_the_same_bytes(tmp_path: Path) -> None:
    source = rich_square(4, TWO_TRIANGLES).glb(tmp_path / "a.glb")
    for name in ("b.glb", "c.glb"):
        scene = load(source)
        write(scene, explode_all(scene), tmp_path / name)
    assert (tmp_path / "b.glb").read_bytes() == (tmp_path / "c.glb").read_bytes()

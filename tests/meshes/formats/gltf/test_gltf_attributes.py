"""What lies on the surface of a primitive: every way to store it, and that nothing is read before it is wanted."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from aobake.errors import InputError
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.scene import Mesh
from tests.meshes.formats.gltf.build import Builder, load, pack_glb, unpack_glb
from tests.meshes.formats.gltf.meshopt_encoder import attributes as meshopt_stream
from tests.meshes.formats.gltf.test_gltf_draco import COLORS, PLANE, packed, stream
from tests.meshes.formats.gltf.test_gltf_fuzz import damaged_json, refused, rich
from tests.meshes.formats.gltf.test_gltf_nodes import skinned_square

UV = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.25, 0.5]])


def square_with(path: Path, builder: Builder | None = None, **attributes: int) -> Mesh:
    """The mesh of a square with these attributes, from a file."""
    builder = builder or Builder()
    normals = {"NORMAL": builder.accessor([[0, 0, 1]] * 4)} if "TANGENT" in attributes else {}
    primitive = builder.primitive(attributes={**normals, **attributes})
    builder.show(builder.node(mesh=builder.mesh(primitive, name="square")))
    return load(builder.glb(path / "a.glb")).meshes[0]


@pytest.mark.parametrize(
    ("stored", "dtype", "normalized", "step"),
    [
        (UV, "f4", False, 0.0),
        (np.rint(UV * 255), "u1", True, 1 / 255),
        (np.rint(UV * 65535), "u2", True, 1 / 65535),
        (np.rint(UV * 127), "i1", True, 1 / 127),
        (np.rint(UV * 32767), "i2", True, 1 / 32767),
        (UV * 4, "u1", False, 0.0),
        (UV * -4, "i2", False, 0.0),
    ],
)
def test_every_way_to_store_texture_coordinates_gives_their_numbers(
    tmp_path: Path, stored: Any, dtype: str, normalized: bool, step: float
) -> None:
    """Whole numbers that are not normalised mean themselves, as with KHR_mesh_quantization."""
    builder = Builder()
    more = {"normalized": True} if normalized else {}
    mesh = square_with(tmp_path, builder, TEXCOORD_0=builder.accessor(stored, dtype, **more))
    expected = UV if normalized else stored
    found = mesh.attributes["TEXCOORD_0"]
    assert found.values.dtype == np.float64
    assert found.corners is None
    assert_allclose(found.values, expected, atol=step / 2 + 1e-12)
    at_corners = mesh.at_corners("TEXCOORD_0")
    assert at_corners is not None
    assert_array_equal(at_corners, found.values[mesh.faces])


def test_sparse_values_are_put_in_place(tmp_path: Path) -> None:
    builder = Builder()
    sparse = {
        "count": 2,
        "indices": {"bufferView": builder.view(bytes([1, 3])), "componentType": 5121},
        "values": {"bufferView": builder.view(UV[[1, 3]].astype("<f4").tobytes())},
    }
    entry = {"componentType": 5126, "count": 4, "type": "VEC2", "sparse": sparse}
    mesh = square_with(tmp_path, builder, TEXCOORD_0=builder.put("accessors", entry))
    expected = np.zeros((4, 2))
    expected[[1, 3]] = UV[[1, 3]]
    assert_array_equal(mesh.attributes["TEXCOORD_0"].values, expected)


def test_interleaved_values_are_taken_apart(tmp_path: Path) -> None:
    builder = Builder()
    rows = np.concatenate([UV, UV[::-1]], axis=1).astype("<f4")
    view = builder.view(rows.tobytes(), byteStride=16)
    entry = {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC2"}
    first, second = (builder.put("accessors", {**entry, "byteOffset": 8 * k}) for k in range(2))
    mesh = square_with(tmp_path, builder, TEXCOORD_0=first, TEXCOORD_1=second)
    assert_array_equal(mesh.attributes["TEXCOORD_0"].values, UV)
    assert_array_equal(mesh.attributes["TEXCOORD_1"].values, UV[::-1])


def test_meshopt_values_are_decompressed(tmp_path: Path) -> None:
    builder = Builder()
    stored = UV.astype("<f4").view(np.uint8).reshape(4, 8)
    packed_view = {"buffer": 0, "byteStride": 8, "count": 4, "mode": "ATTRIBUTES"}
    data = meshopt_stream(stored, version=0)
    builder.data += b"\0" * (-len(builder.data) % 4)
    packed_view |= {"byteOffset": len(builder.data), "byteLength": len(data)}
    builder.data += data
    view = builder.put(
        "bufferViews",
        {
            "buffer": 0,
            "byteLength": 32,
            "byteStride": 8,
            "extensions": {"EXT_meshopt_compression": packed_view},
        },
    )
    entry = {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC2"}
    mesh = square_with(tmp_path, builder, TEXCOORD_0=builder.put("accessors", entry))
    assert_array_equal(mesh.attributes["TEXCOORD_0"].values, UV)


def test_values_in_a_draco_stream_are_decoded(tmp_path: Path) -> None:
    builder = packed(stream(colors=COLORS), colors=True)
    mesh = load(builder.glb(tmp_path / "a.glb")).meshes[0]
    assert list(mesh.attributes) == ["COLOR_0"]
    assert_allclose(mesh.attributes["COLOR_0"].values, np.tile(COLORS[:1] / 255, (len(PLANE), 1)))


@pytest.mark.parametrize(
    ("kind", "full", "width"),
    [("f4", 1.0, 3), ("f4", 1.0, 4), ("u1", 255.0, 3), ("u2", 65535.0, 4)],
)
def test_colors_keep_their_width_and_are_scaled(
    tmp_path: Path, kind: str, full: float, width: int
) -> None:
    builder = Builder()
    rows = np.tile([[1.0, 0.5, 0.0, 0.25]], (4, 1))[:, :width]
    numbers = rows * full if kind == "f4" else np.rint(rows * full)
    if width == 3 and kind == "u1":  # padded to four bytes, as glTF asks for
        view = builder.view(np.pad(numbers, ((0, 0), (0, 1))).astype("u1").tobytes(), byteStride=4)
        entry = {"bufferView": view, "componentType": 5121, "count": 4, "type": "VEC3"}
        number = builder.put("accessors", {**entry, "normalized": True})
    else:
        number = builder.accessor(numbers, kind, normalized=kind != "f4")
    mesh = square_with(tmp_path, builder, COLOR_0=number)
    assert_allclose(mesh.attributes["COLOR_0"].values, rows, atol=0.5 / full if full > 1 else 0)


def test_occlusion_of_an_earlier_bake_is_an_attribute(tmp_path: Path) -> None:
    builder = Builder()
    mesh = square_with(tmp_path, builder, _AO=builder.accessor([1.0, 0.5, 0.25, 0.0]))
    assert_array_equal(mesh.attributes["_AO"].values, [[1.0], [0.5], [0.25], [0.0]])


def test_attributes_that_mean_nothing_here_are_not_offered(tmp_path: Path) -> None:
    builder = Builder()
    zeros = builder.accessor(np.zeros((4, 2)))
    mesh = square_with(tmp_path, builder, _FEATURE_ID_0=zeros, TEXCOORD=zeros, TEXCOORD_0x=zeros)
    assert (len(mesh.attributes), "TEXCOORD_0x" in mesh.attributes) == (0, False)
    assert mesh.at_corners("TEXCOORD_0x") is None


def test_nothing_is_read_before_it_is_asked_for_and_then_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    builder = Builder()
    number = builder.accessor(UV)
    read: list[int] = []
    before = AccessorReader.values

    def values(self: AccessorReader, number: int, types: tuple[str, ...]) -> Any:
        read.append(number)
        return before(self, number, types)

    monkeypatch.setattr(AccessorReader, "values", values)
    mesh = square_with(tmp_path, builder, TEXCOORD_0=number)
    assert ("TEXCOORD_0" in mesh.attributes, len(mesh.attributes), number in read) == (
        True,
        1,
        False,
    )
    first = mesh.attributes["TEXCOORD_0"]
    asked = len(read)
    assert (number in read, mesh.attributes["TEXCOORD_0"] is first, len(read)) == (
        True,
        True,
        asked,
    )


@pytest.mark.parametrize(
    ("entry", "found"),
    [
        ({"type": "VEC3"}, "'VEC3'; VEC2 is needed"),
        ({"count": 3}, "3 values for 4 vertices"),
        ({"count": 900}, "claims 900 elements"),
        ({"componentType": 9}, "componentType 9"),
        ({"bufferView": 77}, "bufferView is 77"),
        ({"bufferView": 0, "byteOffset": 40}, "claims 4 elements"),
    ],
)
def test_broken_texture_coordinates_stop_no_load_and_are_one_line_when_wanted(
    tmp_path: Path, entry: dict[str, Any], found: str
) -> None:
    builder = Builder()
    number = builder.accessor(UV)
    builder.json["accessors"][number] |= entry
    mesh = square_with(tmp_path, builder, TEXCOORD_0=number)
    for look in (mesh.attributes.__getitem__, mesh.at_corners, mesh.at_corners):
        with pytest.raises(InputError) as caught:
            look("TEXCOORD_0")
        assert found in str(caught.value)
        assert "a.glb" in str(caught.value)
        assert "\n" not in str(caught.value)


def tangent_square(
    path: Path, *, normals: bool = True, moved: str = "TANGENT", weight: float = 0.0
) -> Mesh:
    builder = Builder()
    attributes = {"TANGENT": builder.accessor([[1, 0, 0, -1]] * 4)}
    attributes |= {"NORMAL": builder.accessor([[0, 0, 1]] * 4)} if normals else {}
    targets = [{moved: builder.accessor([[0, 1, 0]] * 4)}]
    primitive = builder.primitive(attributes=attributes, targets=targets)
    builder.show(builder.node(mesh=builder.mesh(primitive, weights=[weight])))
    return load(builder.glb(path / "a.glb")).meshes[0]


def test_tangents_are_given_where_they_belong_to_the_shape(tmp_path: Path) -> None:
    assert_array_equal(tangent_square(tmp_path).attributes["TANGENT"].values, [[1, 0, 0, -1]] * 4)
    assert "TANGENT" in tangent_square(tmp_path, moved="POSITION", weight=1.0).attributes
    assert "TANGENT" not in tangent_square(tmp_path, weight=1.0).attributes
    assert "TANGENT" not in tangent_square(tmp_path, normals=False).attributes


def test_a_skin_takes_the_tangents_away_and_keeps_the_rest(tmp_path: Path) -> None:
    builder = skinned_square([[1, 0, 0, 0]] * 4, [1, 1, 1], [1, 0])
    attributes = builder.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["NORMAL"] = builder.accessor([[0, 0, 1]] * 4)
    attributes["TANGENT"] = builder.accessor([[1, 0, 0, 1]] * 4)
    attributes["TEXCOORD_0"] = builder.accessor(UV)
    mesh = load(builder.glb(tmp_path / "a.glb")).meshes[0]
    assert set(mesh.attributes) == {"TEXCOORD_0"}
    assert_array_equal(mesh.attributes["TEXCOORD_0"].values, UV)


def test_gpu_copies_of_one_primitive_are_stored_with_the_first_of_them(tmp_path: Path) -> None:
    builder = Builder()
    mesh = builder.mesh(builder.primitive(), builder.primitive())
    moves = builder.accessor([[1, 2, 3], [4, 5, 6], [7, 8, 9]])
    gpu = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves}}}
    builder.show(
        builder.node(mesh=mesh),
        builder.node(mesh=mesh, extensions=gpu),
        builder.node(mesh=mesh),
        builder.node(mesh=mesh, extensions=gpu),
    )
    scene = load(builder.glb(tmp_path / "a.glb"))
    alone = [None, None]
    together = [2, 2, 2, 5, 5, 5]
    shared = [number + 8 for number in together]
    assert [i.stored_with for i in scene.instances] == [*alone, *together, *alone, *shared]


def test_whatever_is_damaged_all_that_is_offered_is_given_or_refused(tmp_path: Path) -> None:
    path = rich().glb(tmp_path / "a.glb")
    document, binary, _ = unpack_glb(path)
    rng = random.Random(5)
    opened = 0
    for _ in range(60):
        path.write_bytes(pack_glb(damaged_json(document, rng), binary))
        try:
            scene = load(path)
        except InputError:
            continue
        opened += 1
        wanted = [
            lambda m=m, name=name: m.at_corners(name) for m in scene.meshes for name in m.attributes
        ]
        for look in (*wanted, *(image.data for image in scene.images)):
            assert "\n" not in refused(look)
    assert opened

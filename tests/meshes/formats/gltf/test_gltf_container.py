"""The file around the JSON, and the JSON itself: what is odd is kept, what is broken is refused."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import pytest

from aobake.errors import InputError
from aobake.meshes.formats.gltf.jsontext import JsonText, parse, serialise
from tests.meshes.formats.gltf.build import (
    BIN_CHUNK,
    JSON_CHUNK,
    bake,
    load,
    pack_glb,
    square_builder,
    unpack_glb,
)


def test_unknown_chunks_and_trailing_bytes_are_kept(tmp_path: Path) -> None:
    path = square_builder().glb(tmp_path / "a.glb", (0x12345678, b"odd"), (0x87654321, b"even"))
    path.write_bytes(path.read_bytes() + b"behind")
    bake(path, tmp_path / "b.glb")
    assert unpack_glb(tmp_path / "b.glb")[2] == [(0x12345678, b"odd"), (0x87654321, b"even")]
    assert (tmp_path / "b.glb").read_bytes().endswith(b"behind")


def test_chunks_that_are_not_aligned_are_read_and_written_aligned(tmp_path: Path) -> None:
    builder = square_builder()
    text = json.dumps(builder.with_buffer()).encode()
    text += b" " * (1 - len(text) % 4)
    parts = (
        struct.pack("<II", len(text), JSON_CHUNK)
        + text
        + struct.pack("<II", len(builder.data), BIN_CHUNK)
    )
    body = parts + bytes(builder.data)
    (tmp_path / "a.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    scene = bake(tmp_path / "a.glb", tmp_path / "b.glb")
    assert scene.triangles == 2
    assert unpack_glb(tmp_path / "b.glb")[1].startswith(builder.data)


def test_a_json_file_named_glb_is_read_for_what_it_is(tmp_path: Path) -> None:
    path = square_builder().gltf(tmp_path / "a.gltf", embed=True)
    assert load(path.rename(tmp_path / "a.glb")).triangles == 2


def test_a_byte_order_mark_and_the_indentation_stay(tmp_path: Path) -> None:
    path = square_builder().gltf(tmp_path / "a.gltf", embed=True)
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(json.loads(path.read_text()), indent=3).encode())
    bake(path, tmp_path / "b.gltf")
    assert (
        (tmp_path / "b.gltf")
        .read_bytes()
        .startswith(b'\xef\xbb\xbf{\n   "asset": {\n      "version"')
    )


WHOLE = square_builder()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty"),
        (b"solid cube", "neither GLB nor glTF"),
        (b"glTF\x02\0\0\0", "ends within its header"),
        (b"glTF" + struct.pack("<II", 1, 20) + bytes(8), "GLB version 1"),
        (pack_glb(WHOLE.json, b"")[:-5], "cut short"),
        (
            struct.pack("<4sIIII", b"glTF", 2, 20, 0, BIN_CHUNK),
            "first chunk of the GLB is not JSON",
        ),
        (struct.pack("<4sIIII", b"glTF", 2, 20, 999, JSON_CHUNK), "claims 999 bytes"),
        (b"{", "JSON cannot be read"),
        (b'{"a": "\xff"}', "not UTF-8"),
        (b'{"asset": {}, "asset": {}}', "'asset' stands twice"),
        (b'{"asset": {"version": "2.0"}, "x": NaN}', "NaN is no JSON number"),
        (b'{"asset": {"version": "2.0"}, "x": 1e999}', "1e999 is too large"),
        (b"[" * 100_000, "neither GLB nor glTF"),
        (b'{"a":' * 100_000, "nested too deeply"),
        (b"{}", "asset is missing"),
        (b'{"asset": {"version": 2}}', "version is 2; a string"),
        (b'{"asset": {"version": "1.0"}}', "glTF 1.0; 2.0 is needed"),
        (b'{"asset": {"version": "2.0"}, "nodes": {}}', "nodes is an object; a list"),
        (b'{"asset": {"version": "2.0"}, "nodes": [1]}', "node 0 is 1; an object"),
        (
            b'{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}]}',
            "names 0, and the file has 0",
        ),
    ],
)
def test_what_is_no_gltf_is_refused_in_one_line(tmp_path: Path, data: bytes, words: str) -> None:
    path = tmp_path / "chair.glb"
    path.write_bytes(data)
    with pytest.raises(InputError, match=words) as caught:
        load(path)
    assert "\n" not in str(caught.value)
    assert "chair.glb" in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        b'{"a":1,"b":1.0,"c":-0.0,"d":1e-07,"e":123456789012345678901234567890}',
        b'{"z":0.1,"a":[true,false,null,{}],"":""}',
        '{"name":"Sessel \u00e9 \u4e2d \U0001f600"}'.encode(),
        b'{"lone":"\\ud800"}',
        b'{"x":3.4028234663852886e+38,"y":5e-324,"s":"\\u0001\\"\\\\/"}',
    ],
)
def test_json_comes_back_with_the_same_keys_types_and_values(text: bytes) -> None:
    value = parse(text, "here")
    again = parse(serialise(value), "here")
    assert again == value
    assert list(again) == list(value)
    assert [type(x) for x in again.values()] == [type(x) for x in value.values()]
    assert b"-0.0" not in text or b"-0.0" in serialise(value)


def test_minus_zero_keeps_its_sign() -> None:
    value = parse(b'{"a": -0, "b": -0.0, "c": -01e0}'.replace(b"-01e0", b"-0e0"), "here")
    assert [str(number) for number in value.values()] == ["-0.0"] * 3


def test_compact_text_stays_compact() -> None:
    text = b'{"a":[1,2,{"b":"c: d, e"}]}'
    assert serialise(parse(text, "here"), JsonText(text)) == text


@pytest.mark.parametrize(
    ("names", "fine"),
    [
        (["KHR_materials_unlit", "KHR_texture_basisu", "KHR_lights_punctual"], True),
        (["KHR_node_visibility", "KHR_mesh_quantization"], True),
        (["EXT_primitive_voxels"], False),
        (["ACME_curved_meshes"], False),
        ([3], False),
    ],
)
def test_a_required_extension_that_may_change_the_geometry_is_refused_by_name(
    tmp_path: Path, names: list[Any], fine: bool
) -> None:
    builder = square_builder()
    builder.json["extensionsRequired"] = names
    path = builder.glb(tmp_path / "a.glb")
    if fine:
        assert load(path).triangles == 2
        return
    with pytest.raises(InputError, match="extensionsRequired" if names == [3] else str(names[0])):
        load(path)


def test_an_unknown_extension_that_is_optional_passes_and_stays(tmp_path: Path) -> None:
    builder = square_builder(extensions={"ACME_x": {"y": [1]}})
    builder.json["extensionsUsed"] = ["ACME_x"]
    bake(builder.glb(tmp_path / "a.glb"), tmp_path / "b.glb")
    written = unpack_glb(tmp_path / "b.glb")[0]
    assert (written["extensionsUsed"], written["nodes"]) == (["ACME_x"], builder.json["nodes"])

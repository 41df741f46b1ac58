"""Meshopt: streams made here by hand, and real ones beside their fallback."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

from aobake.errors import InputError
from aobake.meshes.formats.gltf.accessors import AccessorReader
from aobake.meshes.formats.gltf.document import open_document
from aobake.meshes.formats.gltf.element import Element
from aobake.meshes.formats.gltf.meshopt import decompress
from tests.meshes.formats.gltf import meshopt_encoder as encoder
from tests.meshes.formats.gltf.build import SQUARE, Builder, attribute, bake, load, unpack_glb

SHARED = Path(__file__).parents[5] / "shared" / "assets"


def unpack(stream: bytes, mode: str, count: int, stride: int, name: str = "NONE") -> bytes:
    packed = {"mode": mode, "count": count, "byteStride": stride, "filter": name}
    return bytes(decompress(memoryview(stream), Element(packed, "a.glb: buffer view 0, EXT")))


def noise(count: int, stride: int, spread: int = 256) -> np.ndarray:
    """Bytes that change by less than `spread` from element to element."""
    rng = np.random.default_rng(count * stride + spread)
    steps = rng.integers(0, spread, (count, stride)) - spread // 2
    return np.cumsum(steps, axis=0).astype(np.uint8)


@pytest.mark.parametrize("stride", [4, 12, 256])
@pytest.mark.parametrize("count", [1, 16, 17, 300])
@pytest.mark.parametrize("spread", [1, 4, 256])
def test_attributes_of_version_0_come_back(stride: int, count: int, spread: int) -> None:
    data = noise(count, stride, spread)
    assert unpack(encoder.attributes(data, 0), "ATTRIBUTES", count, stride) == data.tobytes()


@pytest.mark.parametrize(("mode", "turn"), [(0, 0), (1, 0), (2, 0), (2, 7), (2, 15)])
@pytest.mark.parametrize("control", [1, 3])
@pytest.mark.parametrize(("count", "stride"), [(1, 4), (33, 8), (300, 256)])
def test_attributes_of_version_1_come_back(
    mode: int, turn: int, control: int, count: int, stride: int
) -> None:
    data = noise(count, stride)
    stream = encoder.attributes(data, 1, control, mode, turn)
    assert unpack(stream, "ATTRIBUTES", count, stride) == data.tobytes()


def test_constant_bytes_take_the_codes_for_zero() -> None:
    """Control mode 2 stores nothing; mode 0 stores groups of no bits."""
    data = np.full((40, 4), 9, np.uint8)
    tail = bytes(24 - 5) + data[0].tobytes() + b"\0"
    nothing = b"\xa1" + bytes([0b10101010]) + tail
    empty_groups = b"\xa1" + b"\0" + bytes(4) + tail
    for stream in (nothing, empty_groups):
        assert unpack(stream, "ATTRIBUTES", 40, 4) == data.tobytes()


def test_the_example_of_the_specification_decodes_as_it_says() -> None:
    """Appendix A: ten bytes, 4-bit deltas with two sentinels."""
    example = bytes.fromhex("175ff0bc77a9210034b5")
    expected = np.cumsum([-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]).astype(
        np.uint8
    )
    stream = b"\xa0" + b"\x02" + example + b"\0" * 3 + bytes(32)
    assert unpack(stream, "ATTRIBUTES", 16, 4)[::4] == expected.tobytes()


@pytest.mark.parametrize("stride", [2, 4])
def test_indices_come_back(stride: int) -> None:
    values = [0, 1000, 1, 1001, 65535, 0, 7, 7, 300]
    found = np.frombuffer(
        unpack(encoder.indices(values), "INDICES", len(values), stride), f"<u{stride}"
    )
    np.testing.assert_array_equal(found, values)


@pytest.mark.parametrize("stride", [2, 4])
def test_explicit_triangles_come_back(stride: int) -> None:
    faces = [(0, 1, 2), (2, 1, 3), (500, 60000, 4)]
    found = np.frombuffer(unpack(encoder.triangles(faces), "TRIANGLES", 9, stride), f"<u{stride}")
    np.testing.assert_array_equal(found.reshape(-1, 3), faces)


def test_short_triangle_codes_follow_edges_and_vertices() -> None:
    """By hand: (0 1 2) new; edge (2 1) and a new one; the same edge list with the recent vertex 2; last + 1."""
    table = bytes([0x00, *[0] * 15])
    codes = bytes([0xF0, 0x10, 0x0E, 0x02])
    stream = b"\xe1" + codes + table
    found = np.frombuffer(unpack(stream, "TRIANGLES", 12, 4), "<u4").reshape(-1, 3)
    # Edges after the first: (1 0) (2 1) (0 2), newest last. Code 0x10 takes the second newest, (2 1).
    # Then (3 1) (2 3) were added: 0x0E takes (2 3) with last + 1 = 1; vertices now 0 1 2 3 1.
    # Then (1 3) (2 1): 0x02 takes (2 1) with the vertex two before the newest, 2.
    np.testing.assert_array_equal(found, [[0, 1, 2], [2, 1, 3], [2, 3, 1], [2, 1, 2]])


def test_octahedral_vectors_unfold_to_unit_length() -> None:
    """+x, +z and -z (a corner of the octahedron's square), with 8 bits."""
    data = np.array([[127, 0, 127, 5], [0, 0, 127, 6], [127, 127, 127, 7]], np.int8)
    stream = encoder.attributes(data.view(np.uint8), 0)
    found = np.frombuffer(unpack(stream, "ATTRIBUTES", 3, 4, "OCTAHEDRAL"), np.int8).reshape(3, 4)
    np.testing.assert_array_equal(found, [[127, 0, 0, 5], [0, 0, 127, 6], [0, 0, -127, 7]])


@pytest.mark.parametrize("largest", range(4))
def test_quaternions_get_their_largest_component_back(largest: int) -> None:
    """Three zeros leave one for the fourth."""
    data = np.array([[0, 0, 0, (32767 & ~3) | largest]], np.int16)
    stream = encoder.attributes(data.view(np.uint8).reshape(1, 8), 0)
    found = np.frombuffer(unpack(stream, "ATTRIBUTES", 1, 8, "QUATERNION"), np.int16)
    np.testing.assert_array_equal(found, np.eye(4, dtype=int)[largest] * 32767)


def test_exponential_numbers_are_exact() -> None:
    exponent, mantissa = np.array([0, -3, 5, -100]), np.array([1, -7, 123456, 1])
    data = ((exponent << 24) | (mantissa & 0xFFFFFF)).astype(np.int32)
    stream = encoder.attributes(data.view(np.uint8).reshape(-1, 4), 0)
    found = np.frombuffer(unpack(stream, "ATTRIBUTES", 4, 4, "EXPONENTIAL"), np.float32)
    np.testing.assert_array_equal(found, (mantissa * 2.0**exponent).astype(np.float32))


def test_colours_are_turned_back_from_luma_and_chroma() -> None:
    """Grey 128 and a red: y, co, cg and an alpha of 7 bits below its marker."""
    red = (64, 64, -64)  # r = y + co - cg, g = y + cg, b = y - co - cg
    data = np.array([[128, 0, 0, 255], [*red, 128]], np.int16).astype(np.uint8)
    stream = encoder.attributes(data, 0)
    found = np.frombuffer(unpack(stream, "ATTRIBUTES", 2, 4, "COLOR"), np.uint8).reshape(2, 4)
    np.testing.assert_array_equal(found, [[128, 128, 128, 255], [192, 0, 64, 0]])


WHOLE = {
    "ATTRIBUTES": encoder.attributes(noise(40, 8), 0),
    "TRIANGLES": encoder.triangles([(0, 1, 2), (2, 1, 3)]),
    "INDICES": encoder.indices([5, 6, 7, 8]),
}
COUNTS = {"ATTRIBUTES": (40, 8), "TRIANGLES": (6, 4), "INDICES": (4, 4)}


@pytest.mark.parametrize("mode", list(WHOLE))
def test_a_stream_that_is_cut_anywhere_is_refused(mode: str) -> None:
    for size in range(len(WHOLE[mode])):
        with pytest.raises(InputError, match=r"stream (is cut|begins|goes on|refers)|elements in"):
            unpack(WHOLE[mode][:size], mode, *COUNTS[mode])


@pytest.mark.parametrize("mode", list(WHOLE))
def test_a_stream_with_more_than_it_should_have_is_refused(mode: str) -> None:
    head, tail = (
        WHOLE[mode][: -32 if mode == "ATTRIBUTES" else -16 if mode == "TRIANGLES" else -4],
        WHOLE[mode],
    )
    tail = tail[len(head) :]
    with pytest.raises(InputError, match="goes on after its last element"):
        unpack(head + b"\0" + tail, mode, *COUNTS[mode])


@pytest.mark.parametrize("mode", list(WHOLE))
def test_damaged_streams_never_do_more_than_be_refused(mode: str) -> None:
    rng = np.random.default_rng(11)
    for _ in range(300):
        damaged = bytearray(WHOLE[mode])
        for place in rng.integers(0, len(damaged), 3):
            damaged[place] = rng.integers(256)
        found = b""
        with contextlib.suppress(InputError):
            found = unpack(bytes(damaged), mode, *COUNTS[mode])
        assert len(found) in {0, COUNTS[mode][0] * COUNTS[mode][1]}


@pytest.mark.parametrize(
    ("mode", "count", "stride", "name", "words"),
    [
        ("ATTRIBUTES", 40, 6, "NONE", "byteStride is 6"),
        ("ATTRIBUTES", 40, 260, "NONE", "byteStride is 260"),
        ("ATTRIBUTES", 40, 8, "EXPONENT", "filter is 'EXPONENT'"),
        ("ATTRIBUTES", 40, 4, "QUATERNION", "does not go with a byteStride of 4"),
        ("ATTRIBUTES", 2**31, 8, "NONE", "claims 2147483648 elements"),
        ("TRIANGLES", 7, 4, "NONE", "multiple of 3"),
        ("TRIANGLES", 6, 8, "NONE", "2 or 4"),
        ("VERTICES", 6, 8, "NONE", "mode is 'VERTICES'"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(
    mode: str, count: int, stride: int, name: str, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        unpack(WHOLE["ATTRIBUTES"], mode, count, stride, name)


@pytest.mark.parametrize("extension", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_a_compressed_primitive_is_read_and_its_stream_stays(
    tmp_path: Path, extension: str
) -> None:
    builder = Builder()
    rows = np.zeros((4, 16), np.uint8)
    rows[:, :12] = np.array(SQUARE, "<f4").view(np.uint8).reshape(4, 12)
    stream = encoder.attributes(rows, 0)
    start = len(builder.data)
    builder.data += stream
    packed = {
        "buffer": 0,
        "byteOffset": start,
        "byteLength": len(stream),
        "byteStride": 16,
        "mode": "ATTRIBUTES",
        "count": 4,
    }
    view = builder.put(
        "bufferViews",
        {"buffer": 1, "byteLength": 64, "byteStride": 16, "extensions": {extension: packed}},
    )
    position = builder.put(
        "accessors", {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3"}
    )
    indices = builder.accessor([0, 1, 2, 0, 2, 3], "u2")
    builder.show(
        builder.node(mesh=builder.mesh({"attributes": {"POSITION": position}, "indices": indices}))
    )
    builder.json["buffers"] = [
        {},
        {"byteLength": 64, "extensions": {extension: {"fallback": True}}},
    ]
    source = builder.glb(tmp_path / "a.glb")
    np.testing.assert_array_equal(load(source).meshes[0].vertices, SQUARE)
    bake(source, tmp_path / "b.glb")
    before, after = unpack_glb(source), unpack_glb(tmp_path / "b.glb")
    assert after[0]["bufferViews"][: len(before[0]["bufferViews"])] == before[0]["bufferViews"]
    assert after[0]["buffers"][1] == before[0]["buffers"][1]
    assert after[1].startswith(before[1])
    assert attribute(tmp_path / "b.glb", "COLOR_0").shape == (4, 4)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the acceptance assets are not here")
def test_a_real_stream_holds_what_its_fallback_holds() -> None:
    """Filtered normals may be one step off; triangles may begin at another corner."""
    document = open_document(SHARED / "gltf/meshopt-fallback/meshopt-fallback.gltf", None)
    reader = AccessorReader(document)
    compared = 0
    for number, view in enumerate(document.entries("bufferViews")):
        packed = view.extension("EXT_meshopt_compression")
        assert packed is not None
        found, fallback = bytes(reader.view(number)), bytes(document.view(view))
        if packed.text("mode") == "ATTRIBUTES" and packed.text("filter", "NONE") == "NONE":
            assert found == fallback
            compared += 1
        elif packed.text("mode") == "TRIANGLES":
            a, b = (np.frombuffer(data, "<u2").reshape(-1, 3) for data in (found, fallback))
            turns = [np.roll(a, turn, axis=1) for turn in range(3)]
            assert np.any([(turn == b).all(axis=1) for turn in turns], axis=0).all()
            compared += 1
    assert compared == 2

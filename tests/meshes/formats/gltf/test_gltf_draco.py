"""Draco: read as it is, kept as it is, refused where it lies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
import pytest

from aobake.errors import InputError
from tests.meshes.formats.gltf.build import Builder, attribute, bake, load, unpack_glb

N = 5
PLANE = np.stack([*np.meshgrid(np.arange(N), np.arange(N)), np.zeros((N, N))], axis=-1).reshape(
    -1, 3
)
A = (np.arange(N - 1)[:, None] * N + np.arange(N - 1)).reshape(-1)
FACES = np.concatenate([np.stack([A, A + 1, A + N], 1), np.stack([A + 1, A + N + 1, A + N], 1)])
COLORS = np.tile(np.array([[255, 128, 0, 51]], np.uint8), (len(PLANE), 1))


def stream(**more: Any) -> bytes:
    return bytes(
        DracoPy.encode(
            PLANE.astype(np.float64), FACES, quantization_bits=14, preserve_order=True, **more
        )
    )


def packed(data: bytes, *, colors: bool = False, vertices: int = len(PLANE)) -> Builder:
    """A primitive that lies in a Draco stream alone."""
    builder = Builder()
    view = builder.view(data)
    inside = (
        {"POSITION": 1, "COLOR_0": 0} if colors else {"POSITION": 0}
    )  # as the encoder numbers them
    position = builder.put("accessors", {"componentType": 5126, "count": vertices, "type": "VEC3"})
    indices = builder.put(
        "accessors", {"componentType": 5123, "count": FACES.size, "type": "SCALAR"}
    )
    attributes = {"POSITION": position}
    if colors:
        entry = {"componentType": 5121, "normalized": True, "count": vertices, "type": "VEC4"}
        attributes["COLOR_0"] = builder.put("accessors", entry)
    extension = {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": inside}}
    primitive = {"attributes": attributes, "indices": indices, "extensions": extension}
    builder.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return builder.show(builder.node(mesh=builder.mesh(primitive)))


def test_a_compressed_primitive_is_read(tmp_path: Path) -> None:
    mesh = load(packed(stream()).glb(tmp_path / "a.glb")).meshes[0]
    step = (N - 1) / 2**14
    np.testing.assert_allclose(mesh.vertices, PLANE, atol=step)
    np.testing.assert_array_equal(mesh.faces, FACES)


def test_the_stream_stays_and_the_occlusion_lies_beside_it(tmp_path: Path) -> None:
    source = packed(stream()).glb(tmp_path / "a.glb")
    bake(source, tmp_path / "b.glb")
    before, after = unpack_glb(source), unpack_glb(tmp_path / "b.glb")
    old, new = before[0]["meshes"][0]["primitives"][0], after[0]["meshes"][0]["primitives"][0]
    assert new["extensions"] == old["extensions"]
    assert after[1].startswith(before[1])
    assert attribute(tmp_path / "b.glb", "COLOR_0").shape == (len(PLANE), 4)


def test_colours_within_the_stream_are_multiplied_and_no_longer_taken_from_it(
    tmp_path: Path,
) -> None:
    """A loader takes from the stream what the extension names, so the name has to go."""
    source = packed(stream(colors=COLORS), colors=True).glb(tmp_path / "a.glb")
    bake(source, tmp_path / "b.glb", ao=[np.full(len(PLANE), 0.5, np.float32)])
    primitive = unpack_glb(tmp_path / "b.glb")[0]["meshes"][0]["primitives"][0]
    assert primitive["extensions"]["KHR_draco_mesh_compression"]["attributes"] == {"POSITION": 1}
    expected = np.rint(COLORS[0] * 257.0 * [0.5, 0.5, 0.5, 1.0])
    np.testing.assert_array_equal(
        attribute(tmp_path / "b.glb", "COLOR_0"), np.tile(expected, (len(PLANE), 1))
    )


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "no Draco stream"),
        (b"DRACO" + bytes(20), "points, not triangles"),
        (stream()[:40], "cannot be decoded"),
        (stream()[:12], "is cut short|cannot be decoded"),
        (
            stream()[:8] + b"\x00\x00\x00" + b"\xff\xff\xff\xff\x07" * 2 + bytes(50),
            "claims 2147483647 faces",
        ),
    ],
)
def test_a_stream_that_is_cut_or_lies_is_refused(tmp_path: Path, data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        load(packed(data or b"\0").glb(tmp_path / "a.glb"))
    assert "KHR_draco_mesh_compression" in str(caught.value)


def test_a_stream_with_another_number_of_vertices_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="claims 24 values, and the Draco stream has 25"):
        load(packed(stream(), vertices=24).glb(tmp_path / "a.glb"))


def test_an_attribute_that_the_stream_lacks_is_refused(tmp_path: Path) -> None:
    builder = packed(stream())
    extension = builder.json["meshes"][0]["primitives"][0]["extensions"][
        "KHR_draco_mesh_compression"
    ]
    extension["attributes"]["NORMAL"] = 9
    with pytest.raises(InputError, match="attribute 9, NORMAL, is not in the stream"):
        load(builder.glb(tmp_path / "a.glb"))

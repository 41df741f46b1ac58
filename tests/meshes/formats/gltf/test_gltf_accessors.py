"""Accessors: every way in which glTF stores numbers, and every way in which a file can lie about it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aobake.errors import InputError
from tests.meshes.formats.gltf.build import SQUARE, Builder, load


def shown(builder: Builder, primitive: dict[str, Any]) -> Builder:
    return builder.show(builder.node(mesh=builder.mesh(primitive)))


@pytest.mark.parametrize(
    ("dtype", "stored", "meant"),
    [
        ("i1", [[-128, -127, 127]] * 3, [-1.0, -1.0, 1.0]),
        ("u1", [[0, 51, 255]] * 3, [0.0, 0.2, 1.0]),
        ("i2", [[-32768, 0, 32767]] * 3, [-1.0, 0.0, 1.0]),
        ("u2", [[0, 13107, 65535]] * 3, [0.0, 0.2, 1.0]),
    ],
)
def test_normalised_positions_are_scaled(
    tmp_path: Path, dtype: str, stored: list[list[int]], meant: list[float]
) -> None:
    """Specification 3.6.2.2: c / max, and no less than -1."""
    builder = Builder()
    attributes = {"POSITION": builder.accessor(stored, dtype, normalized=True)}
    path = shown(builder, {"attributes": attributes}).glb(tmp_path / "a.glb")
    np.testing.assert_allclose(load(path).meshes[0].vertices[0], meant, rtol=0, atol=1e-15)


def test_whole_numbers_that_are_not_normalised_mean_themselves(tmp_path: Path) -> None:
    builder = Builder()
    stored = [[-3, 0, 7], [32767, 1, 2], [4, 5, 6]]
    path = shown(builder, {"attributes": {"POSITION": builder.accessor(stored, "i2")}}).glb(
        tmp_path / "a.glb"
    )
    np.testing.assert_array_equal(load(path).meshes[0].vertices, stored)


def test_interleaved_attributes_are_told_apart(tmp_path: Path) -> None:
    builder = Builder()
    rows = np.arange(24, dtype="<f4").reshape(4, 6)
    view = builder.view(rows.tobytes(), byteStride=24)
    entry = {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3"}
    attributes = {
        "POSITION": builder.put("accessors", entry),
        "NORMAL": builder.put("accessors", {**entry, "byteOffset": 12}),
    }
    path = shown(builder, {"attributes": attributes}).glb(tmp_path / "a.glb")
    mesh = load(path).meshes[0]
    np.testing.assert_array_equal(mesh.vertices, rows[:, :3])
    np.testing.assert_array_equal(mesh.normals, rows[:, 3:])


@pytest.mark.parametrize("over_zeros", [True, False])
def test_sparse_values_replace_those_below(tmp_path: Path, over_zeros: bool) -> None:
    builder = Builder()
    sparse = {
        "count": 2,
        "indices": {"bufferView": builder.view(bytes([1, 3])), "componentType": 5121},
        "values": {"bufferView": builder.view(np.array([[9, 9, 9], [8, 8, 8]], "<f4").tobytes())},
    }
    number = builder.accessor(SQUARE, sparse=sparse)
    if over_zeros:
        del builder.json["accessors"][number]["bufferView"]
    path = shown(builder, {"attributes": {"POSITION": number}}).glb(tmp_path / "a.glb")
    expected = np.zeros((4, 3)) if over_zeros else np.array(SQUARE)
    expected[[1, 3]] = [[9] * 3, [8] * 3]
    np.testing.assert_array_equal(load(path).meshes[0].vertices, expected)


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4"])
def test_indices_of_every_width(tmp_path: Path, dtype: str) -> None:
    builder = Builder()
    primitive = builder.primitive(indices=None) | {
        "indices": builder.accessor([0, 1, 2, 3, 2, 0], dtype)
    }
    path = shown(builder, primitive).glb(tmp_path / "a.glb")
    np.testing.assert_array_equal(load(path).meshes[0].faces, [[0, 1, 2], [3, 2, 0]])


@pytest.mark.parametrize(
    ("dtype", "worst"), [("u1", 255), ("u2", 65535), ("u4", 4294967295), ("u2", 4)]
)
def test_an_index_of_no_vertex_is_refused_by_name(tmp_path: Path, dtype: str, worst: int) -> None:
    builder = Builder()
    primitive = builder.primitive(indices=None) | {
        "indices": builder.accessor([0, 1, worst], dtype)
    }
    builder.show(builder.node(mesh=builder.mesh(primitive, name="seat")))
    with pytest.raises(InputError, match=rf'mesh 0 "seat" primitive 0.*accessor 1.*{worst}'):
        load(builder.glb(tmp_path / "a.glb"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"count": 5}, "claims 5 elements"),
        ({"count": 2**31}, "claims 2147483648 elements"),
        ({"count": -1}, "count is -1"),
        ({"count": 1.5}, "count is 1.5"),
        ({"count": "4"}, "count is '4'"),
        ({"byteOffset": 4}, "up to byte 52"),
        ({"componentType": 5124}, "componentType 5124"),
        ({"componentType": None}, "componentType is missing"),
        ({"type": "VEC4"}, "VEC3 is needed"),
        ({"bufferView": 99}, "bufferView is 99"),
        ({"sparse": []}, "sparse is a list"),
        ({"normalized": 1}, "normalized is 1"),
    ],
)
def test_an_accessor_that_lies_is_refused(
    tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    builder = Builder()
    path = shown(builder, builder.primitive())
    builder.json["accessors"][0] |= change
    with pytest.raises(InputError, match=words) as caught:
        load(path.glb(tmp_path / "a.glb"))
    assert "accessor 0" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_zeros_beyond_all_sense_are_refused_before_they_are_made(tmp_path: Path) -> None:
    builder = Builder()
    number = builder.put("accessors", {"componentType": 5126, "count": 2**31, "type": "VEC3"})
    path = shown(builder, {"attributes": {"POSITION": number}}).glb(tmp_path / "a.glb")
    with pytest.raises(InputError, match="claims more than the file can hold"):
        load(path)


def test_views_that_overlap_a_thousand_times_are_refused_before_they_are_unfolded(
    tmp_path: Path,
) -> None:
    """Each accessor alone is honest; together they would take 48 GB."""
    builder = Builder()
    view = builder.view(bytes(1 << 20))
    parts = []
    for start in range(2000):
        entry = {"bufferView": view, "byteOffset": 4 * start, "componentType": 5120, "type": "VEC3"}
        number = builder.put("accessors", {**entry, "count": 340_000})
        parts.append(
            {"attributes": {"POSITION": number}, "indices": builder.accessor([0, 1, 2], "u1")}
        )
    builder.show(builder.node(mesh=builder.mesh(*parts)))
    with pytest.raises(InputError, match="claims more than the file can hold"):
        load(builder.glb(tmp_path / "a.glb"))


def test_a_buffer_shorter_than_it_claims_is_refused(tmp_path: Path) -> None:
    builder = Builder()
    path = shown(builder, builder.primitive()).glb(tmp_path / "a.glb", byteLength=1000)
    with pytest.raises(InputError, match="buffer 0 claims 1000 bytes, and there are 60"):
        load(path)


def test_positions_that_are_not_finite_are_read_as_they_are(tmp_path: Path) -> None:
    builder = Builder()
    positions = [*SQUARE, [np.nan, np.inf, 0.0]]
    path = shown(builder, builder.primitive(positions)).glb(tmp_path / "a.glb")
    np.testing.assert_array_equal(load(path).meshes[0].vertices, np.array(positions, np.float32))

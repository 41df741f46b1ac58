"""STL, OFF, 3MF and DAE come in through trimesh, and nothing of it comes out as a traceback."""

from __future__ import annotations

import importlib.util
import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from aobake.errors import InputError, OutputError
from aobake.meshes.formats import exchange, load, write_vertex_ao
from aobake.settings import StoreSettings

SOLID = """solid {0}
facet normal 0 0 1
 outer loop
  vertex 0 0 {1}
  vertex 1 0 {1}
  vertex 0 1 {1}
 endloop
endfacet
endsolid {0}
"""
MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>
<object id="1" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>
</resources><build><item objectid="1"/><item objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/></build></model>
"""
COLLADA = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>
<library_geometries><geometry id="g" name="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><matrix>1 0 0 0 0 1 0 0 0 0 1 7 0 0 0 1</matrix>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""
with_3mf = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in exchange.NEEDS[".3mf"]),
    reason="the extra `formats` is not installed",
)
with_dae = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in exchange.NEEDS[".dae"]),
    reason="the extra `formats` is not installed",
)


def packed(text: str, name: str = "3D/3dmodel.model") -> bytes:
    """A 3MF archive with this model."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, text)
    return stream.getvalue()


def saved(tmp_path: Path, name: str, content: str | bytes) -> Path:
    """A file of that content."""
    file = tmp_path / name
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    return file


def test_every_solid_of_an_stl_file_is_read(tmp_path: Path) -> None:
    scene = load(saved(tmp_path, "two.stl", SOLID.format("a", 0) + SOLID.format("b", 4)))
    assert sorted(float(mesh.vertices[0, 2]) for mesh in scene.meshes) == [0, 4]
    assert scene.triangles == 2
    assert scene.source is not None
    assert scene.source.format == "STL"
    assert scene.source.facts()["instances"] == 2


def test_a_binary_stl_file_keeps_its_corners_as_they_are(tmp_path: Path) -> None:
    """Two triangles that share an edge keep six corners: merging is the baker's decision, not the reader's."""
    corners = [[0, 0, 0, 1, 0, 0, 1, 1, 0], [0, 0, 0, 1, 1, 0, 0, 1, 0]]
    body = b"".join(struct.pack("<12fH", 0, 0, 1, *corner, 0) for corner in corners)
    scene = load(saved(tmp_path, "a.STL", bytes(80) + struct.pack("<I", 2) + body))
    assert_array_equal(scene.meshes[0].vertices, np.reshape(corners, (6, 3)))
    assert scene.meshes[0].normals is None


def test_an_off_file_is_read_and_written_as_ply(tmp_path: Path) -> None:
    scene = load(
        saved(tmp_path, "a.off", "OFF\n# c\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    )
    assert scene.triangles == 2
    ao = [np.ones(len(mesh.vertices), np.float32) for _, mesh in scene.placed()]
    write_vertex_ao(scene, ao, tmp_path / "a.ply", StoreSettings())
    assert load(tmp_path / "a.ply").triangles == 2


@with_3mf
def test_an_item_of_a_3mf_file_that_stands_twice_is_one_mesh(tmp_path: Path) -> None:
    scene = load(saved(tmp_path, "a.3mf", packed(MODEL)))
    assert len(scene.meshes) == 1
    assert sorted(float(instance.transform[0, 3]) for instance in scene.instances) == [0, 5]


@with_dae
def test_a_dae_file_keeps_where_its_nodes_stand(tmp_path: Path) -> None:
    scene = load(saved(tmp_path, "a.dae", COLLADA))
    instance, mesh = next(scene.placed())
    placed = mesh.vertices @ instance.transform[:3, :3].T + instance.transform[:3, 3]
    assert_allclose(placed, [[0, 0, 7], [1, 0, 7], [0, 1, 7]])


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.stl", bytes(80) + struct.pack("<I", 2**31) + bytes(200)),
        ("a.stl", bytes(30)),
        ("a.stl", SOLID.format("a", 0)[:70]),
        ("a.stl", SOLID.format("a", "x")),
        ("a.off", "OFF\n2147483647 2147483647 0\n0 0 0\n"),
        ("a.off", "OFF\n"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 zwei 0\n0 1 0\n3 0 1 2\n"),
        pytest.param("a.3mf", packed(MODEL)[:300], marks=with_3mf),
        pytest.param("a.3mf", packed("x", "other.txt"), marks=with_3mf),
        pytest.param("a.3mf", packed(MODEL[:400]), marks=with_3mf),
        pytest.param("a.3mf", packed(MODEL.replace('v3="2"', 'v3="9"')), marks=with_3mf),
        pytest.param("a.dae", COLLADA[:700], marks=with_dae),
        pytest.param("a.dae", COLLADA.replace("<p>0 1 2", "<p>0 1 9"), marks=with_dae),
    ],
)
def test_what_trimesh_cannot_read_is_one_line_that_names_the_file(
    tmp_path: Path, name: str, content: str | bytes
) -> None:
    with pytest.raises(InputError) as caught:
        load(saved(tmp_path, name, content))
    assert f"{name}: " in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["a.dae", "a.3mf"])
def test_a_package_that_is_missing_is_named_with_its_cure(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"needs .*lxml.* pip install \"aobake\[formats\]\""):
        load(saved(tmp_path, name, COLLADA if name == "a.dae" else packed(MODEL)))


@with_dae
def test_an_xml_entity_that_names_another_file_is_refused(tmp_path: Path) -> None:
    secret = saved(tmp_path, "secret.txt", "1 0 0")
    entity = f'<!DOCTYPE x [<!ENTITY e SYSTEM "{secret.as_uri()}">]>\n<COLLADA'
    with pytest.raises(InputError, match="XML entities"):
        load(saved(tmp_path, "a.dae", COLLADA.replace("<COLLADA", entity, 1)))


@with_3mf
def test_an_archive_that_unpacks_beyond_sense_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exchange, "MOST_UNPACKED_BYTES", 1 << 20)
    bomb = saved(tmp_path, "a.3mf", packed(MODEL + " " * (2 << 20)))
    with pytest.raises(InputError, match="unpacks to"):
        load(bomb)


def test_these_formats_are_not_written_and_the_cure_is_named(tmp_path: Path) -> None:
    scene = load(saved(tmp_path, "a.stl", SOLID.format("a", 0)))
    with pytest.raises(OutputError, match=r"STL cannot hold ambient occlusion\..*-o NAME\.glb"):
        write_vertex_ao(scene, [np.ones(3, np.float32)], tmp_path / "b.stl", StoreSettings())

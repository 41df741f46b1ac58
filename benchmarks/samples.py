"""A small file of every format, with as much in it as the format knows and a bake has to leave alone."""

from __future__ import annotations

import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

__all__ = ["MAKERS", "gltf"]

OBJ = """# a comment\r
mtllib a.mtl\r
o square\r
v 0 0 0\r
v 1 0 0\r
v 1 1 0\r
v 0 1 0\r
vt 0 0\r
vn 0 0 1\r
g front\r
usemtl wood\r
s 1\r
f 1/1/1 2/1/1 3/1/1 4/1/1\r
l 1 3\r
"""
PLY = """ply
format ascii 1.0
comment by hand
element vertex 4
property double x
property double y
property double z
property int quality
element face 1
property list uchar int vertex_indices
property uchar flag
element edge 1
property int vertex1
property int vertex2
end_header
0 0 0 7
1 0 0 8
1 1 0 9
0 1 0 -1
4 0 1 2 3 5
0 2
"""
USD = """#usda 1.0
(
    upAxis = "Z"
)
def Mesh "square" (
    variants = { string look = "old" }
    prepend variantSets = "look"
)
{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    custom string note = "kept"
    variantSet "look" = {
        "old" { }
    }
}
"""
FACETS = ["0 0 0", "1 0 0", "1 1 0"], ["0 0 0", "1 1 0", "0 1 0"]
STL = "solid a\n" + "".join(
    "facet normal 0 0 1\nouter loop\n" + "".join(f"vertex {v}\n" for v in facet) + "endloop\nendfacet\n"
    for facet in FACETS
) + "endsolid a\n"  # fmt: skip
OFF = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>
<object id="1" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="1" y="1" z="0"/><vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/>
<triangle v1="0" v2="2" v3="3"/></triangles></mesh></object></resources>
<build><item objectid="1"/></build></model>"""
COLLADA = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><created>2020-01-01</created>
<modified>2020-01-01</modified></asset><library_geometries><geometry id="g" name="g"><mesh><source id="p">
<float_array id="pa" count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array><technique_common><accessor source="#pa"
count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 0 2 3</p></triangles></mesh>
</geometry></library_geometries><library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry
url="#g"/></node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def gltf() -> tuple[dict[str, Any], bytes]:
    """A square with everything beside it that a bake has to leave alone."""
    square = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0)
    data = square + struct.pack("<6H", 0, 1, 2, 0, 2, 3) + struct.pack("<8f", *range(8))
    view = [(0, 48), (48, 12), (60, 32)]
    vec3 = {"componentType": 5126, "count": 4, "type": "VEC3"}
    attributes = {"POSITION": 0, "TEXCOORD_0": 2, "_OWN": 2}
    targets = [{"POSITION": 0}]
    part = {"attributes": attributes, "indices": 1, "material": 0, "targets": targets}
    channel = {"sampler": 0, "target": {"node": 1, "path": "translation"}}
    times = {
        "bufferView": 2,
        "componentType": 5126,
        "count": 4,
        "type": "SCALAR",
        "min": [0],
        "max": [3],
    }
    json_ = {
        "asset": {"version": "2.0", "copyright": "by hand", "extras": {"a": 1}},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"name": "joint", "camera": 0}],
        "meshes": [{"primitives": [part], "weights": [0], "extras": {"names": ["smile"]}}],
        "materials": [{"name": "wood", "extensions": {"EXT_unheard_of": {"b": 2}}}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
        "skins": [{"joints": [1]}],
        "animations": [{"channels": [channel], "samplers": [{"input": 3, "output": 0}]}],
        "extensionsUsed": ["EXT_unheard_of"],
        "accessors": [
            {"bufferView": 0, **vec3, "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
            times,
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": a, "byteLength": n} for a, n in view],
        "buffers": [{"byteLength": len(data)}],
    }  # fmt: skip
    return json_, data


def glb(path: Path) -> None:
    document, data = gltf()
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = [(b"JSON", text), (b"BIN\0", data), (b"OWN\0", b"kept")]
    body = b"".join(struct.pack("<I", len(c)) + kind + c for kind, c in chunks)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


def beside(path: Path) -> None:
    document, data = gltf()
    document["buffers"][0]["uri"] = "a%20b.bin"
    path.with_name("a b.bin").write_bytes(data)
    path.write_text(json.dumps(document), encoding="utf-8")


def obj(path: Path) -> None:
    path.with_name("a.mtl").write_text("newmtl wood\n", encoding="ascii")
    path.write_bytes(OBJ.encode())


def packed(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", MODEL)
        archive.writestr("[Content_Types].xml", "<Types/>")


def usd_package(path: Path) -> None:
    info = zipfile.ZipInfo("a.usda")  # contents start at multiples of 64 bytes
    pad = -(30 + len(info.filename) + 4) % 64
    info.extra = b"\x86\x19" + pad.to_bytes(2, "little") + bytes(pad)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(info, USD)


def usd_binary(path: Path) -> None:
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(USD)
    layer.Export(str(path))


def text(content: str) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(content.encode()) and None


MAKERS: dict[str, Callable[[Path], None]] = {
    ".glb": glb, ".gltf": beside, ".obj": obj, ".ply": text(PLY), ".usda": text(USD), ".usd": text(USD),
    ".usdc": usd_binary, ".usdz": usd_package, ".stl": text(STL), ".off": text(OFF), ".3mf": packed,
    ".dae": text(COLLADA), ".fbx": text("; FBX 7.4.0 project file"), ".blend": text("of old"),
}  # fmt: skip

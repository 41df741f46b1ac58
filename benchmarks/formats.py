"""What each format can hold and what it keeps, found by doing it: prints docs/formats.md.

    python benchmarks/formats.py > docs/formats.md

Makes a small file of every format with as much in it as the format knows, bakes it with every store,
reads the results again, and compares.
"""

from __future__ import annotations

import contextlib
import json
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from samples import MAKERS, gltf

import aobake
from aobake.meshes import formats
from aobake.settings import Store

STORES: tuple[Store, ...] = ("color", "occlusion", "attribute")
AO = np.array([0.0, 0.25, 0.5, 1.0], np.float32)
NAMES = {
    ".glb": "glTF binary", ".gltf": "glTF", ".obj": "Wavefront OBJ", ".ply": "PLY", ".usda": "USD, text",
    ".usd": "USD", ".usdc": "USD, binary", ".usdz": "USD, package", ".stl": "STL", ".off": "OFF",
    ".3mf": "3MF", ".dae": "COLLADA", ".fbx": "FBX", ".blend": "Blender",
}  # fmt: skip


def result(scene: aobake.Scene, ao: list[Any]) -> aobake.BakedVertices:
    settings = aobake.BakeSettings()
    return aobake.BakedVertices(
        scene=scene, settings=settings, plan=aobake.plan(scene, settings), ao=ao,
        standard_error=ao, rays=0, seconds={}, findings=(), warnings=(),
    )  # fmt: skip


def baked(source: Path, target: Path, store: Store) -> tuple[str, ...]:
    """Bake the known values with a store; what there is to say about it."""
    scene = aobake.load(source)
    settings = aobake.StoreSettings(store=store)
    said = formats.check_target(scene, target, settings)
    aobake.save(
        result(scene, [AO[: len(mesh.vertices)] for _, mesh in scene.placed()]),
        target,
        store=settings,
    )
    if formats.load(target, root=source.parent).vertices != scene.vertices:
        raise RuntimeError(f"{target}: it was read again with other vertices")
    return said


def unpacked(path: Path) -> tuple[dict[str, Any], bytes, bytes]:
    """JSON, binary and everything after it, of a glTF or GLB file."""
    data = path.read_bytes()
    if path.suffix == ".gltf":
        document = json.loads(data)
        names = [buffer["uri"].replace("%20", " ") for buffer in document["buffers"]]
        return document, b"".join(path.with_name(name).read_bytes() for name in names), b""
    size = struct.unpack_from("<I", data, 12)[0]
    binary = 20 + size + 8
    length = struct.unpack_from("<I", data, 20 + size)[0]
    return json.loads(data[20 : 20 + size]), data[binary : binary + length], data[binary + length :]


def place(path: Path) -> str:
    """Where a result holds the values, as it is in the file."""
    match path.suffix:
        case ".glb" | ".gltf":
            document = unpacked(path)[0]
            primitive = document["meshes"][0]["primitives"][0]
            own = gltf()[0]["meshes"][0]["primitives"][0]["attributes"]
            found = [name for name in primitive["attributes"] if name not in own]
            textured = "occlusionTexture" in document["materials"][primitive["material"]]
            return ", ".join(found + ["occlusionTexture"] * textured)
        case ".obj":
            colored = all(
                len(line.split()) == 7 for line in path.read_text().splitlines() if line[:2] == "v "
            )
            return "vertex colors" if colored else "nothing"
        case ".ply":
            header = path.read_bytes().partition(b"end_header")[0].decode().split()
            return ", ".join(name for name in ("red", "green", "blue", "ao") if name in header)
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/square")
    found = [
        primvar.GetPrimvarName() for primvar in UsdGeom.PrimvarsAPI(prim).GetAuthoredPrimvars()
    ]
    return ", ".join(f"primvars:{name}" for name in found)


def kept(source: Path, target: Path) -> Iterator[tuple[str, bool]]:
    """What of the source is in the target as it was."""
    match source.suffix:
        case ".glb" | ".gltf":
            yield from kept_gltf(source, target)
        case ".obj":
            before, after = (path.read_bytes().split(b"\n") for path in (source, target))
            yield (
                "every line but those of vertices",
                [x for x in before if x[:2] != b"v "] == [x for x in after if x[:2] != b"v "],
            )
            yield (
                "what stands in the lines of vertices",
                all(b.startswith(a.rstrip(b"\r")) for a, b in zip(before, after, strict=True)),
            )
            yield "ends of lines", all(a[-1:] == b[-1:] for a, b in zip(before, after, strict=True))
            yield (
                "material library",
                target.with_name("a.mtl").read_bytes() == source.with_name("a.mtl").read_bytes(),
            )
        case ".ply":
            before, after = (path.read_text().split("\n") for path in (source, target))
            lines = [line for line in after if not line.startswith("property") or line in before]
            begin = before.index("end_header")
            yield "every line of the header", lines[: begin + 1] == before[: begin + 1]
            rows = lines[begin + 1 :], before[begin + 1 :]
            yield (
                "further properties of vertices",
                all(a.startswith(b) for a, b in list(zip(*rows, strict=True))[:4]),
            )
            yield "faces, polygons and further elements", rows[0][4:] == rows[1][4:]
        case _:
            yield from kept_usd(source, target)


def kept_gltf(source: Path, target: Path) -> Iterator[tuple[str, bool]]:
    (old, binary, rest), (new, grown, after) = unpacked(source), unpacked(target)
    yield "every byte of the buffers", grown.startswith(binary)
    for what in ("animations", "skins", "cameras", "nodes", "scenes", "asset"):
        yield what, new[what] == old[what]
    yield (
        "accessors and buffer views",
        all(new[n][: len(old[n])] == old[n] for n in ("accessors", "bufferViews")),
    )
    part, was = new["meshes"][0]["primitives"][0], old["meshes"][0]["primitives"][0]
    yield "attributes of one's own", was["attributes"].items() <= part["attributes"].items()
    yield "morph targets", part["targets"] == was["targets"]
    yield (
        "materials",
        all(
            b.items() <= a.items() for a, b in zip(new["materials"], old["materials"], strict=False)
        ),
    )
    yield "unknown extensions", new["extensionsUsed"] == old["extensionsUsed"]
    yield "extras", new["meshes"][0]["extras"] == old["meshes"][0]["extras"]
    if source.suffix == ".glb":
        yield "unknown chunks", after == rest


def kept_usd(source: Path, target: Path) -> Iterator[tuple[str, bool]]:
    from pxr import Sdf, Usd, UsdGeom

    old, new = Usd.Stage.Open(str(source)), Usd.Stage.Open(str(target))
    yield (
        "the file itself, as the layer below",
        Sdf.Layer.FindOrOpen(str(source)) in new.GetLayerStack(),
    )
    was, now = old.GetPrimAtPath("/square"), new.GetPrimAtPath("/square")
    same = all(now.GetAttribute(a.GetName()).Get() == a.Get() for a in was.GetAuthoredAttributes())
    yield "every attribute", same
    yield (
        "variants",
        now.GetVariantSets().GetAllVariantSelections()
        == was.GetVariantSets().GetAllVariantSelections(),
    )
    yield "axes and units", UsdGeom.GetStageUpAxis(new) == UsdGeom.GetStageUpAxis(old)


def yes(holds: bool) -> str:
    return "yes" if holds else "no"


def row(suffix: str, folder: Path) -> tuple[list[str], dict[str, bool]]:
    """The row of a format, and what a bake with the first store keeps."""
    folder.mkdir()
    source = folder / f"a{suffix}"
    MAKERS[suffix](source)
    held: dict[str, bool] = {}
    cells = []
    try:
        scene = aobake.load(source)
        read = len(scene.instances) == 1 and scene.triangles == 2
    except aobake.InputError:
        read = False
    for store in STORES:
        target = folder / f"{store}{suffix}"
        with contextlib.suppress(aobake.OutputError):
            if read:
                baked(source, target, store)
        cells.append(place(target) if target.exists() else "-")
        if target.exists():
            for what, holds in kept(source, target):
                held[what] = held.get(what, True) and holds
    written = suffix in formats.WRITABLE and cells[0] != "-"
    return [f"{suffix[1:]}", NAMES[suffix], yes(read), yes(written), *cells], held


INTRO = """# Formats

<!-- Printed by benchmarks/formats.py from real bakes. Do not edit: run it again. -->

What is read and written, and where each `--store` puts the values. A dash: it cannot be written; STL, OFF, 3MF,
DAE and packages of USD are read, and written as GLB or another format of this table. A format that has no place
of the kind asked for takes the next one it has, and a warning says so.
"""
KEPT = """
## What is kept

Each line was compared after a bake with every store, with the file in the same folder.
"""
NOTES = """
## Good to know

- **glTF**: several primitives that share their vertices share the values where they can; nodes that share a
  mesh get copies of what differs, and share the rest. Instances of EXT_mesh_gpu_instancing share the mean of
  theirs. With `--store occlusion` the values can be read as the attribute `_AO` as well. What
  KHR_node_visibility hides is left as it is. Draco and meshopt streams stay compressed; the new attributes
  stand beside them.
- **Animations** of glTF: skinned and morphed meshes are baked in their rest pose. `--pose Walk@0.5` bakes the asset
  as it stands half a second into the clip Walk (a name or a number; `aobake info` lists them with their length).
  Only the occlusion is written back: the asset keeps its rest pose and its clips. Another format is written as
  it stands in the pose. What KHR_animation_pointer moves is passed over, with a warning.
- **USD** needs the extra `usd`. The result is a layer over the file that was read, and refers to it: keep both,
  in the same places relative to each other. Cages of subdivision surfaces and skinned meshes are baked as their
  points are authored, at the earliest time. Native instances that hold meshes are no longer shared in the
  layer, so that each has values of its own; those of a point instancer share their mean. Viewers show
  displayColor where no material is bound, or where it reads it.
- **3MF** and **COLLADA** need the extra `formats`.
- **FBX** and **.blend** have no maintained reader outside of their programs: export GLB.
- **Baking a file twice**: colours are multiplied again, and a warning says so where the first bake can be told
  (glTF, USD, PLY; not OBJ). `--store occlusion` and `--store attribute` replace what the first bake left. Best
  is to keep the original.
"""


def page() -> str:
    with tempfile.TemporaryDirectory() as scratch:
        rows = {suffix: row(suffix, Path(scratch) / suffix[1:]) for suffix in MAKERS}
    head = ["suffix", "format", "read", "written", *(f"--store {store}" for store in STORES)]
    lines = [INTRO, table(head, [cells for cells, _ in rows.values()]), KEPT]
    kept_rows = [
        [suffix[1:], what, yes(holds)]
        for suffix, (_, held) in rows.items()
        for what, holds in held.items()
    ]
    return "\n".join([*lines, table(["suffix", "what", "kept"], kept_rows), NOTES.rstrip()]) + "\n"


def table(head: list[str], rows: list[list[str]]) -> str:
    return "\n".join(
        "| " + " | ".join(cells) + " |" for cells in [head, ["---"] * len(head), *rows]
    )


if __name__ == "__main__":
    print(page(), end="")

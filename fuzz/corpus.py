"""The files that fuzzing starts from: one small one for each thing that a reader branches on, and your own.

python -m fuzz.corpus FOLDER [FILE ...]
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

import numpy as np

import aobake
from aobake.settings import StoreSettings
from tests.meshes.formats.gltf.build import TWO_TRIANGLES, Builder, square_builder
from tests.meshes.formats.gltf.meshopt_encoder import attributes
from tests.meshes.formats.gltf.test_gltf_fuzz import SEEDS
from tests.meshes.formats.test_ply_read import write as ply_of_everything

__all__ = ["SUFFIXES", "make_corpus"]

SUFFIXES = (".glb", ".gltf", ".obj", ".ply")
LARGEST = 1 << 20  # bytes of a file given by hand; more would make every run of it slow

OBJS = {
    "everything": """# everything that a reader branches on
mtllib none.mtl other.mtl
o part one
v 0 0 0
v 1 0 0 1.0
v 1 1 0 0.5 0.25 0.125
v 0 1 0 \\
 0.5 0.5 0.5
vt 0 0
vt 1 0 0
vn 0 0 1
vn 0 0 -2
g a b
usemtl red
s 1
f 1/1/1 2/2/1 3//2
f -4 -3 -2 -1
f 1/1 2/1 3/2 4/2
l 1 2 3
p 1
s off
usemtl blue
g
f 1//1 3//1 4//1
vp 0.1
curv 0 1 1 2
""",
    "bare": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "windows": "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nvn 0 0 1\r\nf 1//1 2//1 3//1\r\n",
    "pentagon": "v 0 0 0\nv 2 0 0\nv 1 .5 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4 5\n",
}
PLY_STRIPS = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element tristrips 1
property list int int vertex_indices
end_header
0 0 0 255 0 0
1 0 0 0 255 0
0 1 0 0 0 255
1 1 0 9 9 9
6 0 1 2 3 -1 0
"""


def make_corpus(folder: Path, files: list[Path]) -> dict[str, Path]:
    """Write the corpus, and copies of further files; suffix -> the folder of its files.

    Files that are larger than a megabyte or of another format are left out.
    """
    folders = {suffix: folder / suffix[1:] for suffix in SUFFIXES}
    for place in folders.values():
        place.mkdir(parents=True, exist_ok=True)
    _gltf(folders)
    for name, text in OBJS.items():
        (folders[".obj"] / f"{name}.obj").write_text(text, encoding="ascii")
    for order in ("", "<", ">"):
        name = {"": "ascii", "<": "little", ">": "big"}[order]
        (folders[".ply"] / f"{name}.ply").write_bytes(ply_of_everything(order))
    (folders[".ply"] / "strips.ply").write_text(PLY_STRIPS, encoding="ascii")
    _written_by_aobake(folders)
    for file in files:
        if file.suffix.lower() in folders and file.stat().st_size <= LARGEST:
            shutil.copyfile(file, folders[file.suffix.lower()] / file.name)
    return folders


def _gltf(folders: dict[str, Path]) -> None:
    seeds = {name: make() for name, make in SEEDS.items()}
    seeds["square"] = square_builder()
    seeds["meshopt"] = _meshopt()
    for name, builder in seeds.items():
        builder.glb(folders[".glb"] / f"{name}.glb")
        builder.gltf(folders[".gltf"] / f"{name}.gltf", embed=True)


def _meshopt() -> Builder:
    """A square whose positions are a meshopt stream."""
    builder = Builder()
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
    stream = attributes(corners.view(np.uint8).reshape(4, 12), 0)
    packed = {"buffer": 0, "byteLength": len(stream), "byteStride": 12, "count": 4}
    builder.data += stream
    view = builder.put(
        "bufferViews",
        {
            "buffer": 0,
            "byteLength": len(stream),
            "extensions": {"EXT_meshopt_compression": packed | {"mode": "ATTRIBUTES"}},
        },
    )
    entry = {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3"}
    position = builder.put("accessors", entry)
    primitive = {
        "attributes": {"POSITION": position},
        "indices": builder.accessor(TWO_TRIANGLES, "u2"),
    }
    return builder.show(builder.node(mesh=builder.mesh(primitive)))


def _written_by_aobake(folders: dict[str, Path]) -> None:
    """What aobake writes itself: two placed meshes, with normals and without, and ambient occlusion."""
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3]])
    meshes = [
        aobake.Mesh(vertices=corner, faces=faces, name="corner"),
        aobake.Mesh(vertices=corner + 2.0, faces=faces, normals=corner + 0.1),
    ]
    baked = aobake.bake_vertices(aobake.Scene.from_meshes(meshes), aobake.BakeSettings(rays=4))
    for suffix, place in folders.items():
        aobake.save(baked, place / f"baked{suffix}")
    aobake.save(baked, folders[".glb"] / "texture.glb", store=StoreSettings(store="occlusion"))


def main() -> None:
    """Make a corpus from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("folder", type=Path)
    parser.add_argument("files", type=Path, nargs="*", help="files of your own to add")
    asked = parser.parse_args()
    for place in make_corpus(asked.folder, asked.files).values():
        sys.stdout.write(f"{place}: {len(list(place.iterdir()))} files\n")


if __name__ == "__main__":
    main()

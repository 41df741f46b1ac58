"""How long it takes to read a large GLB and to write it with its occlusion, and how much memory.

    python benchmarks/assets.py [--megabytes 100] [--repeats 3]

Prints a Markdown table. Every run is a process of its own; memory is its peak above what it took before
the file was read. The file is made of scan-like meshes with normals, texture coordinates and a picture.
"""

from __future__ import annotations

import argparse
import json
import resource
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scan import scan
from tables import Spread, Table

BYTES_A_FACE = 28  # half a vertex of 32 bytes, and three indices of 4 bytes
MEGABYTE = 1_000_000
STORES = ("color", "occlusion", "attribute")


def make(path: Path, megabytes: float) -> None:
    """A GLB of this size: four meshes, and a tenth of it a picture."""
    parts, views, accessors, meshes = [], [], [], []

    def view(data: bytes) -> int:
        start = sum(map(len, parts))
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(data)})
        parts.append(data + b"\0" * (-len(data) % 4))
        return len(views) - 1

    def accessor(values: Any, kind: str, component: int, **more: Any) -> int:
        entry = {"bufferView": view(values.tobytes()), "componentType": component}
        accessors.append({**entry, "count": len(values), "type": kind, **more})
        return len(accessors) - 1

    for number in range(4):
        vertices, faces = scan(int(megabytes * MEGABYTE * 0.9 / 4 / BYTES_A_FACE))
        where = (vertices + np.array([3.0 * number, 0.0, 0.0])).astype(np.float32)
        low, high = where.min(axis=0).tolist(), where.max(axis=0).tolist()
        attributes = {
            "POSITION": accessor(where, "VEC3", 5126, min=low, max=high),
            "NORMAL": accessor(vertices.astype(np.float32), "VEC3", 5126),
            "TEXCOORD_0": accessor(np.ascontiguousarray(where[:, :2]), "VEC2", 5126),
        }
        indices = accessor(faces.astype(np.uint32).reshape(-1), "SCALAR", 5125)
        meshes.append(
            {"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}
        )
    noise = np.random.default_rng(0).bytes(int(megabytes * MEGABYTE * 0.1))
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2, 3]}],
        "nodes": [{"mesh": number} for number in range(4)], "meshes": meshes,
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"bufferView": view(noise), "mimeType": "image/png"}],
        "accessors": accessors, "bufferViews": views,
    }  # fmt: skip
    data = b"".join(parts)
    text = json.dumps({**document, "buffers": [{"byteLength": len(data)}]}).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0")
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body) + len(data)) + body + data)


def peak_bytes() -> int:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def once(source: Path, target: Path, store: str) -> None:
    """Read and write in this process; print what it took as JSON."""
    from aobake.meshes import formats
    from aobake.meshes.formats import gltf  # noqa: F401 - imported before the clock starts
    from aobake.settings import StoreSettings

    settings = StoreSettings(store=store)  # type: ignore[arg-type]
    rng = np.random.default_rng(0)
    before = peak_bytes()
    start = time.perf_counter()
    scene = formats.load(source)
    read = time.perf_counter()
    ao = [rng.random(len(mesh.vertices), np.float32) for _, mesh in scene.placed()]
    made = time.perf_counter()
    formats.write_vertex_ao(scene, ao, target, settings)
    took = {"read": read - start, "write": time.perf_counter() - made}
    print(json.dumps({**took, "memory": peak_bytes() - before, "written": target.stat().st_size}))


def measured(source: Path, target: Path, store: str, repeats: int) -> dict[str, Spread]:
    """The spread of several runs."""
    command = [sys.executable, __file__, "--once", str(source), str(target), store]
    # Linux counts the peak of the process that started another one as the other one's: this one stays small.
    runs = []
    for _ in range(repeats):
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        runs.append(json.loads(done.stdout))
    return {name: Spread.of(run[name] for run in runs) for name in runs[0]}


def large_glb(megabytes: float, repeats: int) -> Table:
    """Reading and writing with every store."""
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch) / "large.glb"
        making = [sys.executable, __file__, "--make", str(source)]
        subprocess.run([*making, "--megabytes", str(megabytes)], check=True)
        size = source.stat().st_size
        for store in STORES:
            took = measured(source, Path(scratch) / f"{store}.glb", store, repeats)
            rates = [size / took[way].median / MEGABYTE for way in ("read", "write")]
            share = took["memory"].median / size
            written = took["written"].median / MEGABYTE
            rows.append([store, took["read"], took["write"], *rates, share, written])
    columns = ("--store", "read, s", "write, s", "read, MB/s", "write, MB/s",
               "peak memory, of the file's size", "written, MB")  # fmt: skip
    return Table("A large GLB", columns, rows, {"MB": size / MEGABYTE})


def run(quick: bool) -> Iterator[Table]:
    """One file of 10 or 100 MB."""
    yield large_glb(*((10, 1) if quick else (100, 3)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=float, default=100)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--make", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--once", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.once:
        once(Path(arguments.once[0]), Path(arguments.once[1]), arguments.once[2])
    elif arguments.make:
        make(arguments.make, arguments.megabytes)
    else:
        print(large_glb(arguments.megabytes, arguments.repeats).markdown())


if __name__ == "__main__":
    main()

"""How close a whole bake comes to Embree itself, what the whole command takes, and what memory.

    python benchmarks/tracing.py [--faces 70000] [--rays 256] [--repeats 5]

The bare rate is that of rtcOccluded8 on ready-made packets: the same rays of the same points in the same
order, in as many threads, with nothing but the calls inside the clock. Rates are compared within one
run, in turn, since machines are shared; medians are quoted.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scan import scan

import aobake
from aobake.meshes.surfaces import surfaces_of
from aobake.points import vertex_points
from aobake.prepare import build
from aobake.tracing import embree, kernels, origins
from aobake.tracing.compiled import aligned, tight_kernel
from aobake.tracing.contacts import note_triangle
from aobake.tracing.estimate import processors
from aobake.tracing.sampling import direction_sets

PACKETS = 1 << 15  # ready-made at a time and thread: 12 MiB


@tight_kernel
def make_packets(origin, normal, numbers, sets, frame, packets):
    """Fill packets (N, 96) with all rays of some points, as kernels.trace makes them."""
    n = 0
    for point in range(len(origin)):
        bits = kernels.mix(0, numbers[point])
        kernels.turned_frame(normal[point], bits, frame)
        chosen = sets[np.int64(bits & np.uint64(len(sets) - 1))]
        for number in range(len(chosen)):
            kernels.ready(packets[n], packets[n].view(np.int32))
            kernels.set_out(packets[n], origin[point])
            kernels.aim(packets[n], chosen[number], frame, np.float32(np.inf))
            n += 1


@tight_kernel
def trace_packets(function, scene, valid, packets):
    """Nothing but the calls."""
    for n in range(len(packets)):
        kernels.call_packet(function, valid.ctypes.data, scene, packets[n].ctypes.data)


class Bare:
    """Ready-made packets for all vertices of a scene, traced by threads."""

    def __init__(self, scene: aobake.Scene, rays: int) -> None:
        settings = aobake.BakeSettings(rays=rays)
        self.prepared = build(scene, surfaces_of(scene, settings), settings)
        points = vertex_points(scene, self.prepared)
        world = self.prepared.world
        self.origins = np.empty(points.positions.shape, np.float32)
        functions = embree.functions()
        start = time.perf_counter()
        origins.place_origins(
            (functions.point_query, note_triangle()),
            world.tree.address,
            world.arrays,
            world.frame.apply(points.positions),
            points.normals,
            origins.scratch(),
            self.origins,
            np.zeros(len(points), np.uint8),
        )
        self.origins_s = time.perf_counter() - start
        self.normals = points.normals.astype(np.float32)
        self.numbers, self.sets = points.numbers, direction_sets(rays)
        self.threads = processors()
        self.memory = [
            aligned(PACKETS * 96, np.float32).reshape(-1, 96) for _ in range(self.threads)
        ]
        self.valid = aligned(8, np.int32)
        self.valid[:] = -1

    def seconds(self) -> float:
        """Seconds inside the calls, all points once."""
        per_thread = PACKETS // self.sets.shape[1]
        total = 0.0
        with ThreadPoolExecutor(self.threads) as pool:
            for first in range(0, len(self.origins), per_thread * self.threads):
                starts = [first + k * per_thread for k in range(self.threads)]
                filled = list(pool.map(self._fill, self.memory, starts))
                start = time.perf_counter()
                list(pool.map(self._trace, filled))
                total += time.perf_counter() - start
        return total

    def _fill(self, memory: NDArray[np.float32], first: int) -> NDArray[np.float32]:
        part = slice(first, first + PACKETS // self.sets.shape[1])
        count = len(self.origins[part])
        packets = memory[: count * self.sets.shape[1]]
        frame = np.zeros((3, 3), np.float32)
        make_packets(
            self.origins[part],
            self.normals[part],
            self.numbers[part],
            self.sets,
            frame,
            packets,
        )
        return packets

    def _trace(self, packets: NDArray[np.float32]) -> None:
        functions = embree.functions()
        trace_packets(functions.occluded8, self.prepared.world.tree.address, self.valid, packets)


def command_seconds(scene: aobake.Scene, rays: int) -> tuple[float, float]:
    """(seconds of the whole `aobake vertex` process, seconds of tracing inside it)."""
    with tempfile.TemporaryDirectory() as folder:
        given, report = Path(folder, "scan.glb"), Path(folder, "report.json")
        aobake.save(aobake.bake_vertices(scene, aobake.BakeSettings(rays=1)), given)
        command = [
            sys.executable,
            "-m",
            "aobake",
            "vertex",
            str(given),
            "-o",
            str(Path(folder, "ao.glb")),
        ]
        start = time.perf_counter()
        subprocess.run(
            [*command, "--rays", str(rays), "--report", str(report), "--quiet"], check=True
        )
        return time.perf_counter() - start, json.loads(report.read_text())["seconds"]["trace"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--faces", type=int, default=70_000)
    parser.add_argument("--rays", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=5)
    asked = parser.parse_args()
    vertices, faces = scan(asked.faces)
    scene = aobake.Scene.from_arrays(vertices, faces, name="scan")
    settings = aobake.BakeSettings(rays=asked.rays)
    bare = Bare(scene, asked.rays)
    bare = Bare(scene, asked.rays)  # compiled now: the second one's origins are timed
    aobake.bake_vertices(scene, settings)
    rows: list[tuple[float, float, float]] = []
    for _ in range(asked.repeats):
        alone = bare.seconds()
        start = time.perf_counter()
        baked = aobake.bake_vertices(scene, settings)
        rows.append((alone, baked.seconds["trace"], time.perf_counter() - start))
    rays = baked.rays / 1e6
    whole = [alone / all_ for alone, _, all_ in rows]
    traced = [alone / trace for alone, trace, _ in rows]
    commands = [command_seconds(scene, asked.rays) for _ in range(asked.repeats)]
    print(
        f"{len(faces)} faces, {len(vertices)} vertices, {asked.rays} rays, {bare.threads} threads,"
    )
    print(f"median of {asked.repeats} runs in turn (least to most)\n")
    print("| what | value |\n| --- | --- |")
    print(f"| bare rtcOccluded8 | {_spread([rays / r[0] for r in rows])} Mrays/s |")
    print(f"| tracing stage of bake_vertices | {_spread([rays / r[1] for r in rows])} Mrays/s |")
    print(f"| tracing stage / bare rate | {_spread(traced)} |")
    print(f"| whole bake_vertices / bare rate | {_spread(whole)} |")
    origins_share = bare.origins_s / bare.threads / statistics.median(r[1] for r in rows)
    print(f"| origins / tracing stage | {origins_share:.3f} |")
    print(f"| `aobake vertex` | {_spread([c[0] for c in commands])} s |")
    print(f"| `aobake vertex` / its tracing | {_spread([c[0] / c[1] for c in commands])} |")


def _spread(values: list[float]) -> str:
    return f"{statistics.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


if __name__ == "__main__":
    main()

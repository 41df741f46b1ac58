"""How seconds and memory grow with triangles, vertices, texels, rays, instances and threads.

    python benchmarks growth [--quick]
    python benchmarks/growth.py --draw docs/images      draws the last whole run of benchmarks/results
    python benchmarks/growth.py --largest               16 million triangles, 8 million vertices, 64 rays

Every point is a process of its own: its peak memory is that of one bake. Memory is counted from what the
process has before there is a mesh. The exponent is the slope of a straight line through the logarithms of
the upper half of the points: 1 is linear. Per unit is what each further one takes, from the last two points.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from machine import available_memory, peak_memory
from tables import Cell, Spread, Table

if TYPE_CHECKING:
    import aobake

HERE = Path(__file__).parent
POINTS = 20_000  # that triangles grow around
TILE = 1_000  # triangles of a mesh that is instanced
LARGEST, LARGEST_MEMORY = 16_000_000, 12 << 30


@dataclass(frozen=True)
class Axis:
    """What grows, from where to where, and what else is fixed."""

    name: str
    fixed: str
    sizes: Sequence[int]
    quick: Sequence[int]


AXES = (
    Axis("triangles", "20,000 points of them, 64 rays",
         (10_000, 40_000, 160_000, 640_000, 2_560_000, 10_240_000), (4_000, 16_000, 64_000)),
    Axis("vertices", "of a scan with twice as many triangles, 64 rays",
         (2_000, 8_000, 32_000, 128_000, 512_000, 2_048_000), (2_000, 8_000, 32_000)),
    Axis("texels", "of the image, 6,000 triangles, 16 rays",
         (256**2, 512**2, 1024**2, 2048**2, 4096**2), (128**2, 256**2, 512**2)),
    Axis("rays", "at each vertex of a scan of 70,000 triangles",
         (16, 64, 256, 1024, 4096), (16, 64, 256)),
    Axis("instances", "of a mesh of 1,000 triangles, 16 rays", (1, 4, 16, 64, 256, 1024), (1, 8, 64)),
    Axis("threads", "a scan of 70,000 triangles, 256 rays", (), ()),
)  # fmt: skip


def bake(axis: str, size: int) -> Mapping[str, float]:
    """One bake in this process: stage -> seconds, and what memory it took."""
    import numpy as np
    from scan import scan

    import aobake

    work: Callable[[], object]
    _warm_up(aobake.Scene.from_arrays(*scan(200)))
    before = peak_memory()
    if axis == "triangles":
        scene = aobake.Scene.from_arrays(*scan(size))
        chosen = np.linspace(0, scene.vertices - 1, POINTS).astype(np.int64)
        at = scene.meshes[0].vertices[chosen]
        work = lambda: aobake.visibility(scene, at, at, aobake.BakeSettings(rays=64))  # noqa: E731
    elif axis == "texels":
        from texture import unwrapped

        side = round(math.sqrt(size))
        scene, _ = unwrapped(6_000, 256)
        settings = aobake.BakeSettings(size=side, rays=16, denoise="off", padding=0)
        work = lambda: aobake.bake_texture(scene, settings)  # noqa: E731
    else:
        scene, settings = _vertex_case(axis, size)
        work = lambda: aobake.bake_vertices(scene, settings)  # noqa: E731
    start = time.perf_counter()
    found = work()
    seconds = time.perf_counter() - start
    stages = getattr(found, "seconds", {})
    return {
        "seconds": seconds - stages.get("compile", 0.0) - stages.get("unwrap", 0.0),
        "bytes": max(0, peak_memory() - before),
        "rays": float(getattr(found, "rays", 0) if stages else 0),
    }


def _warm_up(scene: aobake.Scene) -> None:
    """Everything compiled, for meshes in one place and in several."""
    import aobake

    place = scene.meshes[0].vertices[:1]
    aobake.visibility(scene, place, place, aobake.BakeSettings(rays=1))
    for instances in (1, 4):
        some = aobake.Scene(meshes=scene.meshes, instances=_grid(instances))
        aobake.bake_vertices(some, aobake.BakeSettings(rays=1))


def _vertex_case(axis: str, size: int) -> tuple[aobake.Scene, aobake.BakeSettings]:
    from scan import scan

    import aobake

    faces = {"vertices": 2 * size, "instances": TILE}.get(axis, 70_000)
    scene = aobake.Scene.from_arrays(*scan(faces))
    if axis == "instances":
        scene = aobake.Scene(meshes=scene.meshes, instances=_grid(size))
    rays = {"vertices": 64, "rays": size, "instances": 16}.get(axis, 256)
    return scene, aobake.BakeSettings(rays=rays, threads=size if axis == "threads" else None)


def _grid(count: int) -> tuple[aobake.Instance, ...]:
    """The first mesh in as many places, beside each other."""
    import numpy as np

    import aobake

    side = math.ceil(math.sqrt(count))
    instances = []
    for number in range(count):
        matrix = np.eye(4)
        matrix[:2, 3] = 2.5 * (number % side), 2.5 * (number // side)
        instances.append(aobake.Instance(mesh=0, transform=matrix))
    return tuple(instances)


def measured(axis: str, size: int, repeats: int) -> dict[str, Spread]:
    """The spread of some processes."""
    command = [sys.executable, __file__, "--bake", axis, str(size)]
    runs = []
    for _ in range(repeats):
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        runs.append(json.loads(done.stdout))
    return {what: Spread.of(run[what] for run in runs) for what in runs[0]}


def slope(sizes: Sequence[float], values: Sequence[float]) -> float | None:
    """d log value / d log size over the upper half of the points; None where there is nothing to fit."""
    pairs = [(math.log(s), math.log(v)) for s, v in zip(sizes, values, strict=True) if v > 0.0]
    pairs = pairs[min(len(pairs) // 2, max(0, len(pairs) - 3)) :]
    if len(pairs) < 2:
        return None
    x, y = (sum(column) / len(pairs) for column in zip(*pairs, strict=True))
    return sum((a - x) * (b - y) for a, b in pairs) / sum((a - x) ** 2 for a, _ in pairs)


def per_unit(sizes: Sequence[float], values: Sequence[float]) -> float:
    """What each further one takes."""
    return (values[-1] - values[-2]) / (sizes[-1] - sizes[-2])


def counts_of_threads() -> tuple[int, ...]:
    """One thread, and doubling, to one for each processor."""
    from machine import machine

    processors = int(machine()["processors"])
    return tuple(sorted({1, *(1 << k for k in range(9) if 1 << k <= processors), processors}))


def run(quick: bool) -> Iterator[Table]:
    """One table for each of what grows, and the fits."""
    fits: list[list[Cell]] = []
    ends: dict[str, tuple[list[float], list[float], list[float]]] = {}
    for axis in AXES:
        sizes = (axis.quick if quick else axis.sizes) or counts_of_threads()
        found = [measured(axis.name, size, 1 if quick or size > 1_000_000 else 3) for size in sizes]
        rows = [
            [s, f["seconds"], f["bytes"].median / 1e6] for s, f in zip(sizes, found, strict=True)
        ]
        yield Table(f"By {axis.name}", (axis.name, "seconds", "MB"), rows, {"fixed:": axis.fixed})
        seconds, size = [f["seconds"].median for f in found], [f["bytes"].median for f in found]
        ends[axis.name] = list(sizes), seconds, size
        if len(sizes) > 1:
            fits.append([
                axis.name, slope(sizes, seconds), slope(sizes, size),
                *((None, None) if axis.name == "threads" else
                  (1e6 * per_unit(sizes, seconds), per_unit(sizes, size))),
            ])  # fmt: skip
    columns = ("with", "exponent of seconds", "exponent of memory", "us per unit", "bytes per unit")
    yield Table("Fits", columns, fits)
    yield calculated(ends)
    if not quick:
        yield from largest()


def calculated(ends: Mapping[str, tuple[list[float], list[float], list[float]]]) -> Table:
    """What is too large to measure here: seconds by the exponent, memory by what each further one takes."""
    rows: list[list[Cell]] = []
    for what, axis, size in (
        ("100 million triangles, 50 million vertices, 64 rays", "vertices", 50_000_000),
        ("an image of 8,192 x 8,192 texels, 16 rays", "texels", 8192**2),
        ("an image of 16,384 x 16,384 texels, 16 rays", "texels", 16384**2),
    ):
        sizes, seconds, memory = ends[axis]
        exponent = slope(sizes, seconds) or 1.0
        taken = seconds[-1] * (size / sizes[-1]) ** exponent
        room = memory[-1] + (size - sizes[-1]) * per_unit(sizes, memory)
        rows.append([what, taken, room / 2**30])
    return Table("By calculation from the fits", ("what", "seconds", "GiB"), rows)


def largest() -> Iterator[Table]:
    """The scan of 16 million triangles, beside what 70,000 and Embree's own slow-down let expect."""
    free = available_memory()
    if free is not None and free < LARGEST_MEMORY:
        yield Table(
            "The largest",
            ("what",),
            [[f"left out: {free / 1e9:.0f} GB are free, 12 are asked for"]],
        )
        return
    from bare import Bare
    from scan import scan

    import aobake

    settled = {faces: measured("vertices", faces // 2, 1) for faces in (70_000, LARGEST)}
    rates = []
    for faces in settled:
        bare = Bare(aobake.Scene.from_arrays(*scan(faces)), 64, most_rays=1 << 25)
        rates.append(Spread.of(bare.rate() for _ in range(3)).median)
    small, large = settled.values()
    seconds = [run["seconds"].median for run in (small, large)]
    predicted = seconds[0] * large["rays"].median / small["rays"].median * rates[0] / rates[1]
    rows: list[list[Cell]] = [
        [LARGEST, seconds[1], large["bytes"].median / 2**30, predicted, seconds[1] / predicted]
    ]
    columns = ("triangles", "seconds", "GiB", "seconds expected", "ratio")
    yield Table("The largest", columns, rows, {"rays": 64})


def draw(record: Mapping[str, object], folder: Path) -> None:
    """Two pictures: seconds, and memory, each against everything that grows."""
    import matplotlib.pyplot as plt
    from figures import STYLE

    tables = [t for t in record["tables"] if "fixed:" in t["facts"]]
    for column, name, label in ((1, "time", "seconds"), (2, "memory", "MB")):
        with plt.rc_context({**STYLE, "svg.hashsalt": "aobake"}):
            figure, axes = plt.subplots(2, 3, figsize=(9.0, 5.4), layout="constrained")
            for axis, table in zip(axes.flat, tables, strict=True):
                sizes = [row[0] for row in table["rows"]]
                values = [
                    r[column]["median"] if isinstance(r[column], dict) else r[column]
                    for r in table["rows"]
                ]
                axis.loglog(sizes, values, "o-", ms=4, lw=1.4, color="#1f5fa8")
                linear = [values[-1] * s / sizes[-1] for s in sizes]
                axis.loglog(sizes, linear, ":", lw=1.0, color="#9a9a9a")
                axis.set(xlabel=table["title"].removeprefix("By "), ylabel=label)
                axis.set_title(table["facts"]["fixed:"], loc="left", fontsize=7.5)
            path = folder / f"growth-{name}.svg"
            figure.savefig(path, metadata={"Date": None, "Creator": None})
            plt.close(figure)
            print(path)


def last_whole_run() -> Mapping[str, object]:
    """The record of the last run that was not quick."""
    lines = (HERE / "results" / "growth.jsonl").read_text(encoding="utf-8").splitlines()
    return [record for record in map(json.loads, lines) if not record["quick"]][-1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--draw", type=Path, metavar="FOLDER")
    parser.add_argument("--largest", action="store_true")
    parser.add_argument("--bake", nargs=2, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.bake:
        print(json.dumps(bake(asked.bake[0], int(asked.bake[1]))))
    elif asked.draw:
        draw(last_whole_run(), asked.draw)
    else:
        for table in largest() if asked.largest else run(quick=False):
            print(table.markdown(), flush=True)


if __name__ == "__main__":
    main()

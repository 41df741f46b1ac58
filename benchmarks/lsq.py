"""What fitting values at vertices gains over point sampling on coarse meshes, and what it costs.

    python benchmarks/lsq.py [MESH ...] [--rays 256]

Prints a Markdown table. Errors are those of what is interpolated over the triangles, against a dense bake.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from bodies import coarse_bodies
from tables import Table

import aobake
from aobake.study.bench import bench_of, surface_of_bench


def table_of(scenes: dict[str, aobake.Scene], rays: int, samples: int) -> Table:
    """Point sampling beside the fit, mesh by mesh."""
    rows, gains = [], []
    for name, scene in scenes.items():
        bench = bench_of(scene, aobake.BakeSettings(), 1)
        surface = surface_of_bench(bench, samples, 1024)
        if surface is None:
            continue
        errors, each, seconds = [], [], []
        for fitted in (False, True):
            found, _, spent, took = surface.run(bench.fixed(rays, 1), fitted=fitted)
            errors.append(float(np.sqrt(np.mean(np.square(found - surface.truth)))))
            each.append(spent)
            seconds.append(took)
        gains.append(1.0 - errors[1] / errors[0])
        times = each[1] / each[0], seconds[1] / seconds[0]
        rows.append([name, scene.triangles, *errors, f"{gains[-1]:.0%}", *times])
    columns = (
        "mesh",
        "faces",
        "point RMSE",
        "lsq RMSE",
        "less by",
        "times the rays",
        "times the seconds",
    )
    return Table(
        "Fitted values", columns, rows, {"rays": rays}, f"median: {statistics.median(gains):.0%}"
    )


def run(quick: bool) -> Iterator[Table]:
    """The coarse bodies."""
    yield table_of(coarse_bodies(), *((64, 2000) if quick else (256, 20_000)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*")
    parser.add_argument("--rays", type=int, default=256)
    asked = parser.parse_args()
    scenes = {Path(name).stem: aobake.load(name) for name in asked.meshes} or coarse_bodies()
    print(table_of(scenes, asked.rays, 20_000).markdown())


if __name__ == "__main__":
    main()

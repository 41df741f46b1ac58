"""What fitting values at vertices gains over point sampling on coarse meshes, and what it costs.

    python benchmarks/lsq.py [MESH ...] [--rays 256]

Prints a Markdown table. Errors are those of what is interpolated over the triangles, against a dense bake.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path

import numpy as np
from bodies import coarse_bodies

import aobake
from aobake.study.bench import bench_of, surface_of_bench


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*")
    parser.add_argument("--rays", type=int, default=256)
    asked = parser.parse_args()
    scenes = {Path(name).stem: aobake.load(name) for name in asked.meshes} or coarse_bodies()
    print("| mesh | faces | point RMSE | lsq RMSE | less by | rays | seconds |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    gains = []
    for name, scene in scenes.items():
        bench = bench_of(scene, aobake.BakeSettings(), 1)
        surface = surface_of_bench(bench, 20_000, 1024)
        if surface is None:
            continue
        errors, rays, seconds = [], [], []
        for fitted in (False, True):
            found, _, each, spent = surface.run(bench.fixed(asked.rays, 1), fitted=fitted)
            errors.append(float(np.sqrt(np.mean(np.square(found - surface.truth)))))
            rays.append(each)
            seconds.append(spent)
        gains.append(1.0 - errors[1] / errors[0])
        print(
            f"| {name} | {scene.triangles} | {errors[0]:.4f} | {errors[1]:.4f} | {gains[-1]:.0%} "
            f"| {rays[1] / rays[0]:.1f} times | {seconds[1] / seconds[0]:.1f} times |"
        )
    print(f"\nmedian: {statistics.median(gains):.0%}")


if __name__ == "__main__":
    main()

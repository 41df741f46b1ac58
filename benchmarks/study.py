"""What accuracy costs on six generated assets: the tables of docs/accuracy.md.

    python benchmarks/study.py [--points 1500] [--seeds 3] [--only NAME]

Prints Markdown: slopes, tolerances against fixed numbers of rays, and the overhead of rounds.
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import replace

import numpy as np
from bodies import bodies
from numpy.typing import NDArray

import aobake
from aobake.study import Study, measure, needed, study_extent
from aobake.study.bench import Bench, bench_of

ROUNDS = 5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=1500)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only")
    asked = parser.parse_args()
    extent = replace(
        study_extent(quick=True),
        points=asked.points,
        seeds=asked.seeds,
        reference=32_768,
        sets=(16, 64, 256, 1024),
        methods=(),
        surface=0,
    )
    chosen = {name: s for name, s in bodies().items() if asked.only in {None, name}}
    studies = {name: measure(s, aobake.BakeSettings(), extent) for name, s in chosen.items()}
    slopes(studies)
    budgets(studies)
    tolerances(studies)
    overhead(chosen, asked.points)


def slopes(studies: dict[str, Study]) -> None:
    """How steeply the error of each set of directions falls."""
    names = [c.name for c in next(iter(studies.values())).curves if c.kind == "directions"]
    print(f"\n| slope, 16 to 1,024 rays | {' | '.join(names)} |")
    print(f"| --- |{' --- |' * len(names)}")
    for name, study in studies.items():
        found = {curve.name: curve.slope for curve in study.curves}
        print(f"| {name} | {' | '.join(f'{found[n]:.2f}' for n in names)} |")


def budgets(studies: dict[str, Study]) -> None:
    """The error of fixed numbers of rays."""
    rays = [level.setting for level in next(iter(studies.values())).fixed.levels]
    print(f"\n| RMSE | {' | '.join(rays)} |\n| --- |{' --- |' * len(rays)}")
    for name, study in studies.items():
        print(f"| {name} | {' | '.join(f'{v.rmse:.4f}' for v in study.fixed.levels)} |")


def tolerances(studies: dict[str, Study]) -> None:
    """Rays towards a tolerance, and a fixed number for the same error."""
    print("\n| asset | asked for | rays | RMSE | reported | within 2 | fixed rays for it | ratio |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, study in studies.items():
        for curve in study.curves:
            for level in curve.levels if curve.kind == "tolerance" else ():
                same = needed(study.fixed, level.rmse)
                ratio = "" if same is None else f"{same[0]:.0f} | {level.rays / same[0]:.2f}"
                print(
                    f"| {name} | {level.setting} | {level.rays:.0f} | {level.rmse:.4f} "
                    f"| {level.reported:.4f} | {level.within_2:.1%} | {ratio or ' | '} |"
                )


def overhead(scenes: dict[str, aobake.Scene], points: int) -> None:
    """Processor time towards a tolerance over that of as many rays from each point in one pass, in turn."""
    print("\n| asset | rounds / one pass, median (least to most) |\n| --- | --- |")
    for name, scene in scenes.items():
        bench = bench_of(scene, aobake.BakeSettings(threads=1), 8 * points)
        found = []
        for seed in range(ROUNDS):
            towards = replace(bench.settings, tolerance=0.005, seed=seed)
            start = time.process_time()
            traced = bench.estimates(towards).rays
            rounds = time.process_time() - start
            found.append(rounds / in_one_pass(bench, traced, seed))
        print(f"| {name} | {statistics.median(found):.2f} ({min(found):.2f} to {max(found):.2f}) |")


def in_one_pass(bench: Bench, rays: NDArray[np.int32], seed: int) -> float:
    """Processor seconds of (P,) rays from the points, which count a little less than a power of two."""
    sizes = np.where(rays > 0, 2 ** np.ceil(np.log2(np.maximum(rays, 1))), 0).astype(np.int64)
    spent = 0.0
    for size in np.unique(sizes[sizes > 0]).tolist():
        part = replace(bench, points=bench.points.only(np.flatnonzero(sizes == size)))
        start = time.process_time()
        part.estimates(part.fixed(size, seed))
        spent += time.process_time() - start
    return spent


if __name__ == "__main__":
    main()

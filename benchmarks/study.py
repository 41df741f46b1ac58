"""What accuracy costs on six generated assets, or on files: the tables of docs/accuracy.md.

    python benchmarks/study.py [MESH ...] [--points 1500] [--seeds 3] [--only NAME]

Prints Markdown: slopes, tolerances against fixed numbers of rays, and the overhead of rounds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from bodies import bodies
from numpy.typing import NDArray
from tables import Spread, Table

import aobake
from aobake.study import Study, measure, needed, study_extent
from aobake.study.bench import Bench, bench_of
from aobake.tracing.sampling import SIZES

ROUNDS = 5
REFERENCE_RAYS = 32_768


def tables(
    chosen: dict[str, aobake.Scene], points: int, seeds: int, reference: int
) -> Iterator[Table]:
    """Slopes, errors, tolerances, and what rounds cost."""
    extent = replace(
        study_extent(quick=True),
        points=points,
        seeds=seeds,
        reference=reference,
        sets=(16, 64, 256, 1024),
        methods=(),
        surface=0,
    )
    studies = {name: measure(s, aobake.BakeSettings(), extent) for name, s in chosen.items()}
    yield slopes(studies)
    yield budgets(studies)
    yield tolerances(studies)
    yield overhead(chosen, points)


def slopes(studies: dict[str, Study]) -> Table:
    """How steeply the error of each set of directions falls."""
    names = [c.name for c in next(iter(studies.values())).curves if c.kind == "directions"]
    found = {name: {c.name: c.slope for c in study.curves} for name, study in studies.items()}
    rows = [[name, *(of[n] for n in names)] for name, of in found.items()]
    return Table("Slopes", ("from 16 to 1,024 rays", *names), rows)


def budgets(studies: dict[str, Study]) -> Table:
    """The error of fixed numbers of rays."""
    rays = [level.setting for level in next(iter(studies.values())).fixed.levels]
    rows = [[name, *(v.rmse for v in study.fixed.levels)] for name, study in studies.items()]
    return Table("RMSE of fixed numbers of rays", ("asset", *rays), rows)


def tolerances(studies: dict[str, Study]) -> Table:
    """Rays towards a tolerance, and a fixed number for the same error."""
    rows = []
    for name, study in studies.items():
        for curve in study.curves:
            for level in curve.levels if curve.kind == "tolerance" else ():
                same = needed(study.fixed, level.rmse)
                fixed = [None, None] if same is None else [same[0], level.rays / same[0]]
                told = [level.rmse, level.reported, f"{level.within_2:.1%}"]
                rows.append([name, level.setting, level.rays, *told, *fixed])
    columns = (
        "asset",
        "asked for",
        "rays",
        "RMSE",
        "reported",
        "within 2",
        "fixed rays for it",
        "ratio",
    )
    return Table("Tolerances", columns, rows)


def overhead(scenes: dict[str, aobake.Scene], points: int) -> Table:
    """Processor time towards a tolerance over that of as many rays from each point in one pass, in turn."""
    rows = []
    for name, scene in scenes.items():
        bench = bench_of(scene, aobake.BakeSettings(threads=1), 8 * points)
        found = []
        for seed in range(ROUNDS):
            towards = replace(bench.settings, tolerance=0.005, seed=seed)
            start = time.process_time()
            traced = bench.estimates(towards).rays
            rounds = time.process_time() - start
            found.append(rounds / in_one_pass(bench, traced, seed))
        rows.append([name, Spread.of(found)])
    return Table("What rounds cost", ("asset", "rounds / one pass"), rows)


def in_one_pass(bench: Bench, rays: NDArray[np.int32], seed: int) -> float:
    """Processor seconds of (P,) rays from the points, each with one set of the next size, for as many rays."""
    sizes = np.array(SIZES)[np.searchsorted(SIZES, rays)] * (rays > 0)
    spent = 0.0
    for size in np.unique(sizes[sizes > 0]).tolist():
        part = replace(bench, points=bench.points.only(np.flatnonzero(sizes == size)))
        start = time.process_time()
        part.estimates(part.fixed(size, seed))
        spent += time.process_time() - start
    return spent * float(rays.sum()) / float(sizes.sum())


def run(quick: bool) -> Iterator[Table]:
    """Six bodies, or one."""
    chosen = {"terrain": bodies()["terrain"]} if quick else bodies()
    yield from tables(chosen, *((150, 2, 4096) if quick else (1500, 3, REFERENCE_RAYS)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*", type=Path, metavar="MESH", help="instead of bodies")
    parser.add_argument("--points", type=int, default=1500)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only")
    asked = parser.parse_args()
    if asked.meshes:
        chosen = {mesh.stem: aobake.load(mesh) for mesh in asked.meshes}
    else:
        chosen = {name: s for name, s in bodies().items() if asked.only in {None, name}}
    for table in tables(chosen, asked.points, asked.seeds, REFERENCE_RAYS):
        print(table.markdown(), flush=True)


if __name__ == "__main__":
    main()

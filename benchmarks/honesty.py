"""Whether reported errors are honest: on closed forms and on real meshes, at fixed rays and towards tolerances.

    python benchmarks/honesty.py [MESH ...] [--points 3000] [--plot honesty.svg]

Prints a Markdown table: the share of points whose true error is within two and four of its standard errors
(93 % and 99 % are asked for), and how wide the bars are (at most 1.5 is asked for). Without meshes: a
generated scan, the demo scene, a coarse scan, a town, terrain, leaves, and what is hardest: twigs above ground.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from bodies import bodies, twigs_above_ground
from numpy.typing import NDArray
from scan import scan
from tables import Table

import aobake
from aobake.study.bench import bench_of

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.known import known_scenes

Points = tuple[NDArray[np.float64], NDArray[np.float64]]

WAYS: tuple[dict[str, object], ...] = (
    {"rays": 16}, {"rays": 64}, {"rays": 256}, {"rays": 1024}, {"rays": 4096},
    {"tolerance": 0.02}, {"tolerance": 0.01}, {"tolerance": 0.005}, {"tolerance": "rms:0.01"},
)  # fmt: skip
REFERENCE_RAYS = 65_536


def closed_forms(way: dict[str, object]) -> Points:
    """(true errors beyond what facets change, standard errors) of every closed form at 256 points each."""
    errors, bars = [], []
    for known in known_scenes():
        if known.openness in {0.0, 1.0}:
            continue
        settings = aobake.BakeSettings(
            max_distance=known.max_distance, falloff=known.falloff, max_rays=1 << 14, **way
        )
        many = np.ones((256, 1))
        found = aobake.visibility(
            aobake.Scene.from_arrays(*known.mesh), many * known.point, many * known.normal, settings
        )
        size = np.abs(found.mean.astype(np.float64) - known.openness)
        errors.append(np.maximum(size - known.facets, 0.0))
        bars.append(found.standard_error.astype(np.float64))
    return np.concatenate(errors), np.concatenate(bars)


Row = tuple[str, dict[str, object], Points]


def rows_of(scenes: dict[str, aobake.Scene], points: int, reference: int) -> list[Row]:
    """(scene, way to bake, errors and bars), closed forms first."""
    rows: list[Row] = [("closed forms", way, closed_forms(way)) for way in WAYS]
    for name, scene in scenes.items():
        bench = bench_of(scene, aobake.BakeSettings(), points)
        truth = bench.reference(reference)
        for way in WAYS:
            found = bench.estimates(replace(bench.settings, max_rays=1 << 14, **way))
            error = np.abs(found.mean.astype(np.float64) - truth)
            rows.append((name, way, (error, found.standard_error.astype(np.float64))))
    return rows


def table_of(rows: list[Row]) -> Table:
    """How many errors are within two and four of their bars, and how wide those are."""
    cells = []
    for name, way, (error, bar) in rows:
        said = ", ".join(f"{key} {value}" for key, value in way.items())
        within = f"{(error <= 2 * bar).mean():.1%}", f"{(error <= 4 * bar).mean():.2%}"
        cells.append([name, said, *within, float(np.sqrt((bar**2).mean() / (error**2).mean()))])
    columns = ("scene", "bake", "within 2", "within 4", "reported / true, rms")
    return Table("Honesty", columns, cells)


def generated() -> dict[str, aobake.Scene]:
    """Two scans, the demo scene, and others with lines of all lengths."""
    found = bodies()
    return {
        "scan, 20,000 faces": found["scan, 20,000 faces"],
        "demo scene": found["demo hall"],
        "scan, 2,000 faces": aobake.Scene.from_arrays(*scan(2000)),
        "town of boxes": found["town of boxes"],
        "terrain": found["terrain"],
        "leaves": found["leaves"],
        "twigs above ground": aobake.Scene.from_arrays(*twigs_above_ground()),
    }


def run(quick: bool) -> Iterator[Table]:
    """The generated scenes."""
    yield table_of(rows_of(generated(), *((200, 4096) if quick else (3000, REFERENCE_RAYS))))


def draw(rows: list[Row], path: Path) -> None:
    """How many points lie within how many of their standard errors, for each scene."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.6))
    axes = figure.add_axes((0.1, 0.12, 0.87, 0.85))
    x = np.linspace(0.0, 4.0, 200)
    for name in dict.fromkeys(name for name, _, _ in rows):
        ratio = np.concatenate([e / np.maximum(b, 1e-12) for n, _, (e, b) in rows if n == name])
        axes.plot(x, [(ratio <= value).mean() for value in x], label=name)
    axes.axhline(0.93, color="#999999", lw=0.8, ls=":")
    axes.set_xlabel("true error, in reported standard errors")
    axes.set_ylabel("share of points")
    axes.legend(frameon=False)
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*")
    parser.add_argument("--points", type=int, default=3000)
    parser.add_argument("--plot", type=Path)
    asked = parser.parse_args()
    scenes = {Path(name).stem: aobake.load(name) for name in asked.meshes} or generated()
    rows = rows_of(scenes, asked.points, REFERENCE_RAYS)
    print(table_of(rows).markdown())
    if asked.plot is not None:
        draw(rows, asked.plot)


if __name__ == "__main__":
    main()

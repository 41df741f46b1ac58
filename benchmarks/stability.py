"""What hard meshes do to a naive baker and to aobake, and what aobake's care costs: docs/stability.md.

    python benchmarks/stability.py [--rays 4096] [--faces 70000] [--repeats 100] [--no-cost] [--no-cases]

The naive baker is what one writes first: float32 world coordinates, area-weighted normals, origins
p + 1e-4 n, and Embree as it comes. Both see the same case; errors are the largest over its points.
The cost is that of the guards alone: the same rays of the same points, from guarded origins in a robust
tree, and from p + 1e-4 n in one that is not, in turn within one run.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator
from unittest import mock

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from hard import Case, ball, cases, turned
from numpy.typing import NDArray
from scan import scan
from tables import Cell, Spread, Table

import aobake
from aobake import bake
from aobake.tracing import embree, estimate
from aobake.tracing.compiled import kernel

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
NAIVE_OFFSET = 1e-4
TIMED = 800  # points a run: short runs in turn see the same machine


def directions(rays: int) -> Float32Array:
    """(N, 3) float32 cosine-distributed directions about +z: a Vogel spiral, lifted from the disc."""
    k = np.arange(rays)
    radius, angle = np.sqrt((k + 0.5) / rays), k * math.pi * (3.0 - math.sqrt(5.0))
    disc = [radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - radius**2)]
    return np.stack(disc, axis=1).astype(np.float32)


def naive_normals(vertices: Float32Array, faces: NDArray[np.int64]) -> Float32Array:
    """Area-weighted, in float32; NaN where they cancel."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    front = np.cross(b - a, c - a)
    sums = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(sums, faces[:, corner], front)
    return np.asarray(sums / np.linalg.norm(sums, axis=1)[:, None])


def naive(
    vertices: FloatArray,
    faces: NDArray[np.int64],
    points: FloatArray,
    normals: Float32Array,
    rays: int,
) -> FloatArray:
    """(P,) ambient occlusion as a naive baker finds it."""
    world, at = vertices.astype(np.float32), points.astype(np.float32)
    scene = EmbreeScene()
    TriangleMesh(scene, world[faces])
    around, open_ = directions(rays), np.empty(len(at))
    for p, (origin, n) in enumerate(zip(at, normals, strict=True)):
        helper = np.array([1, 0, 0] if abs(n[0]) < 0.5 else [0, 1, 0], np.float32)
        t = np.cross(helper, n)
        t = t / np.linalg.norm(t)
        w = around @ np.stack([t, np.cross(n, t), n]).astype(np.float32)
        start = np.tile(origin + np.float32(NAIVE_OFFSET) * n, (rays, 1)).astype(np.float32)
        hits = np.asarray(scene.run(start, np.ascontiguousarray(w)))
        open_[p] = np.nan if np.isnan(n).any() else float((hits < 0).mean())
    return open_


def errors(case: Case, rays: int) -> tuple[float, float, int, int]:
    """Largest error of the naive baker and of aobake, points the former has no value for, points flagged."""
    chosen = None
    if case.normals is not None:
        chosen = np.tile([0.0, 0.0, 1.0], (len(case.vertices), 1))
        chosen[case.points] = case.normals
    scene = aobake.Scene.from_arrays(case.vertices, case.faces, normals=chosen)
    baked = aobake.bake_vertices(scene, aobake.BakeSettings(rays=rays))
    ours = float(np.abs(baked.ao[0][case.points] - case.truth).max())
    with np.errstate(all="ignore"):
        normals = naive_normals(case.vertices.astype(np.float32), case.faces)[case.points]
        if case.normals is not None:
            normals = case.normals.astype(np.float32)
        found = naive(case.vertices, case.faces, case.vertices[case.points], normals, rays)
    lost = int(np.isnan(found).sum())
    worst = float(np.nanmax(np.abs(found - case.truth))) if lost < len(found) else math.nan
    doubts = {"thin", "doubtful", "unresolved"}
    flagged = sum(finding.count for finding in baked.findings if finding.kind in doubts)
    return worst, ours, lost, flagged


def terminator(level: int, rays: int) -> tuple[float, float]:
    """Largest errors at the middles of the faces of a coarse ball that is shaded smoothly; the truth is 1."""
    vertices, faces = ball(level)
    vertices = turned(vertices)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    middles, corners = (a + b + c) / 3.0, (0.9 * a + 0.06 * b + 0.04 * c)
    points = np.concatenate([middles, corners])
    normals = points / np.linalg.norm(points, axis=1)[:, None]
    fronts = np.tile(np.cross(b - a, c - a), (2, 1))
    scene = aobake.Scene.from_arrays(vertices, faces)
    found = aobake.visibility(scene, points, normals, aobake.BakeSettings(rays=rays), fronts)
    plain = naive(vertices, faces, points, normals.astype(np.float32), rays)
    return float(np.abs(plain - 1.0).max()), float(np.abs(found.mean - 1.0).max())


def table_of_cases(rays: int) -> Table:
    """The largest error of both, case by case."""
    rows: list[list[Cell]] = []
    for case in cases():
        worst, ours, lost, flagged = errors(case, rays)
        truth = f"{case.truth.min():.3f}"
        if case.truth.max() > case.truth.min():
            truth += f" to {case.truth.max():.3f}"
        plain = "no value" if math.isnan(worst) else f"{worst:.4f}"
        plain += f", {lost} of {len(case.points)} NaN" if lost else ""
        note = "" if ours <= case.tolerance else " **above**"
        note += f", {flagged} flagged" if flagged else ""
        rows.append([case.name, truth, plain, f"{ours:.4f}{note}", case.tolerance, case.why])
    for level in (0, 1, 2):
        worst, ours = terminator(level, rays)
        name = f"inside faces of a smooth ball of {8 * 4**level}"
        rows.append([name, "1.000", f"{worst:.4f}", f"{ours:.4f}", 0.002, "nothing to estimate"])
    columns = ("case", "truth", "naive", "aobake", "allowed", "what is allowed for")
    return Table("Hard cases", columns, rows, {"rays": rays})


@kernel
def plain_origins(positions, normals, offset, origins):
    """Put each origin at p + offset n."""
    for p in range(len(positions)):
        for i in range(3):
            origins[p, i] = positions[p, i] + offset * normals[p, i]


def unguarded(*arguments: object) -> None:
    """What place_origins is replaced by."""
    positions, normals, origins, states = arguments[3], arguments[4], arguments[6], arguments[7]
    plain_origins(positions, normals, NAIVE_OFFSET, origins)
    assert isinstance(states, np.ndarray)
    states[:] = 0


def table_of_cost(faces: int, repeats: int) -> Table:
    """What the guards cost in tracing, and in preparing and building."""
    scene = aobake.Scene.from_arrays(*scan(faces))
    settings = aobake.BakeSettings(rays=256, threads=1)
    surfaces = bake.surfaces_of(scene, settings)
    guarded = bake.build(scene, surfaces, settings)
    with mock.patch.object(embree, "SCENE_ROBUST", 0):
        bare = bake.build(scene, surfaces, settings)
    points = bake.vertex_points(scene, guarded)
    middle = len(points) // 2
    points = points.only(np.arange(middle, min(middle + TIMED, len(points))))
    request = estimate.Request(
        positions=points.positions, normals=points.normals, geometric=None, numbers=points.numbers
    )

    def traced(prepared: bake.Prepared, *, plain: bool) -> float:
        with mock.patch.object(
            estimate, "place_origins", unguarded if plain else estimate.place_origins
        ):
            start = time.process_time()
            estimate.estimate(prepared.world, request, settings)
            return time.process_time() - start

    ways: dict[str, Callable[[], float]] = {
        "p + 1e-4 n, tree not robust": lambda: traced(bare, plain=True),
        "p + 1e-4 n, robust tree": lambda: traced(guarded, plain=True),
        "guarded origins, robust tree": lambda: traced(guarded, plain=False),
    }
    for way in ways.values():
        way()
    runs = [{name: way() for name, way in ways.items()} for _ in range(repeats)]
    first = next(iter(ways))
    least = min(row[first] for row in runs)
    rows: list[list[Cell]] = []
    for name in ways:
        seconds = [run[name] for run in runs]
        within = Spread.of(run[name] / run[first] for run in runs)
        rows.append([name, Spread.of(seconds), within, min(seconds) / least])
    columns = (
        "what",
        "processor seconds",
        "against the first: within each run",
        "least against least",
    )
    facts = {"triangles": len(surfaces[0].faces), "points": len(points), "rays": 256, "threads": 1}
    return Table("What the guards cost", columns, rows, facts)


def run(quick: bool) -> Iterator[Table]:
    """The cases, and the cost."""
    yield table_of_cases(256 if quick else 4096)
    yield table_of_cost(*((4_000, 5) if quick else (70_000, 100)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--rays", type=int, default=4096)
    parser.add_argument("--faces", type=int, default=70_000)
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--no-cost", action="store_true")
    parser.add_argument("--no-cases", action="store_true")
    asked = parser.parse_args()
    if not asked.no_cases:
        print(table_of_cases(asked.rays).markdown(), flush=True)
    if not asked.no_cost:
        print(table_of_cost(asked.faces, asked.repeats).markdown())


if __name__ == "__main__":
    main()

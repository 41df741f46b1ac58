"""What each effect costs when it is on, what it costs when it is off, and what planning saves.

    python benchmarks/effects.py [--faces 40000] [--rays 256] [--repeats 5] [ASSET ...]

Costs are ratios of processor seconds of tracing, taken in turn within one run, since machines are shared;
medians are quoted. An effect that is off is measured against a kernel that was written without any of them.
Estimates of `aobake plan` are compared with the seconds that a bake then takes, for the demo scene and for
the assets that are named.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from cutouts import FloatArray, cards_mesh, scene_of
from scan import scan

import aobake
from aobake import BakeSettings
from aobake.demo import hall
from aobake.demo.shapes import ball
from aobake.meshes.scene import Instance, Scene
from aobake.meshes.surfaces import surfaces_of
from aobake.open_sky import sky_over
from aobake.planning.cost import estimated
from aobake.points import vertex_points
from aobake.prepare import build
from aobake.sharing import first_alike
from aobake.tracing import embree, kernels
from aobake.tracing.compiled import tight_kernel
from aobake.tracing.sampling import direction_sets

FAR = 1e3  # beyond all that is in a scene
POINTS = 2000  # of the comparison of kernels, which takes one thread


@tight_kernel
def trace_plainly(function, scene, points, seed, sets, rays, scratch, out):
    """kernels.trace as it was before it could do anything but occlusion."""
    packet, words, masks, frame = scratch
    origins, normals, numbers = points
    valid, counts = masks[:8], masks[8:16]
    kernels.ready(packet, words)
    for point in range(len(origins)):
        bits = kernels.mix(seed, numbers[point])
        kernels.turned_frame(normals[point], bits, frame)
        kernels.set_out(packet, origins[point])
        chosen = sets[np.int64(bits & np.uint64(len(sets) - 1))]
        total, rough, counted = 0.0, 0.0, 0
        before = -1.0
        for number in range(len(chosen)):
            kernels.aim(packet, chosen[number], frame, np.float32(np.inf))
            for k in range(8):
                counts[k] = -1 if k < rays - 8 * number else 0
                valid[k] = counts[k]
            kernels.call_packet(function, masks.ctypes.data, scene, packet.ctypes.data)
            for k in range(8):
                if counts[k] != 0:
                    value = 1.0 if packet[8 * kernels.FAR + k] >= 0.0 else 0.0
                    total += value
                    counted += 1
                    if before >= 0.0:
                        rough += (value - before) * (value - before)
                    before = value
        out[point, 0], out[point, 1], out[point, 2] = total, rough, counted


def cost_of_nothing(scene: Scene, rays: int, repeats: int) -> list[float]:
    """Seconds of kernels.trace with everything off over those of trace_plainly, run by run."""
    settings = BakeSettings()
    prepared = build(scene, surfaces_of(scene, settings), settings)
    points = vertex_points(scene, prepared).only(np.arange(min(POINTS, scene.vertices)))
    above = points.positions + 1e-5 * points.normals
    origins = prepared.world.frame.apply(above).astype(np.float32)
    normals, numbers = points.normals.astype(np.float32), points.numbers
    functions, tree = embree.functions(), prepared.world.tree.address
    sets, seed = direction_sets(rays), np.uint64(0)
    memory, sums = kernels.scratch(), np.empty((len(origins), 3))

    def whole() -> None:
        kernels.trace(
            (functions.occluded8, functions.intersect8), tree, origins, normals, None, numbers,
            seed, sets, rays, np.float32(np.inf), None, None, memory, sums, None,
        )  # fmt: skip

    def plain() -> None:
        points = origins, normals, numbers
        trace_plainly(functions.occluded8, tree, points, seed, sets, rays, memory, sums)

    return in_turn(whole, plain, repeats)


def in_turn(one: Callable[[], object], other: Callable[[], object], repeats: int) -> list[float]:
    """Processor seconds of one over those of the other, run by run; each is run once before."""
    one(), other()
    return [spent(one) / spent(other) for _ in range(repeats)]


def spent(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def placed(shift: FloatArray) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, 3] = shift
    return matrix


def copies(scene: Scene, count: int, apart: float) -> Scene:
    """One mesh in several places."""
    shifts = apart * np.array([(k % 3, k // 3, 0.0) for k in range(count)])
    return replace(
        scene, instances=tuple(Instance(mesh=0, transform=placed(shift)) for shift in shifts)
    )


def apart(scene: Scene) -> Scene:
    """The same with a mesh of its own for each place."""
    meshes = tuple(
        replace(mesh, vertices=mesh.vertices + instance.transform[:3, 3])
        for instance, mesh in scene.placed()
    )
    return Scene.from_meshes(meshes)


def costs_when_on(scene: Scene, rays: int, repeats: int) -> Mapping[str, list[float]]:
    """Effect -> seconds with it over seconds without."""
    off = ("open_sky=off",)
    plain = BakeSettings(rays=rays, effect=off)
    limited = replace(plain, max_distance=0.2)
    pairs: dict[str, tuple[BakeSettings, BakeSettings]] = {
        "max_distance (a tenth of the size)": (limited, plain),
        "falloff (linear, against the same limit)": (replace(limited, falloff="linear"), limited),
        "backfaces (ignore)": (replace(plain, backfaces="ignore"), plain),
        "ground": (replace(plain, ground="+z"), plain),
        "distribution (uniform)": (replace(plain, distribution="uniform"), plain),
        "spread (100 degrees)": (replace(plain, spread=100.0), plain),
        "bent_normals": (replace(plain, bent_normals=True), plain),
        "occluders (own)": (replace(plain, occluders=("own",)), plain),
    }
    found = {
        name: in_turn(
            lambda s=on: aobake.bake_vertices(scene, s),
            lambda s=without: aobake.bake_vertices(scene, s),
            repeats,
        )
        for name, (on, without) in pairs.items()
    }
    several = copies(scene, 4, 2.5)
    once_each = apart(several)
    found["instances (4 of one mesh)"] = in_turn(
        lambda: aobake.bake_vertices(several, plain),
        lambda: aobake.bake_vertices(once_each, plain),
        repeats,
    )
    return found


def costs_of_looking(scene: Scene, rays: int, repeats: int) -> Mapping[str, list[float]]:
    """What it takes to see that nothing is to be saved, over the seconds of the bake."""
    settings = BakeSettings(rays=rays)
    prepared = build(scene, surfaces_of(scene, settings), settings)
    points = vertex_points(scene, prepared)
    limited = replace(settings, max_distance=0.2)

    def bake() -> object:
        return aobake.bake_vertices(scene, settings)

    return {
        "open_sky": in_turn(
            lambda: sky_over(prepared, points, len(points), None, settings), bake, repeats
        ),
        "sharing": in_turn(lambda: first_alike(scene, limited, None), bake, repeats),
    }


def convex_body() -> Scene:
    """A ball."""
    shape = ball(1.0, 128)
    return Scene.from_arrays(shape.vertices, shape.faces, name="ball")


EVERYTHING = {"effect": ("backfaces=on", "bent_normals=on", "open_sky=on"), "falloff": "smooth"}


def saved(scene: Scene, rays: int, repeats: int, **also: object) -> tuple[float, float]:
    """(seconds as planned, seconds with everything on that can be), medians."""
    planned = BakeSettings(rays=rays, **also)  # type: ignore[arg-type]
    forced = BakeSettings(rays=rays, max_distance=FAR, **EVERYTHING, **also)  # type: ignore[arg-type]
    rows = []
    for settings in (planned, forced):
        aobake.bake_vertices(scene, settings)
        rows.append(
            [spent(lambda s=settings: aobake.bake_vertices(scene, s)) for _ in range(repeats)]
        )
    return statistics.median(rows[0]), statistics.median(rows[1])


def estimates(assets: list[Path], rays: int) -> list[tuple[str, float, float]]:
    """(name, seconds that were estimated, seconds that were taken)."""
    found = []
    scenes = [("demo", hall()), *((path.name, aobake.load(path)) for path in assets)]
    for name, scene in scenes:
        settings = BakeSettings(rays=rays)
        cost = estimated(aobake.plan(scene, settings), scene, settings)
        taken = aobake.bake_vertices(scene, settings).seconds
        found.append((name, cost.seconds, sum(taken.values()) - taken["compile"]))
    return found


def shown(values: list[float]) -> str:
    return f"{statistics.median(values):.3f} ({min(values):.3f} to {max(values):.3f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--faces", type=int, default=40_000)
    parser.add_argument("--rays", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("assets", nargs="*", type=Path)
    asked = parser.parse_args()
    scene = Scene.from_arrays(*scan(asked.faces), name="scan")
    print(
        f"{scene.triangles} faces, {asked.rays} rays, median of {asked.repeats} (least to most)\n"
    )
    print("| effect | when on, against without |\n| --- | --- |")
    for name, values in costs_when_on(scene, asked.rays, asked.repeats).items():
        print(f"| {name} | {shown(values)} |")
        sys.stdout.flush()
    print("\n| what is off | cost |\n| --- | --- |")
    nothing = cost_of_nothing(scene, asked.rays, 10 * asked.repeats)  # short, and so noisy
    print(f"| all of the kernel's, against a kernel without them | {shown(nothing)} |")
    for name, values in costs_of_looking(scene, asked.rays, asked.repeats).items():
        print(f"| {name}: looking for it in vain, as a share of the bake | {shown(values)} |")
    print("\n| scene | as planned, s | all on, s | saved |\n| --- | --- | --- | --- |")
    scenes = {
        "demo": hall(),
        "convex body": convex_body(),
        "foliage": scene_of(cards_mesh(500, 0), "MASK"),
    }
    for name, of in scenes.items():
        planned, forced = saved(of, asked.rays, max(1, asked.repeats // 2))
        print(f"| {name} | {planned:.2f} | {forced:.2f} | {1.0 - planned / forced:.0%} |")
    print("\n| asset | estimated, s | taken, s | ratio |\n| --- | --- | --- | --- |")
    for name, guess, taken in estimates(asked.assets, asked.rays):
        print(f"| {name} | {guess:.2f} | {taken:.2f} | {guess / taken:.2f} |")


if __name__ == "__main__":
    main()

"""What each effect costs when it is on, what it costs when it is off, and what planning saves.

    python benchmarks/effects.py [--faces 40000] [--rays 256] [--repeats 5] [ASSET ...]

Costs are ratios of processor seconds of tracing, taken in turn within one run, since machines are shared;
medians are quoted. An effect that is off is measured against a kernel that was written without any of them.
Estimates of `aobake plan` are compared with what a bake then takes, for the demo scene, five generated bodies and
the assets that are named: by processor seconds of one thread, so that what else a machine does is not in them.
"""

from __future__ import annotations

import argparse
import contextlib
import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from bodies import bodies
from cutouts import FloatArray, cards_mesh, scene_of
from scan import scan
from tables import Cell, Spread, Table

import aobake
from aobake import BakeSettings
from aobake.demo import hall
from aobake.demo.shapes import ball
from aobake.meshes.scene import Instance, Scene
from aobake.meshes.surfaces import surfaces_of
from aobake.open_sky import sky_over
from aobake.plan import texture_plan
from aobake.planning.cost import estimated
from aobake.points import vertex_points
from aobake.prepare import build
from aobake.sharing import first_alike
from aobake.tracing import embree, kernels
from aobake.tracing.compiled import kernel
from aobake.tracing.foreign import call_packet
from aobake.tracing.lanes import ALL, below, count, eight, put_mask, spread
from aobake.tracing.sampling import direction_sets
from aobake.tracing.sized_sets import SizedSets

FAR = 1e3  # beyond all that is in a scene
POINTS = 2000  # of the comparison of kernels, which takes one thread


@kernel
def trace_plainly(functions, scene, points, seed, sets, scratch, out):
    """kernels.trace, its error included, if it could do nothing but occlusion by whole packets."""
    packet, words, valid, _, frame = scratch
    any_hit, _, _, asked = functions
    origins, normals, numbers = points
    kernels.ready(packet, words, 8, 0)
    put_mask(valid, 0, ALL)
    for point in range(len(origins)):
        bits = kernels.mix(seed, numbers[point])
        kernels.turned_frame(normals[point], bits, frame)
        kernels.set_out(packet, origins[point], 8, 0)
        chosen = sets[np.int64(bits & np.uint64(len(sets) - 1))]
        total, rough, apart, before = 0, 0, 0, -1
        for number in range(len(chosen)):
            kernels.aim(packet, chosen[number], frame, np.float32(np.inf), 8, 0)
            call_packet(any_hit, valid.ctypes.data, scene, packet.ctypes.data, asked)
            met = below(eight(packet, 8 * kernels.FAR), spread(np.float32(0.0)))
            inside = 8 - count(met)
            total += inside
            apart += inside * (8 - inside)
            rough += count((met ^ (met << 1)) & (ALL - 1))
            if before >= 0:
                rough += (met & 1) ^ before
            before = met >> 7
        out[point, 0], out[point, 1], out[point, 2] = total, rough, 8 * len(chosen)
        out[point, 3], out[point, 4] = apart, len(chosen)


def cost_of_nothing(scene: Scene, rays: int, repeats: int) -> list[float]:
    """Seconds of kernels.trace with everything off over those of trace_plainly, run by run."""
    settings = BakeSettings()
    prepared = build(scene, surfaces_of(scene, settings), settings)
    points = vertex_points(scene, prepared).only(np.arange(min(POINTS, scene.vertices)))
    above = points.positions + 1e-5 * points.normals
    origins = prepared.world.frame.apply(above).astype(np.float32)
    normals, numbers = points.normals.astype(np.float32), points.numbers
    functions, tree = embree.packets(lanes=8), prepared.world.tree.address
    sets, seed = direction_sets(rays), np.uint64(0)
    sized, sizes = SizedSets.of({rays: sets}), np.zeros(len(origins), np.int64)
    memory, sums = kernels.scratch(), np.empty((len(origins), kernels.SUMS))

    def whole() -> None:
        kernels.trace(
            functions, tree, origins, normals, None, numbers,
            seed, sized, sizes, np.float32(np.inf), None, None, memory, sums, None, None,
        )  # fmt: skip

    def plain() -> None:
        points = origins, normals, numbers
        trace_plainly(functions, tree, points, seed, sets, memory, sums)

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
        "mean_distance": (replace(plain, mean_distance=True), plain),
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


def estimates(scenes: Mapping[str, Scene], rays: int, repeats: int) -> Iterator[list[Cell]]:
    """Name, and for each kind of bake what was estimated over what was taken: medians, and of which rays."""
    plain = BakeSettings(rays=rays, threads=1, size=512)
    for name, scene in scenes.items():
        row: list[Cell] = [name]
        for settings in (plain, replace(plain, tolerance=0.01)):
            row += _told(scene, settings, False, repeats)
        yield row + _told(scene, replace(plain, rays=max(1, rays // 4)), True, repeats)


def _told(scene: Scene, settings: BakeSettings, texture: bool, repeats: int) -> list[Cell]:
    """Estimated over taken: processor seconds, and rays."""
    bake = aobake.bake_texture if texture else aobake.bake_vertices
    decided = (texture_plan if texture else aobake.plan)(scene, settings)
    seconds, rays = [], []
    with counting_processor_time():
        bake(scene, replace(settings, rays=1, tolerance=None, size=256))  # loads and compiles
        for _ in range(repeats):
            cost = estimated(decided, scene, settings, texture=texture)
            baked = bake(scene, settings)
            taken = sum(baked.seconds.values()) - baked.seconds["compile"]
            seconds.append(cost.seconds / taken)
            rays.append(cost.rays / max(1, baked.rays))
    return [statistics.median(seconds), statistics.median(rays)]


@contextlib.contextmanager
def counting_processor_time() -> Iterator[None]:
    """Let the clock of stages and probes tell processor time, of all threads."""
    clock = time.perf_counter
    time.perf_counter = time.process_time
    try:
        yield
    finally:
        time.perf_counter = clock


def tables(faces: int, rays: int, repeats: int, assets: list[Path]) -> Iterator[Table]:
    """What is on, what is off, what planning saves, and what it estimates."""
    scene = Scene.from_arrays(*scan(faces), name="scan")
    facts = {"triangles": scene.triangles, "rays": rays}
    on = costs_when_on(scene, rays, repeats)
    rows = [[name, Spread.of(values)] for name, values in on.items()]
    yield Table("What is on", ("effect", "when on, against without"), rows, facts)
    nothing = cost_of_nothing(scene, rays, 20 * repeats)  # short, and so noisy
    rows = [["all of the kernel's, against a kernel without them", Spread.of(nothing)]]
    for name, values in costs_of_looking(scene, rays, repeats).items():
        share = f"{name}: looking for it in vain, as a share of the bake"
        rows.append([share, Spread.of(values)])
    yield Table("What is off", ("what", "cost"), rows, facts)
    scenes = {
        "demo": hall(),
        "convex body": convex_body(),
        "foliage": scene_of(cards_mesh(500, 0), "MASK"),
    }
    rows = []
    for name, of in scenes.items():
        planned, forced = saved(of, rays, max(1, repeats // 2))
        rows.append([name, planned, forced, f"{1.0 - planned / forced:.0%}"])
    yield Table(
        "What planning saves", ("scene", "as planned, s", "all on, s", "saved"), rows, facts
    )
    named = {path.name: aobake.load(path) for path in assets}
    columns = ["asset"]
    for kind in ("fixed", "tolerance 0.01", "texture"):
        columns += [f"{kind}: seconds", "rays"]
    rows = list(estimates({**bodies(), **named}, rays, max(1, repeats // 2)))
    facts = {"rays": rays, "size": 512, "threads": 1}
    yield Table("Estimated over taken", tuple(columns), rows, facts)


def run(quick: bool) -> Iterator[Table]:
    """A scan, and the demo scene."""
    yield from tables(*((4_000, 32, 1) if quick else (40_000, 256, 5)), assets=[])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--faces", type=int, default=40_000)
    parser.add_argument("--rays", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("assets", nargs="*", type=Path)
    asked = parser.parse_args()
    for table in tables(asked.faces, asked.rays, asked.repeats, asked.assets):
        print(table.markdown(), flush=True)


if __name__ == "__main__":
    main()

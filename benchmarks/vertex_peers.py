"""Ambient occlusion at vertices beside other bakers: seconds, rays a second, error, and time to an error.

    python benchmarks vertex_peers [--quick]
    python benchmarks/vertex_peers.py MESH [--repeats 3]

All bakers get the same mesh with the same normals and as many threads, and bake in a process that is warm:
what is timed is the bake alone, its tree included. Errors are against one reference, many rays of ours,
which is checked here with independent random rays through EmbreeScene.run. Two aim at something else, and
are held to their own limit: MeshLab gives a vertex the mean of its faces' middles, libigl weighs
directions alike. The native program is one that sends a fixed number of Hammersley directions (the better
of two maps) through rtcOccluded8 and takes no time for anything else: its rate is that of bare packets.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bare import Bare
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from rivals import (
    Answer,
    FloatArray,
    Level,
    Peer,
    ask,
    in_short,
    levels_table,
    rms,
    time_table,
    time_to,
)
from scan import scan
from tables import Cell, Skipped, Spread, Table

import aobake
from aobake.demo import hall
from aobake.meshes.normals import unit_rows
from aobake.meshes.surfaces import surfaces_of
from aobake.prepare import turned_normals
from aobake.study.bench import bench_of
from aobake.study.directions import compared_sets
from aobake.tracing.estimate import processors

FIXED, TOLERANCE, NATIVE = "aobake, fixed rays", "aobake, tolerance", "native Hammersley packets"
RAYS, QUICK_RAYS = (16, 32, 64, 128, 256, 512, 1024), (32, 64, 128, 256)
GOALS = (0.03, 0.02, 0.01, 0.007, 0.005, 0.003)
ERRORS = (0.02, 0.01, 0.005)
IN_SHORT = 0.01
PEERS = (
    Peer("Blender Cycles", "blender", (16, 64, 256), (4, 16, 64)),
    Peer("pymeshlab", "meshlab", (32, 64, 128, 256, 512), (32, 64), 8192, lambda x, n: 4.0 * x / n),
    Peer("trimesh script", "plain", (64, 256, 1024), (16, 64)),
    Peer("Blender Cycles, its defaults", "blender", (4096,), (), asked={"adaptive": True}),
    Peer("libigl", "libigl", (64, 256, 1024), (16, 64), 8192),
)


@dataclass(frozen=True)
class Body:
    """One mesh as everyone gets it, and its reference."""

    name: str
    scene: aobake.Scene
    arrays: dict[str, FloatArray]
    reference: FloatArray


def body(name: str, scene: aobake.Scene, reference_rays: int) -> Body:
    """All instances as one mesh in the scene's space."""
    vertices, faces, normals, first = [], [], [], 0
    for (instance, mesh), surface in zip(scene.placed(), placed_surfaces(scene), strict=True):
        matrix = instance.transform
        vertices.append(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3])
        normals.append(unit_rows(turned_normals(surface.normals, matrix[:3, :3])))
        faces.append(surface.faces + first)
        first += len(mesh.vertices)
    arrays = {
        "vertices": np.concatenate(vertices),
        "faces": np.concatenate(faces).astype(np.int32),
        "normals": np.concatenate(normals),
    }
    merged = aobake.Scene.from_arrays(**arrays, name=name)
    settings = aobake.BakeSettings(rays=reference_rays, seed=0x5EED)
    truth = aobake.bake_vertices(merged, settings).ao[0].astype(np.float64)
    return Body(name, merged, arrays, truth)


def placed_surfaces(scene: aobake.Scene) -> list:
    """The prepared surface of each instance."""
    surfaces = surfaces_of(scene, aobake.BakeSettings())
    return [surfaces[instance.mesh] for instance in scene.instances]


def brute_force(of: Body, points: int, rays: int) -> Table:
    """The reference beside independent random rays: their difference, and what chance alone would make of it."""
    rng = np.random.default_rng(5)
    v, f, n = (of.arrays[k] for k in ("vertices", "faces", "normals"))
    scene = EmbreeScene()
    TriangleMesh(scene, v.astype(np.float32)[f])
    chosen = rng.permutation(np.unique(f))[:points]
    size = np.linalg.norm(np.ptp(v, axis=0))
    found = np.empty(len(chosen))
    for k, p in enumerate(chosen):
        w = rng.standard_normal((rays, 3))
        w = n[p] + w / np.linalg.norm(w, axis=1)[:, None]  # cosine-distributed once at unit length
        w = (w / np.linalg.norm(w, axis=1)[:, None]).astype(np.float32)
        start = np.tile(v[p] + 2e-6 * size * n[p], (rays, 1)).astype(np.float32)
        found[k] = 1.0 - (scene.run(start, w, query="OCCLUDED") >= 0).mean()
    off = found - of.reference[chosen]
    chance = np.sqrt(np.mean(found * (1.0 - found) / rays))
    row = [
        len(chosen),
        rays,
        float(off.mean()),
        rms(off),
        float(np.median(np.abs(off))),
        float(chance),
    ]
    columns = ("vertices", "random rays", "mean difference", "RMS", "median", "RMS by chance alone")
    return Table(f"{of.name}: the reference by brute force", columns, [row])


def of_peer(peer: Peer, of: Body, answers: Sequence[Answer], used: FloatArray) -> list[Level]:
    """Its levels, from several runs; the last of its samples is its own limit where it has one."""
    told = answers[0]
    limit = None if peer.own is None else told.values[-1]
    return [
        Level(
            baker=peer.name,
            setting=f"{samples} samples",
            seconds=Spread.of(answer.seconds[k] for answer in answers),
            rays=samples * len(of.reference),
            rmse=rms((told.values[k] - of.reference)[used]),
            own=None if limit is None else rms((told.values[k] - limit)[used]),
        )
        for k, samples in enumerate(told.samples[: None if limit is None else -1])
    ]


def ours(of: Body, settings: aobake.BakeSettings) -> tuple[float, int, FloatArray]:
    """(seconds of the whole bake, rays, values)."""
    start = time.perf_counter()
    baked = aobake.bake_vertices(of.scene, settings)
    return time.perf_counter() - start, baked.rays, baked.ao[0].astype(np.float64)


def our_levels(of: Body, runs: dict[str, list], used: FloatArray) -> list[Level]:
    """Levels of our own, from {setting: (baker, several runs)}."""
    return [
        Level(
            baker=baker,
            setting=setting,
            seconds=Spread.of(seconds for seconds, _, _ in found),
            rays=found[0][1],
            rmse=rms((found[0][2] - of.reference)[used]),
        )
        for setting, (baker, found) in runs.items()
    ]


def native_levels(of: Body, rate: Spread, rays: Sequence[int]) -> list[Level]:
    """What fixed Hammersley sets would take at the rate of bare packets."""
    bench = bench_of(of.scene, aobake.BakeSettings(), 1 << 30)
    truth = of.reference[bench.points.numbers]
    levels = []
    for count in rays:
        found = [
            rms(bench.run_sets(compared_sets(kind, count), count, 1)[0] - truth)
            for kind in ("Hammersley", "Hammersley, polar")
        ]
        total = count * len(truth)
        seconds = Spread(total / rate.median, total / rate.most, total / rate.least, rate.runs)
        levels.append(Level(NATIVE, f"{count} rays", seconds, total, min(found)))
    return levels


def tables_of(of: Body, quick: bool, repeats: int) -> Iterator[Table]:
    """All bakers on one mesh, in turn."""
    yield brute_force(of, 100 if quick else 400, 1 << 14)
    rays = QUICK_RAYS if quick else RAYS
    asked = {f"{n} rays": (FIXED, aobake.BakeSettings(rays=n)) for n in rays}
    asked |= {f"rms:{e:g}": (TOLERANCE, aobake.BakeSettings(tolerance=f"rms:{e}")) for e in GOALS}
    mine: dict[str, list] = {setting: (baker, []) for setting, (baker, _) in asked.items()}
    bare, rates = Bare(of.scene, 256, most_rays=1 << 23), []
    answers: dict[str, list[Answer]] = {peer.name: [] for peer in PEERS}
    absent: dict[str, str] = {}
    for number in range(repeats):
        for peer in PEERS:
            if number and len(peer.samples) == 1:  # minutes, and no part of a comparison
                continue
            own = () if peer.own is None else (min(peer.own, 1024) if quick else peer.own,)
            samples = (*(peer.quick if quick else peer.samples), *own)
            if not samples:
                continue
            try:
                answers[peer.name].append(
                    ask(peer, of.arrays, samples, kind="vertex", threads=processors())
                )
            except Skipped as reason:
                absent[peer.name] = str(reason)
        for setting, (_, settings) in asked.items():
            rates.append(bare.rate())
            mine[setting][1].append(ours(of, settings))
    used = np.isin(np.arange(len(of.reference)), np.unique(of.arrays["faces"]))
    levels = our_levels(of, mine, used) + native_levels(of, Spread.of(rates), rays)
    for peer in PEERS:
        if answers[peer.name]:
            levels += of_peer(peer, of, answers[peer.name], used)
    facts = {
        "triangles": of.scene.triangles,
        "vertices": len(of.reference),
        "threads": processors(),
    }
    yield levels_table(f"{of.name}: every setting", levels, facts)
    yield time_table(
        f"{of.name}: time to an error", levels, ERRORS, FIXED, "; ".join(absent.values())
    )
    command = seconds_of_command(of, repeats)
    further = [("the whole command `aobake vertex`, start-up included", command.median)]
    yield in_short(f"{of.name}: in short", levels, IN_SHORT, (FIXED, TOLERANCE), further)
    yield whole_command(of, levels, command)
    yield settings_table([found[0] for found in answers.values() if found])


def seconds_of_command(of: Body, repeats: int) -> Spread:
    """`aobake vertex` from start to end."""
    with tempfile.TemporaryDirectory() as folder:
        given, target = Path(folder, "mesh.ply"), Path(folder, "ao.ply")
        aobake.save(aobake.bake_vertices(of.scene, aobake.BakeSettings(rays=1)), given)
        command = [sys.executable, "-m", "aobake", "vertex", str(given), "-o", str(target)]
        command += ["--quiet", "--force", "--tolerance", f"rms:{IN_SHORT}"]
        taken = []
        for _ in range(repeats):
            start = time.perf_counter()
            subprocess.run(command, check=True)
            taken.append(time.perf_counter() - start)
    return Spread.of(taken)


def whole_command(of: Body, levels: Sequence[Level], command: Spread) -> Table:
    """The whole command beside Cycles' bake alone."""
    cycles = time_to([level for level in levels if level.baker == PEERS[0].name], IN_SHORT)
    ratio = None if cycles is None else cycles[0] / command.median
    row: list[Cell] = [command, None if cycles is None else cycles[0], ratio]
    columns = ("whole `aobake vertex --tolerance rms:0.01`, s", "Cycles' bake to 0.01, s", "ratio")
    return Table(f"{of.name}: the whole command", columns, [row])


def settings_table(answers: Sequence[Answer]) -> Table:
    """Everything that was set in the peers."""
    rows = [[told.version, what, said] for told in answers for what, said in told.settings.items()]
    return Table("Settings of the peers", ("peer", "what", "setting"), rows)


def run(quick: bool) -> Iterator[Table]:
    """A scan of the Stanford bunny's size, and the demo hall."""
    faces, rays = (4_000, 2048) if quick else (70_000, 1 << 14)
    yield from tables_of(
        body("scan", aobake.Scene.from_arrays(*scan(faces)), rays), quick, 1 if quick else 3
    )
    if not quick:
        yield from tables_of(body("demo hall", hall(), rays), quick, 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--repeats", type=int, default=3)
    asked = parser.parse_args()
    of = body(asked.mesh.stem, aobake.load(asked.mesh), 1 << 14)
    for table in tables_of(of, quick=False, repeats=asked.repeats):
        print(table.markdown(), flush=True)


if __name__ == "__main__":
    main()

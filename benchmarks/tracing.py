"""How close a whole bake comes to Embree itself: by mesh size, by rays, by threads; and the whole command.

    python benchmarks tracing [--quick]
    python benchmarks/tracing.py [--faces 70000] [--rays 256] [--repeats 5]     one mesh, more closely

The bare rate is that of rtcOccluded8 on ready-made packets (bare.py). EmbreeScene.run is what trimesh
calls, on ready-made rays as well, one thread and as many as the bake has. Rates are compared within one
run, in turn, since machines are shared. A bake that knows from a plane that nothing lies above a point
sends no ray there: open_sky is off here.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from bare import Bare
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from scan import scan
from tables import Spread, Table, ratios

import aobake
from aobake.tracing.estimate import processors

MOST_BARE = 1 << 25  # rays; three seconds
# faces -> (rays, repeats)
SIZES = {
    1_000: (256, 15), 4_000: (256, 15), 16_000: (256, 9), 70_000: (256, 7), 280_000: (256, 5),
    1_000_000: (256, 3), 4_000_000: (64, 3),
}  # fmt: skip
QUICK_SIZES = {1_000: (256, 5), 16_000: (256, 3), 70_000: (64, 3)}
RAYS = {16: 9, 64: 9, 256: 7, 1024: 5, 4096: 1}
QUICK_RAYS = {64: 5, 256: 3}


class Rival:
    """EmbreeScene.run on the rays of some vertices of a mesh, which are ready before the clock starts."""

    def __init__(self, bare: Bare, faces: int, rays: int, threads: int) -> None:
        vertices, triangles = scan(faces)
        self.scene = EmbreeScene()
        TriangleMesh(self.scene, vertices.astype(np.float32)[triangles])
        self.threads, count = threads, min(len(bare.origins), max(1, (1 << 19) // rays))
        first = (len(bare.origins) - count) // 2
        part = slice(first, first + count)
        frame = bare.prepared.world.frame
        at = (bare.origins[part].astype(np.float64) / frame.scale + frame.center).astype(np.float32)
        self.origins = np.repeat(at, rays, axis=0)
        self.directions = _directions(bare.normals[part], rays)
        self.rays = len(self.origins)

    def rate(self) -> float:
        """Rays a second."""
        parts = np.array_split(np.arange(self.rays), self.threads)
        given = [(self.origins[p], self.directions[p]) for p in parts]
        start = time.perf_counter()
        with ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(lambda p: self.scene.run(p[0], p[1], query="OCCLUDED"), given))
        return self.rays / (time.perf_counter() - start)


def _directions(normals: np.ndarray, rays: int) -> np.ndarray:
    """(P * rays, 3) float32: one spiral over the hemisphere, in the frame of each normal."""
    k = np.arange(rays)
    radius, angle = np.sqrt((k + 0.5) / rays), 2.399963229728653 * k
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)], 1)
    helper = np.where(np.abs(normals[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    t = np.cross(helper, normals)
    t /= np.linalg.norm(t, axis=1)[:, None]
    frames = np.stack([t, np.cross(normals, t), normals], axis=1)
    return np.einsum("rk,pkc->prc", local, frames).reshape(-1, 3).astype(np.float32)


def settings_of(rays: int, threads: int | None = None) -> aobake.BakeSettings:
    """Every vertex gets its rays."""
    return aobake.BakeSettings(rays=rays, threads=threads, effect=("open_sky=off",))


def turns(
    scene: aobake.Scene,
    bare: Bare,
    rays: int,
    repeats: int,
    threads: int | None = None,
    rivals: Sequence[Rival] = (),
) -> list[tuple[float, ...]]:
    """(bare, tracing stage, whole bake, each rival) in rays a second, in turn; a first bake is not counted."""
    settings = settings_of(rays, threads)
    if bare.rays < MOST_BARE:
        aobake.bake_vertices(scene, settings)
    found = []
    for _ in range(repeats):
        before = bare.rate()
        start = time.perf_counter()
        baked = aobake.bake_vertices(scene, settings)
        whole = baked.rays / (time.perf_counter() - start)
        around = 0.5 * (before + bare.rate())
        stage = baked.rays / baked.seconds["trace"]
        found.append((around, stage, whole, *(rival.rate() for rival in rivals)))
    return found


def row(found: list[tuple[float, ...]]) -> list[Spread]:
    """Bare Mrays/s; the tracing stage, the whole bake and the rivals beside it."""
    bare, *others = zip(*found, strict=True)
    return [Spread.of(rate / 1e6 for rate in bare), *(ratios(other, bare) for other in others)]


BESIDE = ("bare, Mrays/s", "tracing stage / bare", "whole bake / bare")


def by_size(sizes: dict[int, tuple[int, int]]) -> Table:
    """The scan from a thousand triangles on; 16 million of them: growth.py --largest."""
    rows = []
    for faces, (rays, repeats) in sizes.items():
        scene = aobake.Scene.from_arrays(*scan(faces))
        bare = Bare(scene, rays, most_rays=MOST_BARE)
        rivals = [Rival(bare, faces, rays, threads) for threads in (1, processors())]
        found = turns(scene, bare, rays, repeats, rivals=rivals)
        rows.append([scene.triangles, rays, *row(found)])
    columns = ("triangles", "rays", *BESIDE, "EmbreeScene.run / bare, 1 thread", "all threads")
    return Table("By mesh size", columns, rows, {"threads": processors()})


def by_rays(faces: int, repeats: dict[int, int]) -> Table:
    """One scan, more and more rays."""
    scene = aobake.Scene.from_arrays(*scan(faces))
    rows = [
        [rays, *row(turns(scene, Bare(scene, rays, most_rays=MOST_BARE), rays, times))]
        for rays, times in repeats.items()
    ]
    return Table("By rays", ("rays", *BESIDE), rows, {"triangles": scene.triangles})


def by_threads(faces: int, rays: int, repeats: int) -> Table:
    """One scan, from one thread to two for each processor."""
    scene = aobake.Scene.from_arrays(*scan(faces))
    counts = [n for n in (1, 2, 4, 8, 16, 32, 64, 128) if n <= 2 * processors()]
    found = {n: turns(scene, Bare(scene, rays, n), rays, repeats, n) for n in counts}
    single = [one[2] for one in found[1]]
    rows = [[n, *row(f), ratios([one[2] for one in f], single)] for n, f in found.items()]
    facts = {"triangles": scene.triangles, "rays": rays, "processors": processors()}
    return Table("By threads", ("threads", *BESIDE, "whole bake / one thread"), rows, facts)


def closely(faces: int, rays: int, repeats: int) -> Table:
    """Where one bake's time goes, and what the whole command takes."""
    scene = aobake.Scene.from_arrays(*scan(faces))
    Bare(scene, rays)  # compiles: the second one's origins are timed
    bare = Bare(scene, rays)
    aobake.bake_vertices(scene, settings_of(rays))
    stages, whole, alone = [], [], []
    for _ in range(repeats):
        alone.append(bare.seconds())
        start = time.perf_counter()
        stages.append(aobake.bake_vertices(scene, settings_of(rays)).seconds)
        whole.append(time.perf_counter() - start)
    rows = [["bare packets", Spread.of(alone), None]]
    rows += [
        [
            f"stage {stage}",
            Spread.of(s[stage] for s in stages),
            ratios((s[stage] for s in stages), alone),
        ]
        for stage in stages[0]
    ]
    rows.append(["origins, within tracing", bare.origins_s / bare.threads, None])
    rows.append(["bake_vertices", Spread.of(whole), ratios(whole, alone)])
    commands = [command_seconds(scene, rays) for _ in range(max(1, repeats // 2))]
    rows.append(["`aobake vertex`", Spread.of(commands), None])
    facts = {"triangles": scene.triangles, "rays": rays, "threads": processors()}
    return Table("Where the time goes", ("what", "seconds", "times bare"), rows, facts)


def command_seconds(scene: aobake.Scene, rays: int) -> float:
    """Seconds of the whole `aobake vertex` process."""
    with tempfile.TemporaryDirectory() as folder:
        given, target = Path(folder, "scan.glb"), Path(folder, "ao.glb")
        aobake.save(aobake.bake_vertices(scene, aobake.BakeSettings(rays=1)), given)
        command = [sys.executable, "-m", "aobake", "vertex", str(given), "-o", str(target)]
        start = time.perf_counter()
        subprocess.run([*command, "--rays", str(rays), "--quiet"], check=True)
        return time.perf_counter() - start


def run(quick: bool) -> Iterator[Table]:
    """By size, by rays, by threads, and one mesh closely."""
    yield by_size(QUICK_SIZES if quick else SIZES)
    yield by_rays(70_000, QUICK_RAYS if quick else RAYS)
    yield by_threads(*((16_000, 64, 3) if quick else (70_000, 256, 5)))
    yield closely(*((16_000, 64, 3) if quick else (70_000, 256, 9)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--faces", type=int, default=70_000)
    parser.add_argument("--rays", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=5)
    asked = parser.parse_args()
    print(closely(asked.faces, asked.rays, asked.repeats).markdown())


if __name__ == "__main__":
    main()

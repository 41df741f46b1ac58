"""A batch on one and on two workers of a cluster, a texture in tiles, and what more workers would give.

    python benchmarks cluster [--quick]

The cluster is on this machine: a scheduler, and workers that are processes with one thread each. So what is
measured is all that a cluster adds but the network. What more workers give is computed from these numbers.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import trimesh
from scan import scan
from tables import Skipped, Spread, Table, ratios

from aobake.batch.parts import first_part, join_bake, make_part
from aobake.batch.processes import LocalExecutor
from aobake.batch.tasks import Executor, Task
from aobake.config import Configured
from aobake.jobs import Command, Job, run_job
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

__all__ = ["run"]

COMPUTED = (1, 2, 4, 8, 16, 32, 64)
NETWORK = 125e6  # bytes a second: a network of 1 Gbit, for the model alone


@dataclass(frozen=True)
class Sizes:
    """How much is baked."""

    assets: int
    faces: int
    rays: int
    tiny: int
    texture: int
    texture_faces: int
    texture_rays: int
    repeats: int


FULL = Sizes(24, 40_000, 256, 200, 4096, 20_000, 16, 3)
QUICK = Sizes(8, 10_000, 64, 40, 1024, 2_000, 8, 1)


def asset(path: Path, faces: int, scale: float = 1.0) -> Path:
    """One asset of this size."""
    vertices, triangles = scan(faces)
    trimesh.Trimesh(vertices * scale, triangles, process=False).export(path)
    return path


def task(folder: Path, name: str, number: int, command: Command, bake: BakeSettings) -> Task:
    """A task with one thread, whose folders all workers see."""
    chosen = Configured(bake=bake, store=StoreSettings(), image=ImageSettings())
    source, target = folder / "in", folder / "out"
    job = Job(command=command, input=source / name, output=target / name, chosen=chosen)
    return Task(number=number, job=job, threads=1, source=source, target=target)


def all_done(executor: Executor, tasks: Sequence[Task]) -> float:
    """Seconds until all tasks are done."""
    start, done = time.perf_counter(), 0
    for one in tasks:
        executor.start(one)
    while done < len(tasks):
        for outcome in executor.finished(10.0):
            if outcome.status != "done":
                raise RuntimeError(outcome.reason)
            done += 1
    return time.perf_counter() - start


@contextlib.contextmanager
def cluster(workers: int, tiles: str = "off") -> Iterator[Executor]:
    """An executor on this many workers of one thread, each warm."""
    try:
        from distributed import LocalCluster
    except ImportError as error:
        raise Skipped("the package distributed is not installed") from error
    from aobake.batch.cluster import ClusterExecutor
    from aobake.batch.tiles import TiledExecutor

    with LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as here:
        inner = ClusterExecutor(here.scheduler_address)
        while inner.capacity.workers < workers:
            time.sleep(0.1)
        with TiledExecutor(inner, "on" if tiles == "on" else "off") as executor:
            yield executor


def scaling(folder: Path, sizes: Sizes) -> tuple[Table, float]:
    """Many assets and one texture, on one and on two workers; and processor seconds of an asset."""
    bake = BakeSettings(rays=sizes.rays)
    many = [
        task(folder, f"{number:03}.glb", number, "vertex", bake) for number in range(sizes.assets)
    ]
    large = BakeSettings(size=sizes.texture, rays=sizes.texture_rays, denoise="off")
    one = task(folder, "large.glb", 0, "texture", large)
    took: dict[str, dict[int, list[float]]] = {
        "assets": {1: [], 2: []},
        "texture": {1: [], 2: []},
    }
    with cluster(1) as single, cluster(2, "on") as double:
        for executor, workers in ((single, 1), (double, 2)):
            all_done(executor, [replace(one, number=n) for n in range(workers)])  # warm
            all_done(executor, many[: 2 * workers])
        for _ in range(sizes.repeats):
            for executor, workers in ((single, 1), (double, 2)):
                took["assets"][workers].append(all_done(executor, many))
                took["texture"][workers].append(all_done(executor, [one]))
    names = {
        "assets": f"{sizes.assets} assets of {sizes.faces:,} faces, {sizes.rays} rays",
        "texture": f"a texture of {sizes.texture} x {sizes.texture}, {sizes.texture_rays} rays, in tiles",
    }
    rows = [
        (names[kind], Spread.of(by[1]), Spread.of(by[2]), ratios(by[1], by[2]))
        for kind, by in took.items()
    ]
    table = Table(
        "The same work on one and on two workers of one thread",
        ("", "one worker, s", "two workers, s", "times as fast"),
        rows,
        {"processors": len(os.sched_getaffinity(0))},
    )
    return table, Spread.of(took["assets"][1]).median / sizes.assets


def overhead(folder: Path, sizes: Sizes) -> tuple[Table, float]:
    """What a task takes on a cluster beyond what it takes here; tasks that do next to nothing."""
    tasks = [
        task(folder, "tiny.glb", number, "vertex", BakeSettings(rays=1))
        for number in range(sizes.tiny)
    ]
    tasks = [
        replace(one, job=replace(one.job, output=folder / "out" / f"tiny{one.number}.glb"))
        for one in tasks
    ]
    with LocalExecutor(processes=1, threads=1) as local, cluster(1) as far:
        took: dict[str, list[float]] = {"here": [], "cluster": []}
        for executor in (local, far):
            all_done(executor, tasks[:2])  # warm
        for _ in range(sizes.repeats):
            took["here"].append(all_done(local, tasks))
            took["cluster"].append(all_done(far, tasks))
    each = {name: [1000.0 * s / sizes.tiny for s in some] for name, some in took.items()}
    beyond = [b - a for a, b in zip(each["here"], each["cluster"], strict=True)]
    table = Table(
        f"{sizes.tiny} tiny tasks, one worker",
        ("a task here, ms", "on the cluster, ms", "what the cluster adds, ms"),
        [(Spread.of(each["here"]), Spread.of(each["cluster"]), Spread.of(beyond))],
    )
    return table, max(0.0, Spread.of(beyond).median) / 1000.0


def steps(folder: Path, sizes: Sizes) -> tuple[Table, dict[str, float]]:
    """Seconds of each step of a texture in one tile, with one thread, in this process."""
    bake = BakeSettings(size=sizes.texture, rays=sizes.texture_rays, denoise="off", threads=1)
    job, target = task(folder, "large.glb", 0, "texture", bake).job, folder / "out"
    took: dict[str, float] = {}
    part = first_part("large.glb", 1)

    def timed(name: str, start: float) -> None:
        took[name] = time.perf_counter() - start

    for _ in range(2):  # the first one compiles
        start = time.perf_counter()
        make_part(part, job, target)
        timed("lay out", start)
        start = time.perf_counter()
        make_part(replace(part, step="trace"), job, target)
        timed("prepare and trace", start)
        start = time.perf_counter()
        done = run_job(job, instead=join_bake(replace(part, step="join"), target))
        timed("put together and write", start)
    stages = done.report.seconds
    took["of it, the bands themselves"] = stages["texels"] + stages["trace"]
    took["bytes handed on"] = sum((target / name).stat().st_size for name in part.files)
    rows = [(name, seconds) for name, seconds in took.items() if not name.startswith("bytes")]
    table = Table(
        f"The steps of a texture of {sizes.texture} x {sizes.texture}, one thread",
        ("", "seconds"),
        rows,
        {"megabytes that tiles hand on": took["bytes handed on"] / 1e6},
    )
    return table, took


def computed(each: float, added: float, took: dict[str, float]) -> Table:
    """Times as fast with more workers of one thread, by the model in the note."""
    bands = took["of it, the bands themselves"]
    prepare = took["prepare and trace"] - bands
    serial = took["lay out"] + prepare + took["put together and write"]
    handed = took["bytes handed on"] / NETWORK
    alone = took["lay out"] + bands + took["put together and write"] - prepare
    rows = []
    for n in COMPUTED:
        many = 1000 * each / (max(1000 * (each + added) / n, 1000 * added) + each)
        tiled = 1.0 if n == 1 else alone / (serial + handed + bands / n)
        rows.append((n, many, tiled))
    return Table(
        "Computed: times as fast as one worker here",
        ("workers", "1,000 such assets", "the texture in tiles"),
        rows,
        note=(
            f"Assets: b = {each:.3g} s a bake and o = {1000 * added:.3g} ms that the cluster adds to each; 1,000 b "
            "against max(1,000 (b + o) / N, 1,000 o) + b: the scheduler hands out one after another, and the last "
            "worker may have begun late by a bake. Texture: what is done once (laying it out, preparing a worker, "
            f"putting it together: {serial:.3g} s), its {took['bytes handed on'] / 1e6:.0f} MB over a network of "
            f"1 Gbit ({handed:.2g} s), and {bands:.3g} s of bands shared by N."
        ),
    )


def run(quick: bool) -> Iterator[Table]:
    """Scaling, overhead and steps, then what follows from them."""
    sizes = QUICK if quick else FULL
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name in ("in", "out"):
            (folder / name).mkdir()
        for number in range(sizes.assets):
            asset(folder / "in" / f"{number:03}.glb", sizes.faces, 1.0 + number)
        asset(folder / "in" / "large.glb", sizes.texture_faces)
        asset(folder / "in" / "tiny.glb", 80)
        first, each = scaling(folder, sizes)
        yield first
        second, added = overhead(folder, sizes)
        yield second
        third, took = steps(folder, sizes)
        yield third
        yield computed(each, added, took)

"""What a batch takes besides its bakes, how busy it keeps the processors, and what its parent process holds.

    python benchmarks batch [--quick]

Every batch is the whole command, start-up and reports included. Processor time is that of the command and
of all its workers. One after another means a single process with a single thread.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import trimesh
from scan import scan
from tables import Spread, Table, ratios

__all__ = ["run"]

TINY_FACES, SMALL_FACES = 320, 20_000
IDLE = """
import sys
from pathlib import Path
import psutil
from aobake.batch.processes import LocalExecutor
from aobake.batch.tasks import Task
from aobake.config import Configured
from aobake.jobs import Job
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

chosen = Configured(bake=BakeSettings(), store=StoreSettings(), image=ImageSettings())
job = Job(command="vertex", input=Path("a.glb"), output=Path("b.glb"), chosen=chosen)
serve = "from aobake.batch.tasks import Outcome; from aobake.batch.worker import serve; "
serve += "serve(lambda task: Outcome(number=task.number, status='done'))"
command = (sys.executable, "-c", serve)
with LocalExecutor(processes=2, threads=2, command=command) as executor:
    begun = ended = 0
    while ended < int(sys.argv[1]):
        while begun - ended < 4:
            executor.start(Task(number=begun, job=job, threads=1))
            begun += 1
        ended += len(executor.finished(10.0))
    print(psutil.Process().memory_info().rss)
"""


@dataclass(frozen=True)
class Took:
    """Seconds on the clock and of processors, and the stages of all bakes together."""

    wall: float
    cpu: float
    bakes: float


def make(folder: Path, count: int, faces: int) -> Path:
    """A folder of assets that are all of this size, and all different."""
    folder.mkdir()
    for number in range(count):
        vertices, triangles = scan(faces)
        mesh = trimesh.Trimesh(vertices * (1.0 + number), triangles, process=False)
        mesh.export(folder / f"{number:04}.glb")
    return folder


def batch(source: Path, target: Path, *arguments: object) -> Took:
    """Run the command."""
    report = target.with_suffix(".json")
    command = [sys.executable, "-m", "aobake", "batch", source, "-o", target, "--quiet"]
    command += ["--report", report, *arguments]
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([str(word) for word in command], check=True, capture_output=True)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    jobs = json.loads(report.read_text(encoding="utf-8"))["jobs"]
    return Took(wall, cpu, sum(sum(job["stages"].values()) for job in jobs))


def overhead(folder: Path, count: int) -> Table:
    """Tiny assets, one worker."""
    source = make(folder / "tiny", count, TINY_FACES)
    one = ("--rays", 64, "--processes", 1, "--threads", 1)
    batch(make(folder / "first", 1, TINY_FACES), folder / "none", *one)  # compiled now
    rows: list[tuple[str, float, float, float]] = []
    for pictures in ("none", "thumbnails"):
        target = folder / f"baked-{pictures}"
        for run in ("first run", "second run, nothing to do"):
            took = batch(source, target, *one, "--pictures", pictures)
            baked = took.bakes if run == "first run" else 0.0
            each = 1000.0 * (took.wall - baked) / count
            rows.append((f"{run}, pictures {pictures}", took.wall, 1000.0 * baked / count, each))
    return Table(
        f"{count:,} tiny assets, one process",
        ("", "seconds", "bake, ms an asset", "beyond the bake, ms an asset"),
        rows,
        {"faces of each": TINY_FACES, "rays": 64},
    )


def busy(folder: Path, count: int, repeats: int) -> Table:
    """Small assets on all processors, in turn with one after another."""
    source = make(folder / "small", count, SMALL_FACES)
    threads = len(os.sched_getaffinity(0))
    ways = {
        "side by side": ("--processes", threads, "--threads", threads),
        "one after another": ("--processes", 1, "--threads", 1),
    }
    took: dict[str, list[Took]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            more = (*way, "--rays", 256, "--pictures", "none", "--force")
            took[name].append(batch(source, folder / "small-baked", *more))
    walls = {name: [one.wall for one in some] for name, some in took.items()}
    after = walls["one after another"]
    rows = [
        (
            name,
            Spread.of(walls[name]),
            Spread.of(100.0 * one.cpu / one.wall / threads for one in some),
            ratios(after, walls[name]),
        )
        for name, some in took.items()
    ]
    return Table(
        f"{count:,} small assets",
        ("", "seconds", f"of {threads} processors busy, %", "times as fast"),
        rows,
        {"faces of each": SMALL_FACES, "rays": 256},
    )


def parent(counts: tuple[int, ...]) -> Table:
    """What the process that hands out tasks holds at the end, for tasks that do nothing."""
    rows = []
    for count in counts:
        start = time.perf_counter()
        told = subprocess.run(
            [sys.executable, "-c", IDLE, str(count)], check=True, capture_output=True, text=True
        )
        each = 1000.0 * (time.perf_counter() - start) / count
        rows.append((count, int(told.stdout) / 1e6, each))
    return Table(
        "The executor alone, tasks that do nothing",
        ("tasks", "its process holds, MB", "ms a task, start-up included"),
        rows,
    )


def run(quick: bool) -> Iterator[Table]:
    """Overhead of tiny assets, then how busy the processors are, then the executor alone."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        yield overhead(folder, 100 if quick else 1000)
        yield busy(folder, 20 if quick else 100, 1 if quick else 3)
    yield parent((100, 1000) if quick else (100, 1000, 10_000))

"""What the memory of a batch costs: a job recorded, 10,000 unchanged ones compared, a folder renamed.

    python benchmarks manifest [--quick]

The assets are a kilobyte each, and nothing is baked: outputs are written as they are.
"""

from __future__ import annotations

import hashlib
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

from tables import Table

from aobake.batch.manifest import Manifest
from aobake.batch.places import LocalFolder, local_folder
from aobake.batch.standing import Standing
from aobake.batch.tasks import Outcome, Planned
from aobake.config import Configured
from aobake.jobs import Job
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

__all__ = ["run"]

CHOSEN = Configured(bake=BakeSettings(), store=StoreSettings(), image=ImageSettings())
REPORT = {
    "schema": 2,
    "warnings": ["nothing to speak of"] * 5,
    "plan": {str(n): n for n in range(200)},
}
PICTURE = bytes(range(256)) * 32  # 8 KiB, as a thumbnail has


def made(source: LocalFolder, target: LocalFolder, names: list[str]) -> dict[str, Outcome]:
    """Assets, outputs, and what a bake would have said of them."""
    outcomes = {}
    for number, name in enumerate(names):
        content = str(number).encode() * (1024 // len(str(number)))
        digest = hashlib.sha256(content).hexdigest()
        for place in (source, target):
            place.path(name).parent.mkdir(parents=True, exist_ok=True)
            place.path(name).write_bytes(content)
        outcomes[name] = Outcome(
            number=number,
            status="done",
            report=REPORT,
            inputs=((name, digest),),
            outputs=((name, digest),),
            pictures={"before": PICTURE, "after": PICTURE},
        )
    return outcomes


def planned(source: LocalFolder, target: LocalFolder) -> list[Planned]:
    """A vertex bake of every asset."""
    return [
        Planned(
            source=found.name,
            target=found.name,
            job=Job(
                command="vertex",
                input=source.path(found.name),
                output=target.path(found.name),
                chosen=CHOSEN,
            ),
            size=found.stamp.size,
        )
        for found in source.files(lambda _: True)
    ]


def timed(work: Callable[[], object]) -> float:
    """Seconds that it takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def run(quick: bool) -> Iterator[Table]:
    """Record, compare, compare with new stamps, and move every job."""
    count = 1000 if quick else 10_000
    names = [f"folder {number % 100}/asset {number}.glb" for number in range(count)]
    with tempfile.TemporaryDirectory() as scratch:
        source, target = local_folder(Path(scratch) / "in"), local_folder(Path(scratch) / "out")
        outcomes = made(source, target, names)
        jobs = planned(source, target)
        file = Path(scratch) / "batch.sqlite"
        rows: list[tuple[str, float]] = []
        standings: list[Standing] = []

        def compare() -> None:
            standings[:] = manifest.standings(jobs)

        with Manifest.open(file, source, target) as manifest:
            manifest.begin({})
            rows.append(("compare, all new", timed(compare)))
            some = jobs[: count // 10]
            each = timed(lambda: [manifest.record(job, outcomes[job.source]) for job in some])
            rows.append(("record, each on the disk (all, from a tenth)", 10 * each))
            for job in jobs[count // 10 :]:
                manifest.record(job, outcomes[job.source])
            rows.append(("walk both folders with a stat for each file", timed(lambda: [
                list(place.files(lambda _: True)) for place in (source, target)])))  # fmt: skip
            rows.append(("compare, all unchanged (with that walk)", timed(compare)))
            assert {standing.kind for standing in standings} == {"unchanged"}
            pairs = list(zip(jobs, standings, strict=True))
            rows.append(("keep what is unchanged", timed(lambda: manifest.keep(pairs))))
            rows.append(("read all entries", timed(lambda: [None for _ in manifest.entries(1)])))
            tracemalloc.start()
            for _ in manifest.entries(1):
                pass
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            for name in names:
                source.path(name).touch()
            rows.append(("compare, all with new stamps", timed(compare)))
            assert {standing.kind for standing in standings} == {"unchanged"}
            source.folder.rename(Path(scratch) / "old")
            (Path(scratch) / "in").mkdir()
            (Path(scratch) / "old").rename(Path(scratch) / "in" / "renamed")
            jobs = planned(source, target)
            rows.append(("compare, the folder renamed", timed(compare)))
            assert {standing.kind for standing in standings} == {"moved"}
        size = file.stat().st_size / 1e6
    yield Table(
        "The memory of a batch",
        ("what", "seconds", "ms a job"),
        [(what, seconds, seconds / count * 1e3) for what, seconds in rows],
        facts={"jobs": count, "MB of the database": size, "KB to read all entries": peak / 1e3},
    )

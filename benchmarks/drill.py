"""A batch that faults are done to: its assets, the command with a worker that breaks, and what is left of it.

    python benchmarks/drill.py batch IN -o OUT ...      as aobake batch, with the worker below
    python benchmarks/drill.py serve                    that worker

The worker bakes as the real one does, but an asset called "crash" crashes its process, one called "hang" hangs in
C code, beside one called "late" a file that is ready takes its place after it was read, and where a file "full"
is among the assets, the disk is.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

__all__ = ["LIMIT_S", "Drill", "Left", "assets", "until"]

LIMIT_S = 600.0  # for anything to happen that takes seconds
LOG = "AOBAKE_DRILL_LOG"  # the file that a line is added to for each bake
LIGHT = "AOBAKE_DRILL_LIGHT"  # whether assets are copied instead of baked, which needs no engine
AHEAD = "AOBAKE_DRILL_AHEAD"  # seconds by which the clock is ahead, and then goes back at each look

CUBE = """v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 1 5 8 4\n"""
CORNERS = [[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]
FACES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
         [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip
ENDINGS = (".obj", ".ply", ".gltf", ".glb")
BROKEN = 5  # every so many assets, one is


def assets(folder: Path, count: int, breaking: Sequence[str] = ("crash", "hang")) -> Path:
    """A folder of so many small assets, all different: every fifth is broken, and those that break the worker."""
    for number in range(count - len(breaking)):
        home = folder / f"set {number // 25}"
        home.mkdir(parents=True, exist_ok=True)
        path = home / f"{number:03}{ENDINGS[number % 4]}"
        _asset(path, 1.0 + number)
        if number % BROKEN == BROKEN - 1:
            content = path.read_bytes()
            path.write_bytes(content[: len(content) // 2] + b"\0broken")
    for name in breaking:
        (folder / f"{name}.obj").write_text(CUBE, encoding="ascii")
    return folder


def _asset(path: Path, size: float) -> None:
    """A box of this size, with side files where the format has some."""
    if path.suffix == ".obj":
        words = f"# {size}\nmtllib {path.stem}.mtl\nusemtl a\n{CUBE}"
        path.write_text(words, encoding="ascii")
        library = f"newmtl a\nmap_Kd shared.png\nKd {1 / size} 1 1\n"
        path.with_suffix(".mtl").write_text(library, encoding="ascii")
        (path.parent / "shared.png").write_bytes(b"a picture that several assets share")
        return
    import numpy as np
    import trimesh

    mesh = trimesh.Trimesh(np.array(CORNERS) * size, FACES, process=False)
    if path.suffix != ".gltf":
        mesh.export(path)
        return
    buffer = np.array(CORNERS, "<f4").tobytes() + np.array(FACES, "<u4").tobytes()
    path.with_suffix(".bin").write_bytes(buffer)
    views = [{"buffer": 0, "byteOffset": o, "byteLength": n} for o, n in ((0, 96), (96, 144))]
    box = {"min": [0, 0, 0], "max": [1, 1, 1]}
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", **box},
        {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
    ]
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [size, size, size]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"uri": f"{path.stem}.bin", "byteLength": 240}],
        "bufferViews": views, "accessors": accessors,
    }  # fmt: skip
    path.write_text(json.dumps(document), encoding="ascii")


@dataclass(frozen=True)
class Left:
    """What a batch left: name -> digest of what it wrote, asset -> state, and unfinished files."""

    written: Mapping[str, str]
    states: Mapping[str, str]
    parts: Sequence[str]


@dataclass(frozen=True)
class Drill:
    """A source, a target, and how batches of them are run. environment : of the batch, besides that of all"""

    source: Path
    target: Path
    arguments: Sequence[object] = ()
    environment: Mapping[str, str] = field(default_factory=dict)

    @property
    def log(self) -> Path:
        """Where the worker writes down what it has baked."""
        return self.target.with_suffix(".log")

    def start(
        self, *more: object, limit: Callable[[], None] | None = None
    ) -> subprocess.Popen[str]:
        """Begin a batch. limit : is called in its process before it runs"""
        words = [sys.executable, "-P", __file__, "batch", self.source, "-o", self.target, "--quiet"]
        return subprocess.Popen(
            [str(word) for word in (*words, *self.arguments, *more)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env={**os.environ, LOG: str(self.log), **self.environment},
            preexec_fn=limit,  # noqa: PLW1509 - no thread runs here
        )

    def run(self, *more: object, limit: Callable[[], None] | None = None) -> tuple[int, list[str]]:
        """A batch to its end: the exit status, and the lines that it said."""
        process = self.start(*more, limit=limit)
        said = process.communicate(timeout=LIMIT_S)[1]
        return process.returncode, [line for line in said.splitlines() if line]

    def outputs(self) -> int:
        """How many baked assets there are, without their side files."""
        return sum(path.suffix in ENDINGS for path in self.target.glob("set */*"))

    def left(self) -> Left:
        """What is there now, without reports and what the batch keeps for itself."""
        files = [path for path in self.target.rglob("*") if path.is_file()]
        names = {path.relative_to(self.target).as_posix(): path for path in files}
        parts = sorted(name for name in names if name.endswith(".part"))
        written = {
            name: hashlib.sha256(path.read_bytes()).hexdigest()
            for name, path in sorted(names.items())
            if not name.startswith((".aobake/", "report.")) and name not in parts
        }
        return Left(written, self._states(), parts)

    def _states(self) -> dict[str, str]:
        report = self.target / "report.json"
        if not report.exists():
            return {}
        jobs = json.loads(report.read_text(encoding="utf-8"))["jobs"]
        good = {"baked", "unchanged", "moved"}
        return {job["source"]: "done" if job["state"] in good else job["state"] for job in jobs}

    def twice(self) -> int:
        """How many bakes were done that had been done before."""
        if not self.log.exists():
            return 0
        done = Counter(self.log.read_text(encoding="utf-8").splitlines())
        return sum(count - 1 for count in done.values())


def until(holds: Callable[[], bool], process: subprocess.Popen[str]) -> bool:
    """Wait for something to be so; False where the process ended before."""
    end = time.monotonic() + LIMIT_S
    while not holds():
        if process.poll() is not None:
            return False
        if time.monotonic() > end:
            raise TimeoutError("what was waited for never came")
        time.sleep(0.002)
    return True


def batch() -> int:
    """The command, with the worker of this file."""
    from aobake.batch import processes
    from aobake.cli import main

    ahead = float(os.environ.get(AHEAD, "0"))
    if ahead:
        _turn_back(ahead)
    command = (sys.executable, "-P", __file__, "serve")
    processes.LocalExecutor = functools.partial(processes.LocalExecutor, command=command)  # type: ignore[misc, assignment]
    return main(sys.argv[1:])


def _turn_back(ahead: float) -> None:
    """Have the clock be ahead, and go back by an hour whenever somebody looks at it."""
    real, looks = time.time, iter(range(1 << 30))
    time.time = lambda: real() + ahead - 3600.0 * next(looks)
    import datetime as dt

    class Clock(dt.datetime):
        @classmethod
        def now(cls, tz: dt.tzinfo | None = None) -> dt.datetime:
            return dt.datetime.fromtimestamp(time.time(), tz)

    from aobake.batch import lock, manifest, run

    for module in (lock, manifest, run):
        module.datetime = Clock  # type: ignore[misc, assignment]


def serve() -> None:
    """The worker."""
    from aobake import report
    from aobake.batch import worker
    from aobake.batch.tasks import Outcome, Task

    digests = report.digests

    def do(task: Task) -> Outcome:
        asset = task.job.input
        if (task.source / "full").exists():
            return without_room(task)
        if asset.stem == "crash":
            ctypes.string_at(0)
        if asset.stem == "hang":
            ctypes.PyDLL(None).sleep(1000)
        ready = asset.with_suffix(".ready")
        if asset.stem == "late" and ready.exists():
            report.digests = lambda paths: (
                ready.exists() and ready.replace(asset),
                digests(paths),
            )[1]
        outcome = worker.work(task)
        report.digests = digests
        if outcome.status == "done":
            with Path(os.environ[LOG]).open("a", encoding="utf-8") as log:
                log.write(f"{asset.relative_to(task.source or '/')} {_version(outcome)}\n")
        return outcome

    def without_room(task: Task) -> Outcome:
        import resource

        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (16, limits[1]))
        outcome = worker.work(task)
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        return outcome

    if os.environ.get(LIGHT):
        worker._load = lambda: None  # noqa: SLF001
        worker._baked = _copied  # noqa: SLF001
    worker.serve(do)


def _version(outcome: object) -> str:
    """Which content of an asset was baked: another one is another bake."""
    return outcome.inputs[0][1][:8] if outcome.inputs else ""  # type: ignore[attr-defined]


def _copied(task: object) -> object:
    """In place of a bake: the asset and what it refers to are copied, in the way in which bakes are written."""
    from aobake import files, report
    from aobake.batch.tasks import Outcome
    from aobake.errors import InputError
    from aobake.meshes.formats.references import references

    job, source, target = task.job, task.source, task.target  # type: ignore[attr-defined]
    content = files.read_bytes(job.input)
    if b"\0broken" in content:
        raise InputError(f"{job.input}: this is broken.")
    sides = [job.input.parent / n for n in references(job.input) if (job.input.parent / n).exists()]
    read = report.digests([job.input, *sides])
    job.output.parent.mkdir(parents=True, exist_ok=True)
    copies = {job.output.parent / side.name: side.read_bytes() for side in sides}
    copies = {to: bytes_ for to, bytes_ in copies.items() if not to.exists()}
    files.write_files({**copies, job.output: b"baked " + content})
    wrote = report.digests([job.output, *copies])
    named = [
        tuple((Path(f.path).relative_to(folder).as_posix(), f.sha256) for f in some)
        for folder, some in ((source, read), (target, wrote))
    ]
    return Outcome(number=task.number, status="done", report={}, inputs=named[0], outputs=named[1])  # type: ignore[attr-defined]


if __name__ == "__main__":
    role = sys.argv[1]
    sys.exit(batch() if role == "batch" else serve())

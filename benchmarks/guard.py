"""The ratios that must not get worse: `make bench-check` measures them again and compares.

    python benchmarks --check [--instructions]      fails where one is more than 10 % worse than recorded
    python benchmarks --record [--instructions]     keeps what is measured now as results/recorded.json

Most are counts, which are the same on every machine: rays, bytes, modules, and, where they are asked for
and valgrind is installed, instructions, which take several minutes. The one that needs a clock is a
ratio of processor seconds of one thread, both sides in turn within one run: a busy machine slows both alike.
On two processors with eight others' processes on them three runs one after another gave 0.776 to 0.782. The
same for `aobake --help` beside an empty Python, and for files beside a bake, moved by 20 to 40 %: left out.
A ratio that is worse is measured once more before it counts.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from machine import commit, load, machine
from tables import Spread, Table

__all__ = ["GUARDED", "Guarded", "check", "record", "value_of", "worse"]

ALLOWED = 0.10
TURNS = 15
INSTRUCTIONS = "instructions"
Better = Literal["more", "less"]


@dataclass(frozen=True)
class Guarded:
    """A number that must not get worse: how to measure it, which way is better, and what kind it is."""

    measure: Callable[[], float | None]
    better: Better
    kind: str


def rays_to_tolerance() -> float:
    """Rays a vertex of the demo hall to an rms error of 0.01."""
    import aobake
    from aobake.demo import hall

    scene = hall()
    baked = aobake.bake_vertices(scene, aobake.BakeSettings(tolerance="rms:0.01"))
    return baked.rays / sum(map(len, baked.ao))


def error_of_rays() -> float:
    """RMSE of 64 rays at the vertices of a scan, times the square root of 64: independent rays have 0.27."""
    import numpy as np
    from scan import scan

    import aobake

    scene = aobake.Scene.from_arrays(*scan(8_000))
    truth, found = (
        aobake.bake_vertices(scene, aobake.BakeSettings(rays=rays, seed=rays)).ao[0]
        for rays in (4096, 64)
    )
    return float(np.sqrt(np.mean((found.astype(float) - truth) ** 2)) * 8.0)


def bytes_of_result() -> float:
    """Bytes that a bake adds to a GLB, a vertex."""
    import aobake
    from aobake.demo import hall

    scene = hall()
    with tempfile.TemporaryDirectory() as folder:
        plain, baked = Path(folder, "a.glb"), Path(folder, "b.glb")
        aobake.save(aobake.bake_vertices(scene, aobake.BakeSettings(rays=1)), plain)
        again = aobake.load(plain)
        aobake.save(aobake.bake_vertices(again, aobake.BakeSettings(rays=4)), baked)
        return (baked.stat().st_size - plain.stat().st_size) / again.vertices


def memory_of_bake() -> float:
    """Bytes of memory that a bake of 128,000 vertices takes beyond one of 32,000, a vertex."""
    from growth import measured

    few, many = (measured("vertices", n, 1)["bytes"].median for n in (32_000, 128_000))
    return (many - few) / 96_000


def modules_of_help() -> float:
    """Modules that `aobake --help` imports."""
    command = [sys.executable, "-X", "importtime", "-m", "aobake", "--help"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    return float(sum(line.startswith("import time:") for line in told.splitlines()) - 1)


def bare_beside_bake() -> float:
    """Processor seconds of bare packets over those of the whole bake, one thread, 256 rays."""
    from bare import Bare
    from scan import scan
    from tracing import settings_of

    import aobake

    scene = aobake.Scene.from_arrays(*scan(12_000))
    bare = Bare(scene, 256, threads=1)
    bare.seconds()
    aobake.bake_vertices(scene, settings_of(256, 1))
    found = []
    for _ in range(TURNS):
        before = bare.seconds(time.process_time)
        start = time.process_time()
        aobake.bake_vertices(scene, settings_of(256, 1))
        taken = time.process_time() - start
        found.append(0.5 * (before + bare.seconds(time.process_time)) / taken)
    return Spread.of(found).median


def memory_of_file() -> float:
    """Bytes of memory that reading a GLB of 40 MB and writing it with its values takes, a byte of the file."""
    from assets import measured

    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "a.glb"), Path(folder, "b.glb")
        making = [sys.executable, str(Path(__file__).with_name("assets.py")), "--make", str(source)]
        subprocess.run([*making, "--megabytes", "40"], check=True)
        return measured(source, target, "color", 3)["memory"].median / source.stat().st_size


def instructions_of_ray() -> float | None:
    """Instructions of a whole bake, a ray: what 80 rays take beyond 16. None without valgrind."""
    if shutil.which("valgrind") is None:
        return None
    faces, vertices, few, many = 2_000, 986, 16, 80
    counts = [_instructions(faces, rays) for rays in (few, many)]
    return (counts[1] - counts[0]) / ((many - few) * vertices)


def _instructions(faces: int, rays: int) -> int:
    command = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
    command += [sys.executable, __file__, "--bake", str(faces), str(rays)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    found = re.search(r"I\s+refs:\s+([\d,]+)", told)
    if found is None:
        raise RuntimeError(f"valgrind said nothing of instructions: {told[-200:]}")
    return int(found[1].replace(",", ""))


GUARDED: Mapping[str, Guarded] = {
    "rays a vertex to rms:0.01, demo hall": Guarded(rays_to_tolerance, "less", "count"),
    "error of 64 rays, against chance": Guarded(error_of_rays, "less", "count"),
    "bytes that a bake adds, a vertex": Guarded(bytes_of_result, "less", "count"),
    "bytes of memory, a vertex": Guarded(memory_of_bake, "less", "count"),
    "bytes of memory of reading and writing, a byte": Guarded(memory_of_file, "less", "count"),
    "modules of aobake --help": Guarded(modules_of_help, "less", "count"),
    "instructions of a ray": Guarded(instructions_of_ray, "less", INSTRUCTIONS),
    "bare packets / whole bake": Guarded(bare_beside_bake, "more", "processor time"),
}


def value_of(name: str) -> float | None:
    """Measure one in a process of its own: memory that this one had would hide theirs."""
    command = [sys.executable, __file__, "--measure", name]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def worse(found: float, recorded: float, better: Better) -> float:
    """By which share a number is worse than the recorded one; below 0 where it is better."""
    return recorded / found - 1.0 if better == "more" else found / recorded - 1.0


def record(folder: Path, *, instructions: bool = False) -> int:
    """Measure all, and keep them. The exit status."""
    found = {name: value_of(name) for name in _chosen(instructions=instructions)}
    kept = {"machine": machine(), "commit": commit(), "load": load(), "values": found}
    folder.mkdir(exist_ok=True)
    (folder / "recorded.json").write_text(json.dumps(kept, indent=2) + "\n", encoding="utf-8")
    rows = [[name, GUARDED[name].kind, value] for name, value in found.items()]
    print(Table("Recorded", ("what", "kind", "value"), rows).markdown())
    return 0


def _chosen(*, instructions: bool) -> Mapping[str, Guarded]:
    return {n: each for n, each in GUARDED.items() if instructions or each.kind != INSTRUCTIONS}


def check(folder: Path, *, instructions: bool = False) -> int:
    """Measure all again and compare. The exit status: 1 where one is worse by more than is allowed."""
    recorded = json.loads((folder / "recorded.json").read_text(encoding="utf-8"))["values"]
    rows, failed = [], []
    for name, guarded in _chosen(instructions=instructions).items():
        old, new = recorded.get(name), value_of(name)
        if old is None or new is None:
            rows.append([name, old, new, "not compared"])
            continue
        if worse(new, old, guarded.better) > ALLOWED:
            again = value_of(name)
            best = min if guarded.better == "less" else max
            new = new if again is None else best(new, again)
        by = worse(new, old, guarded.better)
        failed += [name] if by > ALLOWED else []
        rows.append([name, old, new, f"{abs(by):.1%} {'worse' if by > 0.0 else 'better'}"])
    print(Table("Guarded", ("what", "recorded", "now", "which is"), rows).markdown())
    if failed:
        print(f"worse than recorded by more than {ALLOWED:.0%}: {', '.join(failed)}")
    return 1 if failed else 0


def _bake(faces: int, rays: int) -> None:
    """What valgrind counts: one thread, every vertex."""
    from scan import scan
    from tracing import settings_of

    import aobake

    aobake.bake_vertices(aobake.Scene.from_arrays(*scan(faces)), settings_of(rays, 1))


if __name__ == "__main__":
    if sys.argv[1] == "--bake":
        _bake(int(sys.argv[2]), int(sys.argv[3]))
    else:
        print(json.dumps(GUARDED[sys.argv[2]].measure()))

"""What a command takes before and around its work: help, the smallest bakes, and the first runs ever.

    python benchmarks startup [--quick]

Every run is a process of its own. The first run ever has an empty folder for compiled kernels.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from tables import Spread, Table

__all__ = ["run"]

CACHE = "AOBAKE_CACHE_DIR"


def seconds(arguments: list[str], environment: Mapping[str, str] | None = None) -> float:
    """Seconds of a Python from its start to its end."""
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, **(environment or {})},
        capture_output=True,
        check=True,
    )
    return time.perf_counter() - start


def run(quick: bool) -> Iterator[Table]:
    """In turn: Python, imports, help, info, the smallest bakes; then the first runs ever."""
    repeats, first_runs = (3, 1) if quick else (11, 3)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        asset = folder / "tetrahedron.obj"
        asset.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
        aobake = ["-m", "aobake"]
        vertex = [*aobake, "vertex", str(asset), "--force", "-o", str(folder / "ao.ply")]
        texture = [*aobake, "texture", str(asset), "--force", "--size", "64", "-o"]
        texture.append(str(folder / "ao.png"))
        works = {
            "python -c pass": ["-c", "pass"],
            "import numpy, numba": ["-c", "import numpy, numba"],
            "aobake --version": [*aobake, "--version"],
            "aobake --help": [*aobake, "--help"],
            "aobake vertex --help": [*aobake, "vertex", "--help"],
            "aobake info": [*aobake, "info"],
            "aobake vertex, a tetrahedron": vertex,
            "aobake texture, a tetrahedron": texture,
        }
        for bake in (vertex, texture):
            seconds(bake)  # compiled now
        taken: dict[str, list[float]] = {name: [] for name in works}
        first: dict[str, list[float]] = {"vertex": [], "texture": []}
        for _ in range(repeats):
            for name, arguments in works.items():
                taken[name].append(seconds(arguments))
        for number in range(first_runs):
            for command, arguments in (("vertex", vertex), ("texture", texture)):
                cache = {CACHE: str(folder / f"{command}{number}")}
                first[command].append(seconds(arguments, cache))
    taken |= {f"aobake {command}, first run ever": found for command, found in first.items()}
    scale = min(taken["import numpy, numba"])
    rows = [[name, Spread.of(found), min(found) / scale] for name, found in taken.items()]
    yield Table(
        "Start-up",
        ("command", "seconds", "least, in imports of numba"),
        rows,
        note="A first run ever finds no compiled kernels: each has an empty folder of its own for them.",
    )

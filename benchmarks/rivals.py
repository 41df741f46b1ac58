"""Peers in environments of their own: asking them for a bake, and what a bake to a given error takes.

`benchmarks/peers/setup` makes the environments; AOBAKE_PEERS names their folder.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tables import Cell, Skipped, Spread, Table

__all__ = [
    "Answer",
    "Level",
    "Peer",
    "ask",
    "environment",
    "in_short",
    "levels_table",
    "rms",
    "time_table",
    "time_to",
]

FloatArray = NDArray[np.float64]
SCRIPTS = Path(__file__).parent / "peers"


def environment() -> Path:
    """The folder with a Python environment for each peer."""
    given = os.environ.get("AOBAKE_PEERS")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(given) if given else cache / "aobake-peers"


@dataclass(frozen=True)
class Peer:
    """One baker, and how it is asked.

    samples, quick : numbers of samples to sweep; own : a further one, whose values are its own truth
    values : makes ambient occlusion of what it gives, for a number of samples
    """

    name: str
    script: str
    samples: Sequence[int]
    quick: Sequence[int]
    own: int | None = None
    values: Callable[[FloatArray, int], FloatArray] = lambda found, _: found
    asked: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Answer:
    """What one run over all samples gave: version and settings in words, seconds and values of each."""

    version: str
    settings: Mapping[str, str]
    samples: Sequence[int]
    seconds: Sequence[float]
    values: Sequence[FloatArray]


@dataclass(frozen=True)
class Level:
    """One setting of one baker.

    rmse : against the reference; own : against its own values at many more samples, or None
    rays : in all
    """

    baker: str
    setting: str
    seconds: Spread
    rays: int
    rmse: float
    own: float | None = None

    @property
    def error(self) -> float:
        """The lower of both: a baker that aims at something else is not held to that."""
        return self.rmse if self.own is None else min(self.rmse, self.own)


def ask(
    peer: Peer, arrays: Mapping[str, NDArray[np.generic]], samples: Sequence[int], **asked: object
) -> Answer:
    """Run a peer in its own environment. Raises Skipped where it is absent or fails."""
    python = environment() / peer.script / "bin" / "python"
    if not python.exists():
        raise Skipped(f"{peer.name} is not there: benchmarks/peers/setup {peer.script}")
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder, "mesh.npz"), **arrays)
        request = {"adaptive": False, "seed": 1, **peer.asked, **asked}
        request |= {"mesh": "mesh.npz", "samples": list(samples)}
        Path(folder, "request.json").write_text(json.dumps(request))
        command = [str(python), str(SCRIPTS / f"{peer.script}.py"), folder]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise Skipped(f"{peer.name} failed: {done.stderr.strip().splitlines()[-1:]}")
        told = json.loads(Path(folder, "answer.json").read_text())
        found = [np.load(Path(folder, f"{n}.npy")) for n in range(len(samples))]
    return Answer(
        version=told["version"],
        settings=told["settings"],
        samples=samples,
        seconds=[run["seconds"] for run in told["runs"]],
        values=[peer.values(x, n) for x, n in zip(found, samples, strict=True)],
    )


def rms(error: FloatArray) -> float:
    """The root of the mean square."""
    return float(np.sqrt(np.mean(np.square(error))))


def time_to(levels: Iterable[Level], error: float) -> tuple[float, float] | None:
    """(seconds, rays) for an error, between levels on logarithmic axes; None outside of them."""
    steps = sorted(levels, key=lambda level: -level.error)
    for worse, better in pairwise(steps):
        if worse.error >= error >= better.error > 0.0:
            span = math.log(worse.error / better.error)
            t = math.log(worse.error / error) / span if span > 0.0 else 0.0
            seconds = worse.seconds.median * (better.seconds.median / worse.seconds.median) ** t
            return seconds, worse.rays * (better.rays / worse.rays) ** t
    return None


def levels_table(title: str, levels: Iterable[Level], facts: Mapping[str, Cell]) -> Table:
    """Every setting of every baker."""
    rows = [
        [x.baker, x.setting, x.seconds, x.rays / x.seconds.median / 1e6, x.rmse, x.own]
        for x in levels
    ]
    columns = ("baker", "asked for", "seconds", "Mrays/s", "RMSE", "RMSE to its own limit")
    return Table(title, columns, rows, facts)


def time_table(
    title: str, levels: Sequence[Level], errors: Sequence[float], ours: str, note: str = ""
) -> Table:
    """Seconds to each error, and as a multiple of ours."""
    rows: list[list[Cell]] = []
    for baker in dict.fromkeys(level.baker for level in levels):
        row: list[Cell] = [baker]
        for error in errors:
            mine = time_to([level for level in levels if level.baker == ours], error)
            found = time_to([level for level in levels if level.baker == baker], error)
            row += (
                [None, None] if found is None else [found[0], found[0] / mine[0] if mine else None]
            )
        rows.append(row)
    columns = ["baker", *(c for e in errors for c in (f"s to {e:g}", "times ours"))]
    return Table(title, columns, rows, {"ours": ours}, note)


def in_short(
    title: str,
    levels: Sequence[Level],
    error: float,
    ours: Sequence[str],
    further: Sequence[tuple[str, float]] = (),
) -> Table:
    """Seconds to one error alone, the fastest first, as multiples of the best of ours.

    further : (what, seconds) that are no bakers' levels
    """
    bakers = dict.fromkeys(level.baker for level in levels)
    times = {baker: time_to([x for x in levels if x.baker == baker], error) for baker in bakers}
    found = [(baker, time[0]) for baker, time in times.items() if time is not None]
    best = min((seconds for baker, seconds in found if baker in ours), default=None)
    rows: list[list[Cell]] = [
        [what, seconds, None if best is None else seconds / best]
        for what, seconds in sorted([*found, *further], key=lambda pair: pair[1])
    ]
    return Table(
        title, ("baker", f"seconds to RMSE {error:g}", "times the fastest of aobake"), rows
    )

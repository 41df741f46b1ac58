"""One format, fuzzed in this process: by atheris where it is installed, else by seeded damage alone.

    python -m fuzz.one SUFFIX CORPUS FAILURES FOLDER SECONDS SEED

What breaks the contract is kept in FAILURES, the smallest file for each place in the source, with its
traceback beside it; the work goes on. FOLDER holds the input that is being tried, for whoever finds
this process dead or stuck.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import random
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path

from fuzz.damage import damaged

__all__ = ["fuzz"]

LONGEST = 1 << 16  # bytes of an input
SLOWEST_S = 20  # of one input
MOST_MEMORY_MB = 4096
COMPILED = (  # numba reads the bytecode of these itself
    "aobake.meshes.formats.gltf.meshopt_kernels",
    "aobake.meshes.formats.gltf.meshopt_index_kernels",
)

Contract = Callable[[Path], bool]


def fuzz(
    suffix: str, corpus: Path, failures: Path, folder: Path, seconds: float, seed: int
) -> None:
    """Fuzz the reader and the writer of one suffix for a while; atheris ends the process itself."""
    failures.mkdir(parents=True, exist_ok=True)
    way = _guided if importlib.util.find_spec("atheris") else _unguided
    way(suffix, corpus, failures, seconds, seed, folder)


def _guided(
    suffix: str, corpus: Path, failures: Path, seconds: float, seed: int, folder: Path
) -> None:
    import atheris

    with atheris.instrument_imports(include=["aobake.meshes.formats"], exclude=list(COMPILED)):
        for name in ("", ".gltf", ".gltf.read", ".gltf.write", ".obj", ".ply", ".merged"):
            importlib.import_module(f"aobake.meshes.formats{name}")
    hold = importlib.import_module("fuzz.contract").hold

    for path in sorted(corpus.glob(f"*{suffix}"))[:5]:  # compiles the kernels, outside of the clock
        _try(path.read_bytes(), suffix, hold, folder, failures)

    def mutate(data: bytes, most: int, number: int) -> bytes:
        found = damaged(data, suffix, random.Random(number), lambda d, _: atheris.Mutate(d, most))
        return found[:most]

    options = [
        sys.argv[0],
        str(corpus),
        f"-max_total_time={max(1, round(seconds))}",
        f"-seed={seed + 1}",  # 0 would be a random one
        f"-max_len={LONGEST}",
        f"-timeout={SLOWEST_S}",
        f"-rss_limit_mb={MOST_MEMORY_MB}",
        f"-artifact_prefix={failures}/{suffix[1:]}-",
        "-len_control=0",
        "-verbosity=0",
        "-print_final_stats=1",
    ]
    atheris.Setup(
        options, lambda data: _try(data, suffix, hold, folder, failures), custom_mutator=mutate
    )
    atheris.Fuzz()


def _unguided(
    suffix: str, corpus: Path, failures: Path, seconds: float, seed: int, folder: Path
) -> None:
    hold = importlib.import_module("fuzz.contract").hold
    rng = random.Random(seed)
    seeds = [path.read_bytes() for path in sorted(corpus.iterdir())]
    end, tried = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        data = damaged(rng.choice(seeds), suffix, rng, _plain)
        _try(data[:LONGEST], suffix, hold, folder, failures)
        tried += 1
    sys.stderr.write(f"stat::number_of_executed_units: {tried}\n")


def _plain(data: bytes, rng: random.Random) -> bytes:
    """A copy with a few bytes changed, sometimes cut."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 3, 20)) if found else 0):
        found[rng.randrange(len(found))] = rng.randrange(256)
    return bytes(found[: rng.randrange(len(found))] if found and rng.random() < 0.3 else found)


def _try(data: bytes, suffix: str, hold: Contract, folder: Path, failures: Path) -> None:
    """Hold one input to the contract, and keep it where it breaks it."""
    path = folder / f"input{suffix}"
    path.write_bytes(data)
    try:
        hold(path)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is what is looked for
        _keep(data, suffix, error, failures)
    finally:
        for left in folder.iterdir():
            with contextlib.suppress(OSError):
                left.unlink()


def _keep(data: bytes, suffix: str, error: Exception, failures: Path) -> None:
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "aobake" in Path(frame.filename).parts] or frames
    place = f"{Path(own[-1].filename).stem}-{own[-1].lineno}"
    target = failures / f"{suffix[1:]}-{type(error).__name__}-{place}{suffix}"
    if not target.exists() or target.stat().st_size > len(data):
        target.write_bytes(data)
        text = "".join(traceback.format_exception(error))
        Path(f"{target}.txt").write_text(text, encoding="utf-8", errors="backslashreplace")


if __name__ == "__main__":
    asked = sys.argv[1:]
    fuzz(asked[0], Path(asked[1]), Path(asked[2]), Path(asked[3]), float(asked[4]), int(asked[5]))

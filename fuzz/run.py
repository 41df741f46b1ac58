"""Fuzz every reader for a bounded time; exits 1 where something broke, and says which files do it.

python -m fuzz.run [--seconds 60] [--seed 0] [--folder .fuzz] [FILE ...]
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fuzz.corpus import SUFFIXES, make_corpus

__all__ = ["main"]

GRACE_S = 60.0  # kernels may have to be compiled first


def _fuzzed(suffix: str, corpus: Path, failures: Path, seconds: float, seed: int) -> str:
    """Fuzz one format in processes of their own, since a crash ends one; a line on how it went."""
    end, tried, starts = time.monotonic() + seconds, 0, 0
    while (left := end - time.monotonic()) > 1.0 or starts == 0:
        starts += 1
        with tempfile.TemporaryDirectory() as folder:
            places = [str(corpus), str(failures), folder]
            done = _process([suffix, *places, str(max(left, 1.0)), str(seed + starts)], left)
            found = re.findall(r"number_of_executed_units: *(\d+)", done)
            tried += int(found[-1]) if found else 0
            for path in Path(folder).glob(f"input{suffix}"):  # it was being tried at the end
                shutil.copyfile(path, failures / f"{suffix[1:]}-ended-{starts}{suffix}")
                (failures / f"{suffix[1:]}-ended-{starts}.txt").write_text(done, encoding="utf-8")
        if not found and left > seconds - 1.0:
            sys.stderr.write(done[-2000:])
            break  # it does not even start
    return f"{suffix}: {tried} inputs in {starts} processes"


def _process(arguments: list[str], seconds: float) -> str:
    """What a process of fuzz.one says; it is ended where it does not end by itself.

    The limit for one input is atheris's first, but its signal handler can lock up.
    """
    command = [sys.executable, "-m", "fuzz.one", *arguments]
    try:
        done = subprocess.run(command, capture_output=True, check=False, timeout=seconds + GRACE_S)
        said = done.stderr
    except subprocess.TimeoutExpired as error:
        said = error.stderr or b""
    return said.decode(errors="replace")[-20_000:]


def main() -> int:
    """Share the time among the formats; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=Path(".fuzz"))
    parser.add_argument("--only", choices=SUFFIXES, help="one format alone")
    parser.add_argument("files", type=Path, nargs="*", help="files of your own for the corpus")
    asked = parser.parse_args()
    failures = asked.folder / "failures"
    failures.mkdir(parents=True, exist_ok=True)
    folders = make_corpus(asked.folder / "corpus", asked.files)
    suffixes = [asked.only] if asked.only else list(SUFFIXES)
    for suffix in suffixes:
        share = asked.seconds / len(suffixes)
        line = _fuzzed(suffix, folders[suffix], failures, share, asked.seed)
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    found = sorted(path for path in failures.iterdir() if path.is_file())
    for path in found:
        sys.stdout.write(f"broke the contract: {path}\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

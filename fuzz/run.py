"""Fuzz every reader for a bounded time; exits 1 where something broke, and says which files do it.

    python -m fuzz.run [--seconds 60] [--seed 0] [--folder .fuzz] [FILE ...]
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import time
from pathlib import Path

from fuzz.corpus import SUFFIXES, make_corpus

__all__ = ["main"]


def _fuzzed(suffix: str, corpus: Path, failures: Path, seconds: float, seed: int) -> str:
    """Fuzz one format in a process of its own, since a crash ends it; one line on how it went."""
    command = [sys.executable, "-m", "fuzz.one", suffix, str(corpus), str(failures)]
    end, tried, status, starts = time.monotonic() + seconds, 0, 0, 0
    while (left := end - time.monotonic()) > 1.0 or starts == 0:
        done = subprocess.run(
            [*command, str(max(left, 1.0)), str(seed + starts)],
            stderr=subprocess.PIPE,
            stdout=subprocess.PIPE,
            check=False,
        )
        text = done.stderr.decode(errors="replace")
        found = re.findall(r"number_of_executed_units: *(\d+)", text)
        tried += int(found[-1]) if found else 0
        starts += 1
        if done.returncode:
            status = done.returncode
            name = f"{suffix[1:]}-process-{starts}.txt"
            (failures / name).write_text(text[-20_000:], encoding="utf-8")
            if not found:
                break  # it does not even start
    return f"{suffix}: {tried} inputs in {starts} processes" + (
        f", the last status {status}" if status else ""
    )


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

"""Run the benchmarks: print their tables, and append what was measured to benchmarks/results/.

    python benchmarks [NAME ...] [--quick] [--list] [--results FOLDER]
    python benchmarks --check          compare the guarded ratios with the recorded ones
    python benchmarks --record         measure them anew, and keep them as the recorded ones

Every benchmark runs in a process of its own, so that none inherits memory or compiled code of another
one, and its peak memory is its own. What fails does not stop the others.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
import datetime as dt
import importlib
import json
import subprocess
import sys
import time
from pathlib import Path

import machine
from tables import Skipped, Table

HERE = Path(__file__).parent
RESULTS = HERE / "results"


def benchmarks() -> dict[str, str]:
    """Name -> first line of its docstring, of every module here that has a function `run`."""
    found = {}
    for path in sorted(HERE.glob("*.py")):
        tree = ast.parse(path.read_bytes())
        if any(isinstance(node, ast.FunctionDef) and node.name == "run" for node in tree.body):
            found[path.stem] = (ast.get_docstring(tree) or path.stem).splitlines()[0]
    return found


def measured(name: str, *, quick: bool) -> dict[str, object]:
    """Run one benchmark in this process, and print its tables as they come. The record of it.

    Ctrl-C ends it: what has been measured until then is kept.
    """
    before, start = machine.load(), time.perf_counter()
    record: dict[str, object] = {
        "benchmark": name,
        "date": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        "quick": quick,
    }
    tables: list[Table] = []
    try:
        for table in importlib.import_module(name).run(quick):
            print(table.markdown(), flush=True)
            tables.append(table)
    except KeyboardInterrupt:
        print("stopped: the tables above are kept\n", flush=True)
        record["stopped"] = True
    except Skipped as reason:
        print(f"skipped: {reason}\n", flush=True)
        record["skipped"] = str(reason)
    from aobake.environment import versions

    return {
        **record,
        "tables": [dataclasses.asdict(table) for table in tables],
        "seconds": round(time.perf_counter() - start, 3),
        "peak_memory": machine.peak_memory(),
        "load": [before, machine.load()],
        "machine": machine.machine(),
        "versions": versions(),
        "commit": machine.commit(),
    }


def one(name: str, folder: Path, *, quick: bool) -> None:
    """Measure one benchmark, and append its record to those of earlier runs."""
    record = measured(name, quick=quick)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"{name}.jsonl").open("a", encoding="utf-8") as records:
        records.write(json.dumps(record) + "\n")
    peak, (before, after) = record["peak_memory"], record["load"]
    print(f"{record['seconds']:.0f} s, {peak / 1e6:.0f} MB, load {before:.1f} to {after:.1f}\n")


def every(names: list[str], folder: Path, *, quick: bool) -> list[str]:
    """Run several, each in a process of its own; the names of those that failed."""
    titles, failed = benchmarks(), []
    for name in names:
        print(f"## {name}\n\n{titles[name]}\n", flush=True)
        command = [sys.executable, str(HERE), name, "--here", "--results", str(folder)]
        running = subprocess.Popen(command + ["--quick"] * quick)
        try:
            status = running.wait()
        except KeyboardInterrupt:  # it has been told as well, and writes down what it has
            running.wait()
            sys.exit("stopped")
        if status:
            failed.append(name)
    return failed


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python benchmarks", description=__doc__.splitlines()[0] if __doc__ else ""
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="those to run; all without one")
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="the same")
    parser.add_argument("--quick", action="store_true", help="small sizes: minutes for all")
    parser.add_argument("--list", action="store_true", help="say what there is")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of the records")
    parser.add_argument("--check", action="store_true", help="fail where a guarded ratio is worse")
    parser.add_argument("--record", action="store_true", help="keep the guarded ratios of now")
    parser.add_argument("--instructions", action="store_true", help="those as well, by valgrind")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    known, names = benchmarks(), [*asked.names, *asked.only]
    for name in names:
        if name not in known:
            parser.error(f"there is no benchmark {name!r}. Known: {', '.join(known)}.")
    if asked.list:
        for name, title in known.items():
            print(f"{name:14} {title}")
    elif asked.check or asked.record:
        guard = importlib.import_module("guard")
        measure = guard.record if asked.record else guard.check
        sys.exit(measure(RESULTS, instructions=asked.instructions))
    elif asked.here:
        one(names[0], asked.results, quick=asked.quick)
    else:
        failed = every(names or list(known), asked.results, quick=asked.quick)
        if failed:
            sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()

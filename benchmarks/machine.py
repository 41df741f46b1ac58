"""Where a benchmark was run: the machine, its load, the versions, and the memory that this process took."""

from __future__ import annotations

import os
import platform
import resource
import subprocess
import sys
from pathlib import Path

__all__ = ["available_memory", "commit", "load", "machine", "peak_memory"]


def machine() -> dict[str, str | int]:
    """System, processor, how many of them this process may use, and bytes of memory."""
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "processors": usable or 1,
        "memory": pages,
    }


def _processor() -> str:
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text(encoding="utf-8").splitlines() if facts.exists() else []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor()


def load() -> float:
    """Processes that wanted to run, in the mean over the last minute."""
    return os.getloadavg()[0]


def peak_memory() -> int:
    """Bytes that this process had at most, or one of those that it started and waited for.

    Linux counts in what the process had that started this one: that one has to be small.
    """
    unit = 1 if sys.platform == "darwin" else 1024
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return unit * max(resource.getrusage(one).ru_maxrss for one in who)


def available_memory() -> int | None:
    """Bytes that can still be had; None where the system does not say."""
    facts = Path("/proc/meminfo")
    if not facts.exists():
        return None
    lines = dict(line.split(":") for line in facts.read_text(encoding="ascii").splitlines())
    return 1024 * int(lines["MemAvailable"].split()[0])


def commit() -> str:
    """The commit that is checked out, with a mark where files were changed since; empty where there is none."""
    told = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=12"],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=False,
    )
    return told.stdout.strip()

"""What a process holds in memory, what it may hold, and what this machine has to give.

A process is kept to its limit twice. Its parent looks at what it holds, several times a second, and ends
it when that is too much: exact, but late. Its own limit on allocations is in force at once, so that one
huge request cannot bring the machine down between two looks: prompt, but it counts what was asked for
and never touched, so some is allowed for that.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil

__all__ = ["allocations_limited", "bytes_held", "forget_peak", "memory_to_give", "peak_bytes"]

PER_THREAD = (
    16 << 20
)  # address space that a thread asks for beyond what it uses: its stack, its heap
SHARE = 0.9  # of the memory that is free now, the rest is for whatever else this machine does
GROUPS = Path("/sys/fs/cgroup")  # where Linux keeps the limits of a container


def bytes_held(process: int) -> int:
    """Bytes of memory that a process has in use now; 0 where it is gone or may not be looked at."""
    try:
        return int(psutil.Process(process).memory_info().rss)
    except psutil.Error:
        return 0


def memory_to_give() -> int:
    """Bytes that work may take on this machine now, or in the container that this is."""
    free = int(psutil.virtual_memory().available)
    for limit, used in (
        ("memory.max", "memory.current"),
        ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"),
    ):
        with contextlib.suppress(OSError, ValueError):  # not there, or "max"
            free = min(free, int((GROUPS / limit).read_text()) - int((GROUPS / used).read_text()))
    return int(SHARE * max(free, 0))


def forget_peak() -> None:
    """Let peak_bytes count from here; without effect where the system cannot do so."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def peak_bytes() -> int:
    """The most memory that this process has had in use since forget_peak; 0 where the system does not tell."""
    with contextlib.suppress(OSError):
        status = Path("/proc/self/status").read_text(encoding="utf-8", errors="replace")
        if found := re.search(r"^VmHWM:\s*(\d+) kB", status, re.MULTILINE):
            return 1024 * int(found[1])
    return 0


@contextlib.contextmanager
def allocations_limited(memory: int | None, threads: int) -> Iterator[None]:
    """Within it, a request for memory beyond a limit is refused: a MemoryError in Python.

    memory : bytes that this process may hold, what it holds already included; None: no limit
    threads : that it uses. Without effect where the system has no such limit: all but Linux.
    """
    if memory is None or sys.platform != "linux":
        yield
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_DATA)
    limit = memory + _asked_for_but_untouched() + threads * PER_THREAD
    if before[1] != resource.RLIM_INFINITY:
        limit = min(limit, before[1])
    resource.setrlimit(resource.RLIMIT_DATA, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def _asked_for_but_untouched() -> int:
    """Bytes of data that count for the limit on allocations and take no memory."""
    fields = Path("/proc/self/statm").read_text(encoding="ascii").split()
    resident, shared, data = (int(fields[i]) for i in (1, 2, 5))
    return os.sysconf("SC_PAGE_SIZE") * max(0, data - (resident - shared))

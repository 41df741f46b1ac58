"""What aobake runs on: versions and the machine, for reports and for questions."""

from __future__ import annotations

import importlib.metadata
import os
import platform

from aobake import __version__
from aobake.errors import EngineError

__all__ = ["cache_folder", "machine", "processors", "versions"]

PACKAGES = ("embreex", "numba", "numpy", "scipy", "trimesh", "DracoPy")


def versions() -> dict[str, str]:
    """Name -> version of aobake, Python, Embree and the packages that results depend on.

    A package or an Embree that is missing is 'missing'; nothing is imported but Embree's interface.
    """
    found = {"aobake": __version__, "python": platform.python_version(), "embree": _embree()}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "missing"
    return found


def machine() -> str:
    """System and processor architecture, such as 'Linux x86_64'."""
    return f"{platform.system()} {platform.machine()}"


def processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cache_folder() -> str:
    """The folder that keeps compiled kernels, or that they are kept nowhere."""
    from aobake.tracing import kernels

    stats = getattr(kernels.trace, "stats", None)
    return getattr(stats, "cache_path", None) or "kept nowhere: compiled anew in each process"


def _embree() -> str:
    from aobake.tracing import embree

    try:
        return embree.version()
    except EngineError:
        return "missing"

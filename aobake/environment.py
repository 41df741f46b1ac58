"""What aobake runs on: versions and the machine, for reports and for questions."""

from __future__ import annotations

import functools
import importlib.metadata
import os
import platform

from aobake import __version__
from aobake.errors import EngineError

__all__ = ["cache_folder", "cache_warnings", "machine", "processors", "versions"]

PACKAGES = ("embreex", "numba", "numpy", "scipy", "trimesh", "DracoPy")


def versions() -> dict[str, str]:
    """Name -> version of aobake, Python, Embree and the packages that results depend on.

    A package or an Embree that is missing is 'missing'; nothing is imported but Embree's interface.
    """
    found = {"aobake": __version__, "python": platform.python_version(), "embree": _embree()}
    return found | {name: _version_of(name) for name in PACKAGES}


@functools.cache  # it takes 1 ms each, as long as a small bake
def _version_of(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "missing"


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
    from aobake.tracing import kept

    place = kept.folder()
    return "kept nowhere: compiled anew in each process" if place is None else str(place)


def cache_warnings() -> tuple[str, ...]:
    """One line where compiled kernels could not be kept, so that every run will be as slow as the first."""
    from aobake.tracing import kept

    problem = kept.problem()
    return () if problem is None else (problem,)


def _embree() -> str:
    from aobake.tracing import embree

    try:
        return embree.version()
    except EngineError:
        return "missing"

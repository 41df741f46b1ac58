"""The largest kernel, compiled in a process of its own while the first bake of all compiles the others.

numba compiles one kernel at a time in a process, so threads would not help. The bake waits for the kernel
if it needs it before it is there (claims.py); where the other process fails, the bake compiles by itself.
"""

from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np

from aobake.tracing.compiled import import_without_blas, is_kept
from aobake.tracing.estimate import processors
from aobake.tracing.origins import place_origins, scratch

__all__ = ["compile_ahead", "compile_origins"]


def compile_ahead() -> bool:
    """Start to compile the kernel that finds origins, where it is not on disk yet; whether that was done.

    Not on a single processor, where it would only take turns.
    """
    if processors() == 1 or not sys.executable or is_kept(place_origins):
        return False
    code = f"import gc; gc.disable(); from {__name__} import compile_origins; compile_origins()"
    try:
        started = subprocess.Popen(  # noqa: S603 - this Python, our own words
            [sys.executable, "-c", code],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        return False
    threading.Thread(target=started.wait, daemon=True).start()
    return True


def compile_origins() -> None:
    """Compile the kernel that finds origins for the types that every bake gives it, and keep it on disk."""
    import_without_blas()
    whole, rows = np.zeros(0, np.int64), np.zeros((0, 3))
    world = (
        np.zeros((0, 3), np.float32),
        np.zeros((0, 3), np.uint32),
        whole,
        whole,
        0,
        whole,
        np.zeros((0, 4)),
        np.zeros(0),
    )
    found = np.zeros((0, 3), np.float32), np.zeros(0, np.uint8)
    place_origins((0, 0), 0, world, rows, rows, scratch(), *found)

"""What the first bake of all has to compile is compiled in processes beside it.

numba compiles one kernel at a time in a process, so threads would not help. The bake waits for a kernel that is
being compiled elsewhere (tracing/claims.py); where another process fails, it compiles by itself.
"""

from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np

from aobake.config import Command
from aobake.meshes.scene import Attribute, Instance, Mesh, Scene
from aobake.tracing.compiled import Kernel, compile_alone
from aobake.tracing.estimate import processors
from aobake.tracing.origins import place_origins, scratch

__all__ = ["compile_ahead", "compile_for_texels", "compile_origins", "compile_unwrapping"]


def compile_ahead(command: Command) -> int:
    """Start to compile the most of what a command needs and is not on disk; in how many processes.

    Not on a single processor, where these would only take turns.
    """
    if processors() == 1 or not sys.executable:
        return 0
    if command == "vertex":
        return _started(place_origins, compile_origins.__name__)
    from aobake.atlas.flatten_kernels import flatten_pieces
    from aobake.atlas.raster_kernels import cover

    unwrapping = _started(flatten_pieces, compile_unwrapping.__name__)
    return unwrapping + _started(cover, compile_for_texels.__name__)


def _started(kernel: Kernel[..., None], function: str) -> bool:
    """Whether a process was started that calls a function of this module, unless the kernel is on disk."""
    if kernel.is_kept():
        return False
    code = f"import gc; gc.disable(); from {__name__} import {function}; {function}()"
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
    """Compile the kernel that finds origins for the types that every bake gives it: half of all for vertices."""
    compile_alone()
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


def compile_unwrapping() -> None:
    """Compile what lays surfaces flat and packs charts, by doing so with a square."""
    compile_alone()
    from aobake.atlas.packing import pack
    from aobake.atlas.unwrap import unwrap
    from aobake.settings import AtlasSettings

    settings = AtlasSettings(size=16)
    pack([(charts, 1.0) for charts in unwrap([_square()], settings)], settings)


def compile_for_texels() -> None:
    """Compile what bakes a texture, by doing so on a square that has texture coordinates."""
    compile_alone()
    from aobake.lightmaps import bake_texture
    from aobake.settings import BakeSettings

    compile_origins()
    bake_texture(
        Scene(meshes=(_square(),), instances=(Instance(mesh=0),)), BakeSettings(size=32, rays=1)
    )


def _square() -> Mesh:
    """A square with texture coordinates."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    return Mesh(
        vertices=corners,
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        attributes={"TEXCOORD_0": Attribute(values=corners[:, :2])},
    )

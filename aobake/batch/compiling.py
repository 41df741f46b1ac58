"""Kernels compiled before the time of a task counts: on a new machine that takes longer than most assets."""

from __future__ import annotations

import contextlib
import functools

import numpy as np

from aobake.batch.tasks import Task
from aobake.jobs import Command
from aobake.settings import BakeSettings

__all__ = ["compile_for"]

# What chooses kernels; other settings may ask for what the scene below does not have.
CHOOSING = (
    "tolerance", "tolerance_of", "max_distance", "falloff", "backfaces", "ground", "distribution", "spread",
    "bent_normals", "mean_distance", "method", "supersample", "denoise", "bent_space",
)  # fmt: skip
RAYS, TEXELS = 32, 96  # charts of fewer texels would not be denoised


def compile_for(task: Task) -> None:
    """Compile the kernels that a task needs, where they are not on disk yet.

    The way to find them all is to bake: two tetrahedra, one in the other, with the task's settings. Does
    nothing for a kind of task that this process has seen. What goes wrong is left for the task itself to say.
    """
    asked = task.job.chosen.bake
    chosen = {name: getattr(asked, name) for name in CHOOSING}
    settings = BakeSettings(**chosen, rays=RAYS, max_rays=RAYS, size=TEXELS)
    with contextlib.suppress(Exception):
        _bake_little(task.job.command, settings, shown=task.pictures != "none")


@functools.cache
def _bake_little(command: Command, settings: BakeSettings, *, shown: bool) -> None:
    from aobake import Mesh, Scene
    from aobake.bake import bake_vertices
    from aobake.batch.pictures import thumbnails
    from aobake.lightmaps import bake_texture

    # Normals that are given and normals that are not, and charts with seams.
    corners = np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)])
    outward = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)])
    meshes = [
        Mesh(vertices=corners, faces=outward, normals=corners / np.sqrt(3.0)),
        Mesh(vertices=2.0 * corners, faces=outward[:, ::-1].copy()),
    ]
    bake = bake_vertices if command == "vertex" else bake_texture
    baked = bake(Scene.from_meshes(meshes), settings)
    if shown:
        thumbnails(baked)

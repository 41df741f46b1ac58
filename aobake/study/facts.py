"""What is told beside every study: what was measured, where, and at what load."""

from __future__ import annotations

import os

from aobake import environment
from aobake.meshes.scene import Scene

__all__ = ["facts_of", "name_of_asset"]


def facts_of(scene: Scene, seeds: int) -> dict[str, object]:
    """The asset's size, how often everything was repeated, versions, the machine and its load."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {
        "triangles": scene.triangles,
        "instances": len(scene.instances),
        "seeds": seeds,
        "versions": environment.versions(),
        "machine": environment.machine(),
        "processors": environment.processors(),
        "load": load,
    }


def name_of_asset(scene: Scene) -> str:
    """The name of the file that a scene was read from; "scene" where there is none."""
    return scene.source.path.name if scene.source else "scene"

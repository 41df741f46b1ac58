"""All meshes of a scene as the tracer needs them, mended where that was asked for."""

from __future__ import annotations

from dataclasses import replace

from aobake.meshes.scene import Mesh, Scene
from aobake.meshes.surface import Surface, surface_of
from aobake.settings import TraceSettings

__all__ = ["surfaces_of"]


def surfaces_of(scene: Scene, settings: TraceSettings) -> list[Surface]:
    """One surface for each mesh, named in its findings as a user would name it.

    Raises EngineError where meshes are to be mended, and pymeshlab is missing.
    """
    look = _mended if settings.repair else _plain
    return [
        look(mesh, f"mesh {mesh.name!r}" if mesh.name else f"mesh {number}", settings)
        for number, mesh in enumerate(scene.meshes)
    ]


def _plain(mesh: Mesh, name: str, _: TraceSettings) -> Surface:
    return surface_of(mesh, name)


def _mended(mesh: Mesh, name: str, settings: TraceSettings) -> Surface:
    from aobake.meshes.repair import mended  # loads MeshLab, half a second

    found = mended(mesh, settings.max_hole, name)
    surface = surface_of(found.mesh, name)
    return replace(surface, findings=(*found.findings, *surface.findings))

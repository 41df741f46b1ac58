"""Effects of time: what moves is baked as it stands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aobake.planning.effect import Effect

if TYPE_CHECKING:
    from aobake.meshes.scene import Scene

__all__ = ["animation"]


def animation(scene: Scene) -> Effect:
    """On where the scene stands in a pose; else whatever can move is baked at rest, and the reason says so."""
    return Effect(scene.motion.pose is not None, str(scene.motion))

"""The plan of a bake: which effects a scene calls for, why, and at what cost.

This file imports neither numpy nor the tracer, so that `import aobake` stays light.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from aobake.settings import BakeSettings

if TYPE_CHECKING:
    from aobake.meshes.scene import Scene

__all__ = ["Effect", "Plan", "plan"]


@dataclass(frozen=True)
class Effect:
    """One thing that a bake can simulate.

    on : whether it is simulated
    reason : one sentence that says why, or why not
    cost : what it multiplies the seconds of tracing by, when on
    """

    on: bool
    reason: str
    cost: float = 1.0


@dataclass(frozen=True)
class Plan:
    """effects : name -> Effect, in the order in which they are explained."""

    effects: Mapping[str, Effect]


def plan(scene: Scene, settings: BakeSettings | None = None) -> Plan:
    """Decide which effects the scene calls for under these settings.

    Returns the plan; nothing is traced, and the scene is not changed.
    """
    settings = settings or BakeSettings()
    return Plan(
        {
            "occlusion": _occlusion(scene),
            "instances": _instances(scene),
            "max_distance": _max_distance(settings),
            "falloff": _falloff(settings),
            "backfaces": _backfaces(settings),
            "ground": _ground(settings),
        }
    )


def _occlusion(scene: Scene) -> Effect:
    if scene.triangles == 0:
        return Effect(False, "There is no triangle in the scene.")
    return Effect(True, f"{scene.triangles} triangles occlude each other.")


def _instances(scene: Scene) -> Effect:
    counts = Counter(instance.mesh for instance in scene.instances)
    shared = sorted(mesh for mesh, count in counts.items() if count > 1)
    if not shared:
        return Effect(False, "Every mesh stands in one place.")
    name = scene.meshes[shared[0]].name or f"number {shared[0]}"
    return Effect(
        True, f"{len(shared)} meshes stand in several places, mesh {name!r} among them.", 1.2
    )


def _max_distance(settings: BakeSettings) -> Effect:
    if settings.max_distance is None:
        return Effect(False, "No max_distance was asked for.")
    return Effect(True, f"max_distance is {settings.max_distance:g}.", 0.8)


def _falloff(settings: BakeSettings) -> Effect:
    if settings.falloff == "none":
        return Effect(False, "Occlusion does not fade with distance, so any hit settles a ray.")
    return Effect(True, f"falloff is {settings.falloff}, so the nearest hit is looked for.", 1.5)


def _backfaces(settings: BakeSettings) -> Effect:
    if settings.backfaces == "occlude":
        return Effect(False, "Surfaces occlude from both sides, so no hit has to be examined.")
    return Effect(True, "backfaces is ignore, so hits from behind are passed through.", 1.4)


def _ground(settings: BakeSettings) -> Effect:
    if settings.ground is None:
        return Effect(False, "No ground was asked for.")
    return Effect(True, f"A ground lies under the scene, {settings.ground} is up.")

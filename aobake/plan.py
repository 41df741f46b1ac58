"""The plan of a bake: which effects a scene calls for, why, and at what cost.

This file imports neither numpy nor the tracer, so that `import aobake` stays light.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from aobake.errors import SettingsError
from aobake.overrides import forced
from aobake.planning.directions import direction_effects
from aobake.planning.effect import Effect, Plan
from aobake.planning.motion import animation
from aobake.planning.occluders import occluder_effects
from aobake.planning.surfaces import texture_effects, vertex_effects
from aobake.settings import BakeSettings

if TYPE_CHECKING:
    from aobake.meshes.scene import Scene

__all__ = ["Effect", "Plan", "plan", "texture_plan"]


def plan(scene: Scene, settings: BakeSettings | None = None) -> Plan:
    """Decide which effects the scene calls for under these settings, for a bake to vertices.

    Returns the plan; nothing is traced, and the scene is not changed.
    Raises SettingsError where settings name what is not in the scene.
    """
    settings = _settled(scene, settings)
    effects = {**occluder_effects(scene, settings), **_shared(scene, settings)}
    return _explained({**effects, **vertex_effects(scene, settings)}, settings)


def texture_plan(scene: Scene, settings: BakeSettings | None = None) -> Plan:
    """The same for a bake to a texture, which has no place for mean distances: SettingsError."""
    if settings is not None and settings.mean_distance:
        raise SettingsError(
            "mean_distance is kept at vertices. In a texture, bake with max_distance and falloff linear: its values "
            "times max_distance are the mean distances."
        )
    settings = _settled(scene, settings)
    effects = {**occluder_effects(scene, settings), **_shared(scene, settings)}
    effects["sharing"] = Effect(
        False, "Texels of each placement lie elsewhere, and are all traced."
    )
    return _explained({**effects, **texture_effects(scene, settings)}, settings)


def _settled(scene: Scene, settings: BakeSettings | None) -> BakeSettings:
    from aobake.prepare import in_scene_units

    return in_scene_units(scene, settings or BakeSettings())


def _shared(scene: Scene, settings: BakeSettings) -> Mapping[str, Effect]:
    return {**direction_effects(settings), "animation": animation(scene)}


def _explained(effects: dict[str, Effect], settings: BakeSettings) -> Plan:
    """The plan, in which effects that were switched by hand say so."""
    for name in forced(settings.effect):
        if name in effects:
            words = f"{effects[name].reason} (Switched by hand.)"
            effects[name] = replace(effects[name], reason=words, forced=True)
    return Plan(effects)

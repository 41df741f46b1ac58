"""Effects of where rays go, how hits count, and what else is kept of them."""

from __future__ import annotations

from collections.abc import Mapping

from aobake.planning.effect import Effect
from aobake.settings import BakeSettings

__all__ = ["direction_effects"]

# What tracing is multiplied by on a scan, by benchmarks/effects.py: a limit of a tenth of its size, a cone of 100
# degrees. Rays that end early are cheap, and rays along the surface, of which uniform sets have more, are dear.
UNIFORM, CONE, LIMITED, NEAREST, GROUND, BENT = 1.2, 0.75, 0.9, 1.35, 0.75, 1.05


def direction_effects(settings: BakeSettings) -> Mapping[str, Effect]:
    """name -> Effect, from the settings alone."""
    return {
        "distribution": _distribution(settings),
        "spread": _spread(settings),
        "max_distance": _max_distance(settings),
        "falloff": _falloff(settings),
        "ground": _ground(settings),
        "bent_normals": _bent_normals(settings),
        "mean_distance": _mean_distance(settings),
    }


def _distribution(settings: BakeSettings) -> Effect:
    if settings.distribution == "cosine":
        return Effect(
            False, "Directions count by the cosine to the normal, as light does.", UNIFORM
        )
    return Effect(True, "distribution is uniform, so all directions count alike.", UNIFORM)


def _spread(settings: BakeSettings) -> Effect:
    if settings.spread == 180.0:
        return Effect(False, "Directions are those of the whole hemisphere.", CONE)
    return Effect(True, f"Directions are those of a cone of {settings.spread:g} degrees.", CONE)


def _max_distance(settings: BakeSettings) -> Effect:
    if settings.max_distance is None:
        return Effect(False, "No max_distance was asked for.", LIMITED)
    return Effect(True, f"max_distance is {settings.max_distance:g}.", LIMITED)


def _falloff(settings: BakeSettings) -> Effect:
    if settings.falloff == "none":
        return Effect(
            False, "Occlusion does not fade with distance, so any hit settles a ray.", NEAREST
        )
    return Effect(
        True, f"falloff is {settings.falloff}, so the nearest hit is looked for.", NEAREST
    )


def _ground(settings: BakeSettings) -> Effect:
    if settings.ground is None:
        return Effect(False, "No ground was asked for.", GROUND)
    return Effect(True, f"A ground lies under the scene, {settings.ground} is up.", GROUND)


def _bent_normals(settings: BakeSettings) -> Effect:
    if not settings.bent_normals:
        return Effect(False, "Bent normals were not asked for.", BENT)
    return Effect(True, "The mean open direction is kept, from the same rays.", BENT)


def _mean_distance(settings: BakeSettings) -> Effect:
    cost = NEAREST if settings.falloff == "none" else 1.0
    if not settings.mean_distance:
        return Effect(False, "Mean distances were not asked for.", cost)
    return Effect(True, "The mean distance of the nearest hits is kept, from the same rays.", cost)

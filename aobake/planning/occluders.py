"""Effects of what is in a scene: who occludes whom, from which side, through which holes, and how often."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from aobake.overrides import forced
from aobake.planning.effect import Effect
from aobake.settings import BakeSettings

if TYPE_CHECKING:
    from aobake.meshes.scene import Scene

__all__ = ["occluder_effects"]

# What tracing is multiplied by: benchmarks/cutouts.py and benchmarks/effects.py.
ALPHA_COST, FILTER_COST, INSTANCE_COST = 1.45, 1.2, 1.1


def occluder_effects(scene: Scene, settings: BakeSettings) -> Mapping[str, Effect]:
    """name -> Effect. Raises SettingsError where occluders or exclude name what is not there."""
    return {
        "occlusion": _occlusion(scene),
        "open_sky": _open_sky(settings),
        "occluders": _occluders(scene, settings),
        "exclude": _exclude(scene, settings),
        "instances": _instances(scene),
        "sharing": _sharing(scene, settings),
        "alpha": _alpha(scene, settings),
        "backfaces": _backfaces(scene, settings),
    }


def _named(kind: str, name: str, number: int) -> str:
    return f"{kind} {name!r}" if name else f"{kind} {number}"


def _occlusion(scene: Scene) -> Effect:
    if scene.triangles == 0:
        return Effect(False, "There is no triangle in the scene.")
    if len(scene.instances) == 1:
        return Effect(True, f"{scene.triangles} triangles occlude each other.")
    number, most = max(enumerate(scene.placed()), key=lambda entry: len(entry[1][1].faces))
    instance, mesh = most
    name = instance.name or mesh.name
    return Effect(
        True,
        f"{scene.triangles} triangles in {len(scene.instances)} places occlude each other, "
        f"{len(mesh.faces)} of them in {_named('instance', name, number)}.",
    )


def _open_sky(settings: BakeSettings) -> Effect:
    chosen = forced(settings.effect).get("open_sky")
    if settings.ground is not None:
        return Effect(False, "A ground lies under the scene, which most points see.")
    if chosen is False:
        return Effect(False, "Every point is traced, also where everything lies below it.")
    if chosen:
        return Effect(True, "Points that everything lies below are 1 without a ray.")
    return Effect(
        True, "Points that everything lies below are 1 without a ray, if a sample has enough."
    )


def _occluders(scene: Scene, settings: BakeSettings) -> Effect:
    from aobake.occluders import alone

    if settings.occluders == ("all",):
        return Effect(False, "Every object occludes every other one.")
    if alone(settings):
        return Effect(True, "Each object is occluded by itself alone.")
    first = settings.occluders[0]
    count = _standing_out(scene, settings, exclude=())
    return Effect(True, f"{count} of {len(scene.instances)} objects occlude, {first!r} among them.")


def _exclude(scene: Scene, settings: BakeSettings) -> Effect:
    if not settings.exclude:
        return Effect(False, "No object is kept from occluding.")
    before = _standing_out(scene, settings, exclude=())
    count = before - _standing_out(scene, settings, exclude=settings.exclude)
    first = settings.exclude[0]
    return Effect(
        True,
        f"{count} of {len(scene.instances)} objects are kept from occluding, {first!r} among them.",
    )


def _standing_out(scene: Scene, settings: BakeSettings, exclude: Sequence[str]) -> int:
    """How many instances occlude anything."""
    from dataclasses import replace

    from aobake.occluders import occluding

    return int(occluding(scene, replace(settings, exclude=tuple(exclude))).sum())


def _several(scene: Scene) -> list[int]:
    """Meshes that stand in several places."""
    counts = Counter(instance.mesh for instance in scene.instances)
    return sorted(mesh for mesh, count in counts.items() if count > 1)


def _instances(scene: Scene) -> Effect:
    shared = _several(scene)
    if not shared:
        return Effect(False, "Every mesh stands in one place.", INSTANCE_COST)
    name = _named("mesh", scene.meshes[shared[0]].name, shared[0])
    return Effect(
        True, f"{len(shared)} meshes stand in several places, {name} among them.", INSTANCE_COST
    )


def _sharing(scene: Scene, settings: BakeSettings) -> Effect:
    """On where some placements provably have the values of others."""
    if not _several(scene):
        return Effect(False, "Every mesh stands in one place.")
    if forced(settings.effect).get("sharing") is False:
        return Effect(False, "Every placement is traced, also where others must look the same.")
    from aobake.sharing import first_alike

    alike = first_alike(scene, settings, _lowest(scene, settings)).tolist()
    copies = [number for number, first in enumerate(alike) if first != number]
    if not copies:
        return Effect(False, "No two placements provably have the same surroundings.")
    mesh = scene.instances[copies[0]].mesh
    name = _named("mesh", scene.meshes[mesh].name, mesh)
    return Effect(
        True,
        f"{len(copies)} placements copy others that nothing else occludes either, {name} among them.",
        1.0
        - sum(len(scene.meshes[scene.instances[n].mesh].vertices) for n in copies)
        / max(1, scene.vertices),
    )


def _lowest(scene: Scene, settings: BakeSettings) -> float | None:
    if settings.ground is None:
        return None
    from aobake.meshes.extent import boxes

    return float(boxes(scene)[:, 0, "xyz".index(settings.ground[1])].min(initial=float("inf")))


def _alpha(scene: Scene, settings: BakeSettings) -> Effect:
    see_through = [m for m in scene.materials if m.alpha_mode != "OPAQUE"]
    if not see_through:
        return Effect(False, "Every material is opaque.", ALPHA_COST)
    if forced(settings.effect).get("alpha") is False:
        name = see_through[0].name
        return Effect(False, f"Everything counts as opaque, also material {name!r}.", ALPHA_COST)
    from aobake.meshes.alpha import alpha_of

    uses = sorted(alpha_of(scene), key=lambda use: (not use.on, -use.share_transparent))
    reason = uses[0].reason[:1].upper() + uses[0].reason[1:]
    more = sum(use.on for use in uses) - 1
    if more > 0:
        reason = f"{reason[:-1]}; {more} more are see-through."
    return Effect(uses[0].on, reason, ALPHA_COST)


def _backfaces(scene: Scene, settings: BakeSettings) -> Effect:
    if settings.backfaces == "occlude":
        return Effect(
            False, "Surfaces occlude from both sides, so no hit has to be examined.", FILTER_COST
        )
    one_sided = [
        (number, mesh)
        for number, mesh in enumerate(scene.meshes)
        if mesh.material is None or not scene.materials[mesh.material].double_sided
    ]
    if not one_sided:
        return Effect(False, "Every material is double-sided, so nothing has a back.", FILTER_COST)
    number, mesh = one_sided[0]
    return Effect(
        True,
        f"Hits from behind are passed through on {len(one_sided)} meshes, "
        f"{_named('mesh', mesh.name, number)} among them.",
        FILTER_COST,
    )

"""One shot: samples of pixel rows through every layer of surfaces, lit, and averaged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.render_settings import RenderSettings
from aobake.shading.camera import View, rays
from aobake.shading.columns import add_at, dot, some
from aobake.shading.ground import Ground, across, openness
from aobake.shading.lights import Lamp, arriving
from aobake.shading.lobes import Lobes, ambient_reflected, reflected
from aobake.shading.materials import Appearance, Look, appearance
from aobake.shading.seen import Seen, seen
from aobake.shading.stage import Stage
from aobake.shading.surroundings import PAST
from aobake.tracing.primary import nearest_hits, reach

__all__ = ["Shot", "shoot"]

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]

LAYERS = 24  # of see-through surfaces, one behind the other
LEAST = 1.0 / 512.0  # transmittance below which nothing behind shows in 8 bits
WHITE_ERROR = 0.02  # standard error that the channel error shows as white
SHORT_OF_LAMP = 1.0 - 1e-4


@dataclass(frozen=True, eq=False, kw_only=True)
class Shot:
    """Everything that a picture is made from. size : width, height; places : (S, 2) samples in a pixel."""

    stage: Stage
    look: Look
    lobes: Lobes
    lamps: tuple[Lamp, ...]
    view: View
    ground: Ground | None
    size: tuple[int, int]
    places: FloatArray
    settings: RenderSettings


def shoot(shot: Shot, rows: range) -> Float32Array:
    """(rows, W, 4) float32: linear light times alpha, and alpha."""
    origins, directions = rays(shot.view, shot.stage.frame, shot.size, rows, shot.places)
    light, left = _through_surfaces(shot, origins, directions)
    if shot.ground is not None:
        left *= _ground_left(shot, shot.ground, origins, directions, left)
    shape = (len(rows), len(shot.places), shot.size[0])
    pixels = np.empty((len(rows), shot.size[0], 4), np.float32)
    pixels[..., :3] = np.moveaxis(light.reshape(3, *shape).mean(axis=2), 0, -1)
    pixels[..., 3] = 1.0 - left.reshape(shape).mean(axis=1)
    return pixels


def _through_surfaces(
    shot: Shot, origins: Float32Array, directions: Float32Array
) -> tuple[Float32Array, Float32Array]:
    """(3, N) light along rays, and (N,) how much of what is behind shows through."""
    light, left = np.zeros_like(origins), np.ones(origins.shape[1], np.float32)
    active, near = np.arange(len(left)), np.zeros(len(left), np.float32)
    for _ in range(LAYERS):
        hits = nearest_hits(shot.stage.tree, some(origins, active), some(directions, active), near)
        met = np.flatnonzero(hits.thing >= 0)
        if len(met) == 0:
            break
        active, hits = active[met], hits.only(met)
        points = seen(shot.stage, hits, some(directions, active))
        looks = appearance(shot.look, points)
        shown = _shown(shot, points, looks, some(directions, active))
        add_at(light, active, (left[active] * looks.alpha) * shown)
        left[active] *= 1.0 - looks.alpha
        going = np.flatnonzero(left[active] > LEAST)
        active, near = active[going], hits.distance[going] * np.float32(PAST)
    return light, left


def _shown(shot: Shot, points: Seen, looks: Appearance, directions: Float32Array) -> Float32Array:
    """(3, N) what the channel shows of points."""
    match shot.settings.channel:
        case "ao":
            return np.broadcast_to(looks.ao, points.normal.shape)
        case "normal":
            return np.asarray(0.5 * points.normal + 0.5, np.float32)
        case "albedo":
            return looks.albedo
        case "bent-normal" if looks.bent is not None:
            return np.asarray(0.5 * looks.bent + 0.5, np.float32)
        case "error":
            scaled = np.clip(looks.error / np.float32(WHITE_ERROR), 0.0, 1.0)
            return np.broadcast_to(scaled, points.normal.shape)
        case _:
            return _lit(shot, points, looks, directions)


def _lit(shot: Shot, points: Seen, looks: Appearance, directions: Float32Array) -> Float32Array:
    """(3, N) the lighting model."""
    view, settings = -directions, shot.settings
    ao = np.ones_like(looks.ao) if settings.ao == "none" else looks.ao
    share = ambient_reflected(
        shot.lobes, ao, points.normal, view, looks.albedo, bounces=settings.multi_bounce
    )
    result = np.float32(settings.ambient) * share + looks.emitted
    for lamp in shot.lamps:
        light = arriving(lamp, points.origin, shot.stage.frame)
        facing = dot(points.normal, light.directions)
        lit = np.flatnonzero((facing > 0.0) & (light.irradiance.max(axis=0) > 0.0))
        to_lamp, origins = some(light.directions, lit), some(points.origin, lit)
        arrived = facing[lit] * some(light.irradiance, lit)
        if not settings.no_shadows:
            arrived = arrived * _unblocked(shot, origins, to_lamp, light.distance[lit])
        albedo, normal = some(looks.albedo, lit), some(points.normal, lit)
        back = reflected(shot.lobes, normal, to_lamp, some(view, lit), albedo)
        add_at(result, lit, arrived * back)
    return result


def _unblocked(
    shot: Shot, origins: Float32Array, directions: Float32Array, distance: Float32Array
) -> Float32Array:
    """(N,) how much light gets from the lamp to points."""
    far = distance * np.float32(SHORT_OF_LAMP)
    if not shot.look.see_through:
        free = reach(shot.stage.tree, origins, directions, far)
        return free.astype(np.float32)
    left = np.ones(len(far), np.float32)
    active, near = np.arange(len(left)), np.zeros(len(left), np.float32)
    for _ in range(LAYERS):
        hits = nearest_hits(shot.stage.tree, some(origins, active), some(directions, active), near)
        met = np.flatnonzero((hits.thing >= 0) & (hits.distance < far[active]))
        if len(met) == 0:
            break
        active, hits = active[met], hits.only(met)
        points = seen(shot.stage, hits, some(directions, active))
        left[active] *= 1.0 - appearance(shot.look, points).alpha
        going = np.flatnonzero(left[active] > LEAST)
        active, near = active[going], hits.distance[going] * np.float32(PAST)
    return left


def _ground_left(
    shot: Shot,
    ground: Ground,
    origins: Float32Array,
    directions: Float32Array,
    left: Float32Array,
) -> Float32Array:
    """(N,) how much of the background's light is left on the ground, where rays that are left meet it."""
    result = np.ones(len(left), np.float32)
    going = np.flatnonzero(left > LEAST)
    met, points = across(ground, some(origins, going), some(directions, going))
    ambient = np.float32(shot.settings.ambient)
    occlusion = 1.0 if shot.settings.ao == "none" else openness(ground, points)
    got, most = ambient * occlusion + np.zeros(len(met), np.float32), np.full(len(met), ambient)
    for lamp in shot.lamps:
        light = arriving(lamp, points, shot.stage.frame)
        facing = np.maximum(light.directions[ground.axis], 0.0) / np.float32(np.pi)
        full = facing * light.irradiance.mean(axis=0)
        lit = np.flatnonzero(full > 0.0)
        most += full
        if not shot.settings.no_shadows:
            full[lit] *= _unblocked(
                shot, some(points, lit), some(light.directions, lit), light.distance[lit]
            )
        got += full
    result[going[met]] = np.where(most > 0.0, got / np.maximum(most, 1e-20), 1.0)
    return result

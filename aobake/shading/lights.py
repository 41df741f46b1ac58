"""Lights: where they are seen from a point, and how much of them arrives there.

Irradiance is measured across the light's own direction; E = pi makes a white Lambertian surface that faces
it as bright as white. Attenuation and cones follow the glTF extension KHR_lights_punctual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.scene import Light, LightKind
from aobake.shading.columns import dot
from aobake.tracing.conditioning import UnitFrame

__all__ = ["Arriving", "Lamp", "arriving", "balanced", "key_light", "lamps_of"]

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]

OVER_THE_SHOULDER = (-0.55, 0.75, 0.65)  # right, up and backward of the camera
BRIGHT = 0.9  # quantile of what is lit that is brought to the wanted irradiance
LEAST_CONE = 1e-4


@dataclass(frozen=True, eq=False, kw_only=True)
class Lamp:
    """A light in the scene's space.

    position, direction : (3,) float64; unit direction that it shines along, zero for a point
    color : (3,) float64, linear, intensity included
    """

    kind: LightKind
    position: FloatArray
    direction: FloatArray
    color: FloatArray
    range: float = np.inf
    cone_cosines: tuple[float, float] = (1.0, -1.0)


@dataclass(frozen=True, eq=False)
class Arriving:
    """Light at N points: unit directions to it (3, N), irradiance (3, N), distance (N,), all float32."""

    directions: Float32Array
    irradiance: Float32Array
    distance: Float32Array


def key_light(axes: FloatArray, irradiance: float) -> Lamp:
    """A directional light over the left shoulder of a camera with these axes."""
    towards = np.array(OVER_THE_SHOULDER) @ axes
    return Lamp(
        kind="directional",
        position=np.zeros(3),
        direction=-towards / np.linalg.norm(towards),
        color=np.full(3, irradiance),
    )


def lamps_of(lights: Sequence[Light]) -> tuple[Lamp, ...]:
    """The lights of a file, without those that are dark or have no place."""
    lamps = []
    for light in lights:
        color = np.array(light.color, np.float64) * light.intensity
        direction = -light.transform[:3, 2]
        length = float(np.linalg.norm(direction))
        if not (np.isfinite(light.transform).all() and np.isfinite(color).all() and length > 0.0):
            continue
        if (color > 0.0).any():
            lamps.append(
                Lamp(
                    kind=light.kind,
                    position=light.transform[:3, 3],
                    direction=direction / length,
                    color=np.maximum(color, 0.0),
                    range=np.inf if light.range is None else light.range,
                    cone_cosines=(
                        float(np.cos(light.cone_rad[0])),
                        float(np.cos(light.cone_rad[1])),
                    ),
                )
            )
    return tuple(lamps)


def arriving(lamp: Lamp, points: Float32Array, frame: UnitFrame) -> Arriving:
    """The light of a lamp at points (3, N), in units of the frame; nothing is in its way."""
    count = points.shape[1]
    if lamp.kind == "directional":
        directions = np.broadcast_to((-lamp.direction).astype(np.float32)[:, None], (3, count))
        irradiance = np.broadcast_to(lamp.color.astype(np.float32)[:, None], (3, count))
        return Arriving(directions, irradiance, np.full(count, np.inf, np.float32))
    to_lamp = frame.apply(lamp.position[None]).astype(np.float32).reshape(3, 1) - points
    distance = np.sqrt(dot(to_lamp, to_lamp))
    safe = np.maximum(distance, np.float32(1e-20))
    towards = np.asarray(to_lamp / safe, np.float32)
    length = safe / np.float32(frame.scale)
    faded = np.clip(1.0 - (length / np.float32(lamp.range)) ** 4, 0.0, 1.0) / length**2
    if lamp.kind == "spot":
        inner, outer = lamp.cone_cosines
        cosine = -dot(towards, lamp.direction.astype(np.float32)[:, None])
        within = (cosine - outer) / max(inner - outer, LEAST_CONE)
        faded = faded * np.clip(within, 0.0, 1.0) ** 2
    arrived = np.asarray(faded * lamp.color.astype(np.float32)[:, None], np.float32)
    return Arriving(towards, arrived, distance)


def balanced(
    lamps: Sequence[Lamp],
    points: Float32Array,
    normals: Float32Array,
    frame: UnitFrame,
    wanted: float,
) -> float:
    """What to multiply the lamps by, so that the well-lit ones of points (3, N) get the wanted irradiance.

    Files give intensities in candela, in lux, and in whatever an exporter made of them. 1 where the
    lamps reach none of the points.
    """
    total = np.zeros(points.shape[1], np.float32)
    for lamp in lamps:
        light = arriving(lamp, points, frame)
        facing = np.maximum(dot(normals, light.directions), 0.0)
        total += facing * light.irradiance.max(axis=0)
    lit = total[total > 0.0]
    return wanted / float(np.quantile(lit, BRIGHT)) if len(lit) else 1.0

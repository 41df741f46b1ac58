"""What the rays of a picture hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.shading.stage import Stage
from aobake.tracing.landing import land, scratch
from aobake.tracing.primary import Hits

__all__ = ["Seen", "seen"]

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False, kw_only=True)
class Seen:
    """Points of surfaces, in the space of the tree.

    instance : (N,) int64 of the scene; face : (N,) int32 of its mesh
    weights : (3, N) float32, of the three corners
    normal : (3, N) float32 unit vectors, interpolated, on the side that is looked at
    origin : (3, N) float32, where rays to the lights start
    front : (N,) bool, whether the front is looked at
    """

    instance: NDArray[np.int64]
    face: NDArray[np.int32]
    weights: Float32Array
    normal: Float32Array
    origin: Float32Array
    front: NDArray[np.bool_]


def seen(stage: Stage, hits: Hits, directions: Float32Array) -> Seen:
    """The points that rays hit.

    hits : (N,) all of them true hits; directions : (3, N) float32 of the rays
    """
    count = len(hits.thing)
    normal, origin = np.empty((3, count), np.float32), np.empty((3, count), np.float32)
    front = np.empty(count, bool)
    land(
        (stage.vertices, stage.normals, stage.faces),
        (stage.first_face, stage.fixed, stage.columns.reshape(-1, 3), stage.shift, stage.sharp),
        (hits.thing, hits.face, hits.weights),
        np.ascontiguousarray(directions),
        scratch(),
        normal,
        origin,
        front,
    )
    return Seen(
        instance=stage.instance[hits.thing],
        face=hits.face,
        weights=hits.weights,
        normal=normal,
        origin=origin,
        front=front,
    )

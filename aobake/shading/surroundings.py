"""Where a camera is: in the open, or inside of something."""

from __future__ import annotations

import numpy as np

from aobake.shading.camera import View
from aobake.shading.seen import seen
from aobake.shading.stage import Stage
from aobake.tracing.primary import nearest_hits
from aobake.tracing.sampling import vogel_disc

__all__ = ["PAST", "is_inside"]

DIRECTIONS, LAYERS = 32, 64
PAST = 1.0 + 2.0**-20  # a ray goes on this far behind what it met


def is_inside(stage: Stage, view: View) -> bool:
    """Whether the camera stands inside of a closed surface that looks outward.

    Then most rays from it leave more surfaces through their backs than they enter.
    """
    if view.orthographic:
        return False
    disc = vogel_disc(DIRECTIONS, 0.5)
    height = np.sqrt(np.maximum(0.0, 1.0 - (disc**2).sum(axis=1)))
    upper = np.column_stack([disc, height])
    directions = np.concatenate([upper, -upper]).T.astype(np.float32)
    count = directions.shape[1]
    at = stage.frame.apply(view.position[None]).astype(np.float32).reshape(3, 1)
    origins = np.repeat(at, count, axis=1)
    left, net = np.arange(count), np.zeros(count, np.int64)
    near = np.zeros(count, np.float32)
    for _ in range(LAYERS):
        hits = nearest_hits(stage.tree, origins[:, left], directions[:, left], near)
        met = np.flatnonzero(hits.thing >= 0)
        if len(met) == 0:
            break
        left = left[met]
        points = seen(stage, hits.only(met), directions[:, left])
        net[left] += np.where(points.front, -1, 1)
        near = hits.distance[met] * np.float32(PAST)
    return bool((net > 0).mean() > 0.9)

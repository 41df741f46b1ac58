"""Which directions count, and how much: sets over the hemisphere, drawn together into other lobes.

A set is spread evenly over the unit disc and lifted from there (sampling.py). Another lobe that is round
about the normal only lifts it in another way: equal areas of the disc become equal shares of the lobe, so
the set stays as even as it was, and in the same order.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aobake.settings import Distribution

__all__ = ["lobed"]


def lobed(
    sets: NDArray[np.float32], distribution: Distribution, spread: float
) -> NDArray[np.float32]:
    """Direction sets for a lobe; the very same ones for the hemisphere weighted by the cosine.

    sets : in the form of sampling.direction_sets
    distribution : how directions count within the cone; spread : its full opening angle in degrees
    Source: P. Shirley, K. Chiu, A low distortion map between disk and square, JGT 2(3), 1997, for the lifts.
    """
    if distribution == "cosine" and spread == 180.0:
        return sets
    disc = sets[:, :, :2, :].astype(np.float64)
    area = np.minimum(np.square(disc).sum(axis=2, keepdims=True), 1.0)
    half = math.radians(spread) / 2.0
    if distribution == "cosine":
        widen = np.full_like(area, math.sin(half))
        height = np.sqrt(1.0 - area * math.sin(half) ** 2)
    else:
        cap = 2.0 * math.sin(half / 2.0) ** 2  # 1 - cos(half), also where that would round to 0
        height = 1.0 - area * cap
        widen = np.sqrt(cap * (1.0 + height))
    found = np.concatenate([disc * widen, height], axis=2).astype(np.float32)
    found.flags.writeable = False
    return found

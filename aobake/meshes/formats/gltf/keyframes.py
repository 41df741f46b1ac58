"""Keyframes: the value of an animated property at a moment, between the moments that are stored.

Source: glTF 2.0, appendix C.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Interpolation", "Keyframes", "Mix", "lerp", "slerp", "value_at"]

FloatArray = NDArray[np.float64]
Interpolation = Literal["LINEAR", "STEP", "CUBICSPLINE"]
Mix: TypeAlias = Callable[[FloatArray, FloatArray, float], FloatArray]


@dataclass(frozen=True, eq=False)
class Keyframes:
    """A property at some moments, and how it gets from each to the next.

    times : (K,) float64 seconds, one at least, none before the one in front of it
    values : (K, n) float64; for CUBICSPLINE (K, 3, n): slope before, value, slope after, slopes per second
    """

    times: FloatArray
    values: FloatArray
    interpolation: Interpolation


def value_at(keys: Keyframes, seconds: float, mix: Mix) -> FloatArray:
    """(n,) value at a moment; that of the first key before it, that of the last one after it.

    mix : how LINEAR goes from one value to the next: lerp, or slerp for rotations
    """
    times = keys.times
    before = int(np.searchsorted(times, seconds, side="right")) - 1
    if before < 0 or before == len(times) - 1 or keys.interpolation == "STEP":
        return _stored(keys, max(before, 0))
    span = float(times[before + 1] - times[before])
    share = (seconds - float(times[before])) / span
    if keys.interpolation == "LINEAR":
        return mix(_stored(keys, before), _stored(keys, before + 1), share)
    slopes = span * keys.values[before, 2], span * keys.values[before + 1, 0]
    return _hermite(_stored(keys, before), _stored(keys, before + 1), slopes, share)


def _stored(keys: Keyframes, number: int) -> FloatArray:
    row: FloatArray = keys.values[number]
    return row[1] if keys.interpolation == "CUBICSPLINE" else row


def lerp(a: FloatArray, b: FloatArray, share: float) -> FloatArray:
    """(n,) on the straight line from a to b; share 0 gives a, 1 gives b."""
    return (1.0 - share) * a + share * b


def slerp(a: FloatArray, b: FloatArray, share: float) -> FloatArray:
    """(4,) unit quaternion on the shorter of the two turns from a to b, at constant speed.

    a, b : (4,) of any length; share 0 gives the rotation a, 1 gives b
    Source: K. Shoemake, Animating rotation with quaternion curves, 1985.
    """
    a, b = _unit(a), _unit(b)
    b = -b if float(a @ b) < 0.0 else b
    # The arc tangent keeps its digits for the small turns between keys; acos(a @ b) would not.
    angle = 2.0 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b))
    if angle == 0.0:
        return a
    start, end = np.sin((1.0 - share) * angle), np.sin(share * angle)
    turned: FloatArray = (start * a + end * b) / np.sin(angle)
    return turned


def _unit(rotation: FloatArray) -> FloatArray:
    length = np.linalg.norm(rotation)
    return rotation / length if length > 0.0 else np.array((0.0, 0.0, 0.0, 1.0))


def _hermite(
    a: FloatArray, b: FloatArray, slopes: tuple[FloatArray, FloatArray], share: float
) -> FloatArray:
    """The cubic from a to b whose slopes there are given, per whole span."""
    s, t = share, 1.0 - share
    ends = (1.0 + 2.0 * s) * t * t * a + (1.0 + 2.0 * t) * s * s * b
    return ends + s * t * (t * slopes[0] - s * slopes[1])

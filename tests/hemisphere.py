"""Directions and integrals over the hemisphere of +z, for tests of the local models."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["UP", "albedo", "direction", "rule", "unit"]

FloatArray = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


def unit(vectors: ArrayLike) -> FloatArray:
    """(..., 3) vectors, divided by their lengths."""
    array = np.asarray(vectors, np.float64)
    return np.asarray(array / np.linalg.norm(array, axis=-1, keepdims=True))


def direction(theta: ArrayLike, phi: ArrayLike = 0.0) -> FloatArray:
    """(..., 3) unit vectors at the angle theta to +z and the azimuth phi, in degrees."""
    t, p = np.broadcast_arrays(np.radians(theta), np.radians(phi))
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)


def rule(rings: int, sectors: int) -> tuple[FloatArray, FloatArray]:
    """Directions (N, 3) and weights (N,) whose sum of weight * f is the integral of f cos over the hemisphere.

    Gauss and Legendre over the angle, the midpoint rule over the azimuth.
    """
    nodes, weights = _legendre(rings)
    theta = np.pi / 4 * (nodes + 1.0)
    ring = np.pi / 4 * weights * np.sin(theta) * np.cos(theta) * (2.0 * np.pi / sectors)
    turn = (np.arange(sectors) + 0.5) * (360.0 / sectors)
    grid = direction(np.degrees(theta)[:, None], turn[None, :])
    return grid.reshape(-1, 3), np.repeat(ring, sectors)


@functools.cache
def _legendre(count: int) -> tuple[FloatArray, FloatArray]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return nodes, weights


def albedo(
    brdf: Callable[[FloatArray, FloatArray, FloatArray], ArrayLike],
    theta: float,
    rings: int = 200,
    sectors: int = 200,
) -> float:
    """The share of the light from the angle theta, in degrees, that a surface gives back."""
    around, weights = rule(rings, sectors)
    return float((np.asarray(brdf(UP, direction(theta), around)) * weights).sum())

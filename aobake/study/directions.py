"""Sets of directions to compare with the ones that a bake uses. For studies only.

Sources: M. Roberts, The unreasonable effectiveness of quasirandom sequences, 2018 (R2); I. Sobol', 1967,
scrambled as in A. Owen, 1995; J. Hammersley, 1960; the concentric map: P. Shirley, K. Chiu, 1997; lattices that
grow: R. Cools, F. Kuo, D. Nuyens, Constructing embedded lattice rules for multivariate integration, SIAM Journal on
Scientific Computing 28, 2006.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.sampling import SETS, packets_of, vogel_disc

__all__ = ["KINDS", "compared_sets"]

FloatArray = NDArray[np.float64]

RANDOM_SETS = 64  # more, for what differs from set to set without a pattern
PLASTIC = 1.32471795724474602596
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
# Of the multipliers that keep, for 32 to 2^20 points, the largest least distance on all rings of the disc.
MULTIPLIER = 444_633

KINDS = (
    "random",
    "R2",
    "Sobol'",
    "Hammersley",
    "Hammersley, polar",
    "Fibonacci",
    "growing spiral",
    "Vogel spiral",
)


def compared_sets(kind: str, count: int) -> NDArray[np.float32]:
    """Sets of `count` directions of a kind, in the form of sampling.direction_sets.

    kind : one of KINDS; those on the square take the concentric map unless they say polar
    count : a power of two
    """
    return packets_of([_disc(kind, count, number) for number in range(_sets(kind))])


def _sets(kind: str) -> int:
    return RANDOM_SETS if kind in {"random", "Sobol'", "R2"} else SETS


def _disc(kind: str, count: int, number: int) -> FloatArray:
    k = np.arange(count)
    rng = np.random.default_rng([count, number])
    match kind:
        case "random":
            return _concentric(rng.random((count, 2)))
        case "R2":
            steps = np.array([1.0 / PLASTIC, 1.0 / PLASTIC**2])
            return _concentric((rng.random(2) + k[:, None] * steps) % 1.0)
        case "Sobol'":
            return _concentric(_owen_sobol(count, rng))
        case "Hammersley" | "Hammersley, polar":
            flat = np.stack([(k + (number + 0.5) / SETS) / count, _reversed(k, count)], axis=1)
            return _concentric(flat) if kind == "Hammersley" else _polar(flat)
        case "Fibonacci":
            return _concentric(
                np.stack([(k + (number + 0.5) / SETS) / count, (k * GOLDEN) % 1.0], axis=1)
            )
        case "growing spiral":
            return _spiral_lattice(k, number * GOLDEN % 1.0)
    return vogel_disc(count, (number + 0.5) / SETS)


def _reversed(k: NDArray[np.int64], count: int) -> FloatArray:
    """The bits of k < count mirrored at the binary point: J. van der Corput, 1935."""
    found, bit = np.zeros(len(k)), 0.5
    while count > 1:
        found += bit * (k & 1)
        k, count, bit = k >> 1, count >> 1, 0.5 * bit
    return found


def _spiral_lattice(k: NDArray[np.int64], shift: float) -> FloatArray:
    """A lattice on (radius squared, angle); the even ones of len(k), a power of two, are that of half as many."""
    angle = 2.0 * np.pi * ((k * MULTIPLIER) % len(k)) / len(k)
    radius = np.sqrt((k / len(k) + shift) % 1.0)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _owen_sobol(count: int, rng: np.random.Generator) -> FloatArray:
    """The first two dimensions of Sobol's sequence, with every bit flipped at random below its prefix."""
    bits = max(1, count.bit_length() - 1)
    k = np.arange(count)
    columns = [np.zeros(count, np.int64), np.zeros(count, np.int64)]
    second = 1
    for bit in range(bits):
        on = (k >> bit) & 1
        columns[0] ^= on << (bits - 1 - bit)
        columns[1] ^= on * (second << (bits - 1 - bit))
        second ^= second << 1  # rows of Pascal's triangle modulo 2: the second matrix of Sobol'
    return np.stack([_scrambled(column, bits, rng) for column in columns], axis=1)


def _scrambled(column: NDArray[np.int64], bits: int, rng: np.random.Generator) -> FloatArray:
    found = np.zeros(len(column), np.int64)
    for bit in range(bits - 1, -1, -1):
        flips = rng.integers(0, 2, 1 << (bits - 1 - bit))
        found |= (((column >> bit) & 1) ^ flips[column >> (bit + 1)]) << bit
    return (found + rng.random(len(column))) / float(1 << bits)


def _polar(square: FloatArray) -> FloatArray:
    radius, angle = np.sqrt(square[:, 0]), 2.0 * np.pi * square[:, 1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _concentric(square: FloatArray) -> FloatArray:
    """The unit square on the unit disc: squares around the middle become circles."""
    a, b = (2.0 * square - 1.0).T
    wide = np.abs(a) > np.abs(b)
    radius, other = np.where(wide, a, b), np.where(wide, b, a)
    ratio = np.divide(other, radius, out=np.zeros_like(other), where=radius != 0.0)
    angle = np.where(wide, 0.25 * np.pi * ratio, 0.5 * np.pi - 0.25 * np.pi * ratio)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)

"""Seams of an atlas: both sides of a chart's boundary are made to look up the same values.

Along each seam, places are spread that lie on one point of the surface and on two of the page. The texels
that a bilinear lookup reads there are moved so that both lookups agree, as little as their errors allow:

    minimise  sum over places (lookup on one side - lookup on the other)^2
            + STAY sum over texels ((value - baked value) / error)^2      errors relative to the middle one

Source: M. Iwanicki, Lighting technology of The Last of Us, SIGGRAPH talks, 2013.

What was measured at 192 x 192 texels of 64 rays: the root mean square error of texels over that before, and of
the steps that are left where the surface has none above 0.05; 16 samples in each texel are the truth.

                                              demo hall        a house          a scan
    as traced                                 1      0.0246    1      0.0194    1      0.0186
    real step 0.1 + 4 errors, STAY 0.01       1.265  0.0086    1.053  0.0084    0.983  0.0010
    0.1 + 2 errors, STAY 0.1                  1.109  0.0089    1.017  0.0078    0.975  0.0019
    and no error below that of the width      1.100  0.0088    1.014  0.0076    0.971  0.0019
    0.05 + 2 errors                           1.047  0.0090    1.005  0.0079    0.971  0.0019
    0.05 + 2.5 errors                         1.057  0.0087    1.008  0.0077    0.971  0.0019    this one
    0.03 + 2 errors                           1.026  0.0107    1.002  0.0085    0.970  0.0021
    1/256 + 4 errors, STAY 0.01               1.080  0.0113    1.011  0.0103    0.982  0.0012
    0.05 + 2 errors, STAY 0.3                 1.032  0.0100    1.002  0.0082    0.972  0.0030

A limit by the range of the texels that are read, on either side or on both, told true steps no better (1.176), and
neither did one place per texel (1.042 and 0.0116 in the hall).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.seam_kernels import add_normal_product
from aobake.meshes.coincident import first_equal_row
from aobake.meshes.scene import FloatArray, IntArray

__all__ = ["Seams", "equalised", "find_seams", "joined_seams"]

Float32Array = NDArray[np.float32]

SAME_UV = 1e-6  # a hundredth of a texel of the largest usual page
CREASE = math.cos(
    math.radians(2.0)
)  # normals farther apart see different hemispheres: a step is right there
PLACES_PER_TEXEL = 2
REAL_STEP = 0.05  # two sides that differ by more, and by more than noise, do so on the surface, too
SURE = 2.5  # standard errors
STAY = 0.1  # the step that is left is about this share of what it was
WIDTH_ERROR = 0.01  # what is off since a texel stands for all of its width, however many its rays
MOST_ROUNDS = 200
GOOD_ENOUGH = 1e-3  # of the first residual; a hundredth of that changes no step by more than 2e-4


@dataclass(frozen=True, eq=False, kw_only=True)
class Seams:
    """Edges of a surface that lie in two places of a page.

    uv : (E, 2, 2, 2) float64, edge, side, end, coordinate; both sides run in the same direction; v runs down
    smooth : (E,) bool, whether the normals of both sides agree, so that the values should, too
    """

    uv: FloatArray
    smooth: NDArray[np.bool_]


def find_seams(vertices: FloatArray, faces: IntArray, uv: FloatArray, normals: FloatArray) -> Seams:
    """The seams of a mesh: edges of two faces that have other texture coordinates in each.

    vertices : (V, 3) float64; vertices at one place count as one
    faces : (F, 3) int32, those that have a place on the page
    uv : (F, 3, 2) float64 of their corners; normals : (F, 3, 3) float64, unit length, at their corners
    Where more than two faces meet at an edge, neighbours in the order of faces are paired. No faces give no
    seams.
    """
    place = first_equal_row(vertices)[faces].astype(np.int64)
    start, end = place, np.roll(place, -1, axis=1)
    low, high = np.minimum(start, end).reshape(-1), np.maximum(start, end).reshape(-1)
    key = low * (len(vertices) + 1) + high
    order = np.argsort(key, kind="stable")
    order = order[low[order] != high[order]]
    paired = key[order[:-1]] == key[order[1:]]
    pairs = np.stack([order[:-1][paired], order[1:][paired]], axis=1)
    runs_up = (start <= end).reshape(-1)[pairs]
    along_uv = _along(uv, pairs, runs_up)
    along_normals = _along(normals, pairs, runs_up)
    apart = np.abs(along_uv[:, 0] - along_uv[:, 1]).max(axis=(1, 2), initial=0.0) > SAME_UV
    agree = np.einsum("eij,eij->ei", along_normals[:, 0], along_normals[:, 1]).min(
        axis=1, initial=1.0
    )
    return Seams(uv=along_uv[apart], smooth=agree[apart] >= CREASE)


def joined_seams(several: Sequence[Seams]) -> Seams:
    """The seams of all layouts of a page."""
    if not several:
        return Seams(uv=np.zeros((0, 2, 2, 2)), smooth=np.zeros(0, np.bool_))
    return Seams(
        uv=np.concatenate([seams.uv for seams in several]),
        smooth=np.concatenate([seams.smooth for seams in several]),
    )


def equalised(
    values: Float32Array, error: Float32Array, covered: NDArray[np.bool_], seams: Seams
) -> Float32Array:
    """A page on which bilinear lookups agree on both sides of every smooth seam, but where they truly differ.

    values : (H, W) float32 in [0, 1]; error : (H, W) float32, their standard errors: where it is small, a
        value moves less
    covered : (H, W) bool; places whose lookup reads another texel are left out
    Returns (H, W) float32 in [0, 1]; only texels that a lookup on a seam reads have moved.
    """
    texel, weight = _without_real_steps(_equations(seams, covered), values, error)
    unknown, inverse = np.unique(texel, return_inverse=True)
    result = values.copy()
    if len(unknown) == 0:
        return result
    equations = inverse.reshape(texel.shape).astype(np.int32), weight
    flat = result.reshape(-1)
    start = flat[unknown].astype(np.float64)
    errors = error.reshape(-1)[unknown]
    most = REAL_STEP + SURE * errors  # a texel that a lookup hardly reads would be moved far beyond
    change = np.clip(_least_change(equations, start, _stiffness(errors)), -most, most)
    flat[unknown] = np.clip(start + change, 0.0, 1.0)
    return result


def _along(corners: FloatArray, pairs: NDArray[np.int64], runs_up: NDArray[np.bool_]) -> FloatArray:
    """(E, 2, 2, K): what corners (F, 3, K) have at both ends of each side of paired half-edges."""
    first = corners.reshape(-1, corners.shape[2])
    second = np.roll(corners, -1, axis=1).reshape(-1, corners.shape[2])
    ends = np.stack([first[pairs], second[pairs]], axis=2)
    return np.where(runs_up[:, :, np.newaxis, np.newaxis], ends, ends[:, :, ::-1])


def _equations(
    seams: Seams, covered: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(S, 8) texels, row * W + column, and their factors in: one lookup - the other = 0."""
    height, width = covered.shape
    at = _places(seams.uv[seams.smooth] * (width, height)) - 0.5
    corner = np.floor(at).astype(np.int64)
    part = at - corner
    texels, factors = [], []
    for dy in (0, 1):
        for dx in (0, 1):
            column = np.clip(corner[..., 0] + dx, 0, width - 1)
            row = np.clip(corner[..., 1] + dy, 0, height - 1)
            across = part[..., 0] if dx else 1.0 - part[..., 0]
            down = part[..., 1] if dy else 1.0 - part[..., 1]
            texels.append(row * width + column)
            factors.append(across * down * (1.0, -1.0))
    texel = np.stack(texels, axis=-1).reshape(-1, 8)
    weight = np.stack(factors, axis=-1).reshape(-1, 8)
    known = (covered.reshape(-1)[texel] | (weight == 0.0)).all(axis=1)
    return texel[known], weight[known]


def _without_real_steps(
    equations: tuple[NDArray[np.int64], NDArray[np.float64]],
    values: Float32Array,
    error: Float32Array,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The equations of places whose two sides differ no more than noise and the width of texels explain.

    A surface may step at a seam whose normals agree: where another one passes through it, and on coarse
    meshes shaded smoothly, whose faces see different hemispheres. One side would be made black there.
    """
    texel, weight = equations
    step = np.abs(np.einsum("sk,sk->s", weight, values.reshape(-1)[texel]))
    noise = np.sqrt(np.einsum("sk,sk->s", weight**2, np.square(error.reshape(-1)[texel])))
    small = step <= REAL_STEP + SURE * noise
    return texel[small], weight[small]


def _places(ends: FloatArray) -> FloatArray:
    """(S, 2, 2) places on both sides of seams (E, 2, 2, 2), given in texels: evenly spread, ends included."""
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1).max(axis=1, initial=0.0)
    steps = np.maximum(np.ceil(length * PLACES_PER_TEXEL), 1.0).astype(np.int64)
    seam = np.repeat(np.arange(len(ends)), steps + 1)
    first = np.cumsum(steps + 1) - (steps + 1)
    share = (np.arange(len(seam)) - first[seam]) / steps[seam]
    start, end = ends[seam, :, 0], ends[seam, :, 1]
    return np.asarray(start + share[:, np.newaxis, np.newaxis] * (end - start))


def _stiffness(error: Float32Array) -> FloatArray:
    """What it costs to move each texel."""
    variance = np.square(error, dtype=np.float64) + WIDTH_ERROR**2
    return np.asarray(STAY * np.median(variance) / variance)


def _least_change(
    equations: tuple[IntArray, FloatArray], start: FloatArray, stiffness: FloatArray
) -> FloatArray:
    """Solve (A^T A + stiffness) change = -A^T A start by conjugate gradients, scaled by the diagonal.

    Source: M. Hestenes, E. Stiefel, Methods of conjugate gradients for solving linear systems, 1952.
    """
    texel, weight = equations

    def product(x: FloatArray) -> FloatArray:
        result = np.zeros_like(x)
        add_normal_product(texel, weight, x, result)
        return result

    diagonal = stiffness + np.bincount(texel.reshape(-1), np.square(weight).reshape(-1), len(start))
    change = np.zeros_like(start)
    residual = -product(start)
    scaled = residual / diagonal
    direction = scaled.copy()
    size = first = _dot(residual, scaled)
    for _ in range(MOST_ROUNDS):
        if size <= GOOD_ENOUGH**2 * first or size == 0.0:
            break
        image = product(direction) + stiffness * direction
        step = size / _dot(direction, image)
        change += step * direction
        residual -= step * image
        scaled = residual / diagonal
        last, size = size, _dot(residual, scaled)
        direction = scaled + (size / last) * direction
    return change


def _dot(a: FloatArray, b: FloatArray) -> float:
    """Not by BLAS, which adds up in another order for another number of threads."""
    return float(np.einsum("i,i->", a, b))

"""Flattening of pieces of a surface: a piece that can be opened into a disc is laid into the plane.

It starts from W. T. Tutte, How to draw a graph, 1963 (M. Floater, Parametrization and smooth
approximation of surface triangulations, 1997): the border on a circle, every other vertex a positively
weighted mean of its neighbours, which no triangle survives flipped. From there the symmetric Dirichlet
energy (J. Smith, S. Schaefer, Bijective parameterization with free boundaries, 2015) is lowered by
L-BFGS steps that the surface's Laplacian preconditions (Y. Zhu, R. Bridson, D. Kaufman, Blended cured
quasi-Newton for distortion optimization, 2018), never so far that a triangle flips.

Approaches tried, on 20,020 faces of a scan in 10 calls, as processor seconds beside the kernel as it is:
equations of a step without the look at fixed rows 1.02, the same bytes; their vectors in float32 1.21; a
history of 12 steps 1.06, of 3 0.78 with more stretch (a mean of 1.031 instead of 1.019); Tutte's
equations to 1e-4 1.11, to 1e-6 0.96; those of a step to 1e-3 1.68, to 1e-1 0.38 (1.029). To 1e-1 and SETTLED at
0.001, whole unwrappings of a scan of 69,000 triangles and a mesh of 130,000 spend 0.47 and 0.62 of the seconds
in this kernel (one run of each), but the page of the scan was covered to 0.40 instead of 0.55: left, until it
is known whether that is chance. Stretch moves by 0.002 where only rounding differs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.laplacian_kernels import laplacian_of, solve
from aobake.atlas.topology_kernels import border_loop, glued, opened
from aobake.tracing.arena import give_back, reserved, taken, zeros
from aobake.tracing.compiled import inlined, kernel
from aobake.tracing.vectors import cross, dot, length, minus, row

__all__ = ["arena_for", "flatten_pieces"]

LEAST_WEIGHT, MOST_WEIGHT = 0.05, 20.0  # of Tutte's means, where cotangents may be negative or huge
STEPS, HISTORY = 60, 6
SETTLED = 0.01  # share of the energy above an isometry's (or of 2% of it): less is the last step
EXACT = 1e-12  # share of an isometry's energy that is no more worth a step
STIFFER = 0.25  # what the energy's Hessian is, roughly, beside four times the Laplacian
CORNER_BYTES, MOST_TAKEN = 560, 48  # memory for a piece: 550 bytes a corner, in 40 arrays
BACK = 0.9  # of the way to the first flip that a step may go


def arena_for(most: int) -> NDArray[np.uint8]:
    """Memory to lay pieces of at most so many faces flat, one after the other, in one thread."""
    return reserved(CORNER_BYTES * 3 * most, MOST_TAKEN)


@inlined
def _set_on_circle(arena, vertices, corners, vertex_of, loop, border, laplacian, area, x):
    """Fill x (n, 2): Tutte's embedding in a circle of the piece's area, the border spaced by its lengths."""
    start, other, weight, count = laplacian[0], laplacian[1], laplacian[2], len(x)
    fixed, whole = zeros(arena, count, np.bool_), 0.0
    for n in range(border):
        h = loop[n]
        whole += length(
            minus(row(vertices, corners[h - h % 3 + (h + 1) % 3]), row(vertices, corners[h]))
        )
    along, radius = 0.0, np.sqrt(area / np.pi)
    for n in range(border):
        h = loop[n]
        v = vertex_of[h]
        angle = 2.0 * np.pi * along / whole
        x[v, 0], x[v, 1], fixed[v] = radius * np.cos(angle), radius * np.sin(angle), True
        along += length(
            minus(row(vertices, corners[h - h % 3 + (h + 1) % 3]), row(vertices, corners[h]))
        )
    positive, diagonal = zeros(arena, len(weight), np.float64), zeros(arena, count, np.float64)
    for v in range(count):
        for e in range(start[v], start[v + 1]):
            positive[e] = min(max(weight[e], LEAST_WEIGHT), MOST_WEIGHT)
            diagonal[v] += positive[e]
    right = zeros(arena, (count, 2), np.float64)
    solve(arena, start, other, positive, diagonal, fixed, right, x, 1e-9)


@inlined
def _rest_shapes(arena, vertices, corners):
    """Per triangle: the inverse of its edges laid into the plane (m, 4), and its area (m,)."""
    count = len(corners) // 3
    inverse, area = zeros(arena, (count, 4), np.float64), zeros(arena, count, np.float64)
    for t in range(count):
        a = row(vertices, corners[3 * t])
        u = minus(row(vertices, corners[3 * t + 1]), a)
        v = minus(row(vertices, corners[3 * t + 2]), a)
        base, twice = length(u), length(cross(u, v))
        shift, height = dot(u, v) / base, twice / base
        inverse[t, 0], inverse[t, 1] = 1.0 / base, -shift / twice
        inverse[t, 2], inverse[t, 3] = 0.0, 1.0 / height
        area[t] = 0.5 * twice
    return inverse, area


@inlined
def _jacobian(x, vertex_of, inverse, t):
    """Of the map of a triangle from its own plane: (a, b, c, d) = ((a, b), (c, d))."""
    i, j, k = vertex_of[3 * t], vertex_of[3 * t + 1], vertex_of[3 * t + 2]
    p, q = x[j, 0] - x[i, 0], x[k, 0] - x[i, 0]
    r, s = x[j, 1] - x[i, 1], x[k, 1] - x[i, 1]
    g0, g1, g3 = inverse[t, 0], inverse[t, 1], inverse[t, 3]
    return p * g0, p * g1 + q * g3, r * g0, r * g1 + s * g3


@inlined
def _energy(x, vertex_of, inverse, area):
    """The symmetric Dirichlet energy; infinite where a triangle is flipped."""
    total = 0.0
    for t in range(len(area)):
        a, b, c, d = _jacobian(x, vertex_of, inverse, t)
        det = a * d - b * c
        if not det > 0.0:
            return np.inf
        total += area[t] * (a * a + b * b + c * c + d * d) * (1.0 + 1.0 / (det * det))
    return total


@inlined
def _slope(x, vertex_of, inverse, area, g):
    """Fill g (n, 2), the gradient of the energy."""
    for v in range(len(g)):
        g[v, 0] = g[v, 1] = 0.0
    for t in range(len(area)):
        a, b, c, d = _jacobian(x, vertex_of, inverse, t)
        det = a * d - b * c
        norm = a * a + b * b + c * c + d * d
        along = 2.0 * area[t] * (1.0 + 1.0 / (det * det))
        aside = 2.0 * area[t] * norm / (det * det * det)
        a, b, c, d = (
            along * a - aside * d,
            along * b + aside * c,
            along * c + aside * b,
            along * d - aside * a,
        )
        g0, g1, g3 = inverse[t, 0], inverse[t, 1], inverse[t, 3]
        i, j, k = vertex_of[3 * t], vertex_of[3 * t + 1], vertex_of[3 * t + 2]
        ju, ku, jv, kv = a * g0 + b * g1, b * g3, c * g0 + d * g1, d * g3
        g[j, 0] += ju
        g[k, 0] += ku
        g[i, 0] -= ju + ku
        g[j, 1] += jv
        g[k, 1] += kv
        g[i, 1] -= jv + kv


@inlined
def _longest_step(x, d, vertex_of, count):
    """How far along d (n, 2) until the first triangle flips; at most 1 / BACK."""
    longest = 1.0 / BACK
    for t in range(count):
        i, j, k = vertex_of[3 * t], vertex_of[3 * t + 1], vertex_of[3 * t + 2]
        p, q = x[j, 0] - x[i, 0], x[k, 0] - x[i, 0]
        r, s = x[j, 1] - x[i, 1], x[k, 1] - x[i, 1]
        dp, dq = d[j, 0] - d[i, 0], d[k, 0] - d[i, 0]
        dr, ds = d[j, 1] - d[i, 1], d[k, 1] - d[i, 1]
        c = p * s - q * r
        b = p * ds + dp * s - q * dr - dq * r
        a = dp * ds - dq * dr
        under = b * b - 4.0 * a * c
        if under < 0.0:
            continue
        # the form of the roots that does not cancel; c > 0
        half = -0.5 * (b + (np.sqrt(under) if b > 0.0 else -np.sqrt(under)))
        if half != 0.0 and c / half > 0.0:
            longest = min(longest, c / half)
        if a != 0.0 and half / a > 0.0:
            longest = min(longest, half / a)
    return longest


@inlined
def _dot(a, b):
    total = 0.0
    for v in range(len(a)):
        total += a[v, 0] * b[v, 0] + a[v, 1] * b[v, 1]
    return total


@inlined
def _sum(a, share, b, result):
    """Fill result with a + share b."""
    for v in range(len(a)):
        result[v, 0] = a[v, 0] + share * b[v, 0]
        result[v, 1] = a[v, 1] + share * b[v, 1]


@inlined
def _direct(arena, laplacian, g, moves, turns, kept, q, d):
    """Fill d (n, 2): minus the inverse Hessian, as L-BFGS knows it, times g. Source: J. Nocedal, 1980."""
    start, other, weight, diagonal, free = laplacian
    mark, alpha = taken(arena), zeros(arena, HISTORY, np.float64)
    most = min(kept, HISTORY)
    _sum(g, 0.0, g, q)
    for back in range(most):
        n = (kept - 1 - back) % HISTORY
        alpha[n] = _dot(moves[n], q) / _dot(moves[n], turns[n])
        _sum(q, -alpha[n], turns[n], q)
    for v in range(len(d)):
        d[v, 0] = d[v, 1] = 0.0
        q[v, 0], q[v, 1] = -STIFFER * q[v, 0], -STIFFER * q[v, 1]
    solve(arena, start, other, weight, diagonal, free, q, d, 1e-2)
    for forth in range(most):
        n = (kept - most + forth) % HISTORY
        share = alpha[n] + _dot(turns[n], d) / _dot(moves[n], turns[n])
        _sum(d, -share, moves[n], d)
    give_back(arena, mark)


@inlined
def _relax(arena, x, vertex_of, inverse, area, laplacian):
    """Lower the energy of x (n, 2) in place until it settles."""
    size = (len(x), 2)
    g, new_g = zeros(arena, size, np.float64), zeros(arena, size, np.float64)
    q, d = zeros(arena, size, np.float64), zeros(arena, size, np.float64)
    there = zeros(arena, size, np.float64)
    moves = zeros(arena, (HISTORY, len(x), 2), np.float64)
    turns = zeros(arena, (HISTORY, len(x), 2), np.float64)
    energy, kept, isometric = _energy(x, vertex_of, inverse, area), np.int64(0), 0.0
    for t in range(len(area)):
        isometric += 4.0 * area[t]
    _slope(x, vertex_of, inverse, area, g)
    for _ in range(STEPS):
        _direct(arena, laplacian, g, moves, turns, kept, q, d)
        down = _dot(d, g)
        if not down < 0.0:
            if kept == 0:
                break
            kept = np.int64(0)
            continue
        step = 2.0 * min(1.0, BACK * _longest_step(x, d, vertex_of, len(area)))
        new = np.inf
        while not new <= energy + 1e-4 * step * down and step > 1e-9:
            step *= 0.5
            _sum(x, step, d, there)
            new = _energy(there, vertex_of, inverse, area)
        if not new < energy:
            break
        _slope(there, vertex_of, inverse, area, new_g)
        n = kept % HISTORY
        _sum(there, -1.0, x, moves[n])
        _sum(new_g, -1.0, g, turns[n])
        if _dot(moves[n], turns[n]) > 0.0:
            kept += 1
        _sum(there, 0.0, d, x)
        _sum(new_g, 0.0, d, g)
        gained, energy = energy - new, new
        above = energy - isometric
        if gained < SETTLED * min(above, 0.02 * energy) or above < EXACT * isometric:
            break


@inlined
def _flatten(arena, vertices, corners, across, uv):
    """Lay one piece into the plane: fill uv (3 m, 2) and return its L2 stretch, or infinity.

    corners : (3 m,) int32 vertex of each corner
    across : (3 m,) int32 the half-edge beyond each, or -1
    """
    vertex_of, count = glued(arena, across)
    if not opened(arena, across, vertex_of, count):
        return np.inf
    vertex_of, count = glued(arena, across)
    loop = zeros(arena, len(across), np.int32)
    border = border_loop(across, loop)
    inverse, area = _rest_shapes(arena, vertices, corners)
    laplacian = laplacian_of(arena, vertices, corners, across, vertex_of, count)
    whole = 0.0
    for t in range(len(area)):
        whole += area[t]
    x = zeros(arena, (count, 2), np.float64)
    _set_on_circle(arena, vertices, corners, vertex_of, loop, border, laplacian, whole, x)
    if not _energy(x, vertex_of, inverse, area) < np.inf:
        return np.inf
    _relax(arena, x, vertex_of, inverse, area, laplacian)
    stretched, covered = 0.0, 0.0
    for t in range(len(area)):
        a, b, c, d = _jacobian(x, vertex_of, inverse, t)
        det = a * d - b * c
        stretched += 0.5 * area[t] * (a * a + b * b + c * c + d * d) / (det * det)
        covered += area[t] * det
    size = np.sqrt(whole / covered)
    for h in range(len(corners)):
        uv[h, 0], uv[h, 1] = size * x[vertex_of[h], 0], size * x[vertex_of[h], 1]
    return np.sqrt(stretched * covered) / whole


@kernel
def flatten_pieces(
    arena, vertices, faces, opposite, order, starts, slot, piece, first, last, uv, stretch
):
    """Fill uv (F, 3, 2) and stretch (pieces,) of pieces first to last.

    arena : of arena_for
    order, starts : the faces of piece p are order[starts[p] : starts[p + 1]]
    slot, piece : (F,) int32 the place of a face within its piece, and which piece that is
    """
    for p in range(first, last):
        chosen = order[starts[p] : starts[p + 1]]
        mark = taken(arena)
        corners = zeros(arena, 3 * len(chosen), np.int32)
        across = zeros(arena, 3 * len(chosen), np.int32)
        for n in range(len(chosen)):
            f = chosen[n]
            for k in range(3):
                corners[3 * n + k] = faces[f, k]
                h = opposite[f, k]
                beyond = h >= 0 and piece[h // 3] == p
                across[3 * n + k] = 3 * slot[h // 3] + h % 3 if beyond else -1
        flat = zeros(arena, (3 * len(chosen), 2), np.float64)
        stretch[p] = _flatten(arena, vertices, corners, across, flat)
        if stretch[p] < np.inf:
            for n in range(len(chosen)):
                for k in range(3):
                    uv[chosen[n], k, 0] = flat[3 * n + k, 0]
                    uv[chosen[n], k, 1] = flat[3 * n + k, 1]
        give_back(arena, mark)

"""The Laplacian of a piece of a surface: a sparse matrix, and equations with it.

Tried: multiplying by the diagonal's inverse, worked out once for a solve: 0.88 of flatten_pieces (20,020 faces
of a scan), with other last bits, which lay every piece out differently; not taken up yet.
"""

from __future__ import annotations

import numpy as np

from aobake.tracing.arena import give_back, taken, zeros
from aobake.tracing.compiled import inlined
from aobake.tracing.vectors import cross, dot, length, minus, row

__all__ = ["laplacian_of", "solve"]

ROUGHLY = 200  # rounds of conjugate gradients to precondition a step: needles would take thousands


@inlined
def _cotangent(vertices, a, b, c):
    """Of the angle at a between b and c."""
    u, v = minus(row(vertices, b), row(vertices, a)), minus(row(vertices, c), row(vertices, a))
    area = length(cross(u, v))
    return dot(u, v) / area if area > 0.0 else 0.0


@inlined
def laplacian_of(arena, vertices, corners, across, vertex_of, count):
    """Cotangent weights in compressed rows: start (n + 1,), other, weight, and the diagonal (n,); no row is fixed.

    Source: U. Pinkall, K. Polthier, Computing discrete minimal surfaces, 1993.
    """
    start = zeros(arena, count + 1, np.int32)
    for h in range(len(across)):
        v, w = vertex_of[h], vertex_of[h - h % 3 + (h + 1) % 3]
        start[v + 1] += 1
        if across[h] < 0:
            start[w + 1] += 1
    for v in range(count):
        start[v + 1] += start[v]
    other, weight = zeros(arena, start[count], np.int32), zeros(arena, start[count], np.float64)
    filled, diagonal = zeros(arena, count, np.int32), zeros(arena, count, np.float64)
    for v in range(count):
        filled[v] = start[v]
    for h in range(len(across)):
        first = h - h % 3
        v, w = vertex_of[h], vertex_of[first + (h + 1) % 3]
        cot = 0.5 * _cotangent(
            vertices, corners[first + (h + 2) % 3], corners[h], corners[first + (h + 1) % 3]
        )
        if across[h] >= 0:
            g = across[h]
            base = g - g % 3
            cot += 0.5 * _cotangent(
                vertices, corners[base + (g + 2) % 3], corners[g], corners[base + (g + 1) % 3]
            )
        other[filled[v]], weight[filled[v]] = w, cot
        filled[v] += 1
        diagonal[v] += cot
        if across[h] < 0:
            other[filled[w]], weight[filled[w]] = v, cot
            filled[w] += 1
            diagonal[w] += cot
    return start, other, weight, diagonal, zeros(arena, count, np.bool_)


@inlined
def solve(  # noqa: C901, PLR0912 - loops over rows, spelled out for the compiler
    arena, start, other, weight, diagonal, fixed, right, x, tolerance
):
    """Conjugate gradients, preconditioned by the diagonal, on x (n, 2) in place; fixed rows stay."""
    count, mark = len(x), taken(arena)
    r, p = zeros(arena, (count, 2), np.float64), zeros(arena, (count, 2), np.float64)
    ap = zeros(arena, (count, 2), np.float64)
    size, goal = 0.0, 0.0
    for v in range(count):
        if not fixed[v]:
            a0, a1 = diagonal[v] * x[v, 0], diagonal[v] * x[v, 1]
            for e in range(start[v], start[v + 1]):
                a0 -= weight[e] * x[other[e], 0]
                a1 -= weight[e] * x[other[e], 1]
            r[v, 0], r[v, 1] = right[v, 0] - a0, right[v, 1] - a1
            p[v, 0], p[v, 1] = r[v, 0] / diagonal[v], r[v, 1] / diagonal[v]
            size += r[v, 0] * p[v, 0] + r[v, 1] * p[v, 1]
    goal = size * tolerance * tolerance
    for _ in range(ROUGHLY if tolerance > 1e-3 else 20 * count):
        if not size > goal:
            break
        bent = 0.0
        for v in range(count):
            if not fixed[v]:
                a0, a1 = diagonal[v] * p[v, 0], diagonal[v] * p[v, 1]
                for e in range(start[v], start[v + 1]):
                    a0 -= weight[e] * p[other[e], 0]
                    a1 -= weight[e] * p[other[e], 1]
                ap[v, 0], ap[v, 1] = a0, a1
                bent += p[v, 0] * a0 + p[v, 1] * a1
        if not bent > 0.0:
            break
        alpha, new = size / bent, 0.0
        for v in range(count):
            if not fixed[v]:
                for k in range(2):
                    x[v, k] += alpha * p[v, k]
                    r[v, k] -= alpha * ap[v, k]
                    new += r[v, k] * r[v, k] / diagonal[v]
        beta = new / size
        for v in range(count):
            if not fixed[v]:
                for k in range(2):
                    p[v, k] = r[v, k] / diagonal[v] + beta * p[v, k]
        size = new
    give_back(arena, mark)

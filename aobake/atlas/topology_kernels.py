"""The topology of pieces of a surface: vertices, borders, connected parts, and cuts that make a disc.

A half-edge 3 f + k runs from corner k of face f to the next one; `across` holds the half-edge on its other
side, or -1 at a border. Vertices are what corners are glued to across half-edges, so that a piece that
touches itself in a point is a surface all the same, and a cut is an entry of -1.

connected is not 1 % of any bake measured: written plainly. The others are part of flatten_pieces.
"""

from __future__ import annotations

import numpy as np

from aobake.tracing.arena import zeros
from aobake.tracing.compiled import inlined, kernel

__all__ = ["border_loop", "connected", "glued", "opened"]


@inlined
def _next(h):
    """The next half-edge of the same face."""
    return h - 2 if h % 3 == 2 else h + 1


@inlined
def _root(parent, c):
    while parent[c] != c:
        parent[c] = parent[parent[c]]
        c = parent[c]
    return c


@inlined
def _join(parent, one, other):
    a, b = _root(parent, one), _root(parent, other)
    parent[max(a, b)] = min(a, b)


@inlined
def glued(arena, across):
    """(vertex of each corner (3 m,) int32, number of vertices)."""
    parent = zeros(arena, len(across), np.int32)
    for c in range(len(across)):
        parent[c] = c
    for h in range(len(across)):
        g = across[h]
        if g > h:
            _join(parent, h, _next(g))
            _join(parent, _next(h), g)
    vertex_of, count = zeros(arena, len(across), np.int32), 0
    for c in range(len(across)):
        root = _root(parent, c)
        if root == c:
            vertex_of[c] = count
            count += 1
        else:
            vertex_of[c] = vertex_of[root]
    return vertex_of, count


@inlined
def border_loop(across, loop):
    """Fill in the half-edges of the border that the first border half-edge is on, in order; how many they are."""
    length = 0
    for first in range(len(across)):
        if across[first] < 0:
            h = first
            while True:
                loop[length] = h
                length += 1
                h = _next(h)
                while across[h] >= 0:
                    h = _next(across[h])
                if h == first:
                    break
            break
    return length


@inlined
def opened(arena, across, vertex_of, count):  # noqa: C901 - one cut, from its tree to its last loose end
    """Cut a connected piece (across, in place) until it is a disc; False for a closed one, left as it is.

    What a spanning tree of the faces does not cross is a cut that leaves a disc; its loose ends are
    sewn up again (J. Erickson, S. Har-Peled, Optimally cutting a surface into a disk, 2002).
    """
    borders = 0
    for h in range(len(across)):
        borders += across[h] < 0
    if borders == 0:
        return False
    edges = (len(across) + borders) // 2
    if count - edges + len(across) // 3 == 1:
        return True
    crossed = zeros(arena, len(across), np.bool_)
    _cross(arena, across, crossed)
    degree, around = zeros(arena, count, np.int32), zeros(arena, count, np.int32)
    for h in range(len(across)):
        if across[h] < 0:  # the border is part of the cut: it has no loose end
            degree[vertex_of[h]] += 2
        elif across[h] > h and not crossed[h]:
            for v in (vertex_of[h], vertex_of[_next(h)]):
                degree[v] += 1
                around[v] ^= h
    for first in range(count):
        v = first
        while degree[v] == 1:
            h = around[v]
            crossed[h] = crossed[across[h]] = True
            degree[v] = 0
            v = vertex_of[h] + vertex_of[_next(h)] - v
            degree[v] -= 1
            around[v] ^= h
    for h in range(len(across)):
        if not crossed[h]:
            across[h] = -1
    return True


@inlined
def _cross(arena, across, crossed):
    """Set, in crossed (3 m,) bool, the half-edges that a breadth-first tree of the faces crosses."""
    seen = zeros(arena, len(across) // 3, np.bool_)
    queue = zeros(arena, len(seen), np.int32)
    queue[0], seen[0], done, waiting = 0, True, 0, 1
    while done < waiting:
        f = queue[done]
        done += 1
        for h in range(3 * f, 3 * f + 3):
            g = across[h]
            if g >= 0 and not seen[g // 3]:
                seen[g // 3] = crossed[h] = crossed[g] = True
                queue[waiting] = g // 3
                waiting += 1


@kernel
def connected(opposite, group, stack, label):
    """Fill label (F,) with numbers of parts, connected across edges, of faces of one group; -1 for group -1.

    opposite : (F, 3) int32 half-edge on the other side of each, or -1
    stack : (F,) int32, scratch
    Returns how many parts there are.
    """
    count = 0
    for f in range(len(label)):
        label[f] = -1
    for seed in range(len(group)):
        if group[seed] < 0 or label[seed] >= 0:
            continue
        label[seed], stack[0], waiting = count, seed, 1
        while waiting > 0:
            waiting -= 1
            f = stack[waiting]
            for k in range(3):
                h = opposite[f, k]
                if h >= 0 and label[h // 3] < 0 and group[h // 3] == group[seed]:
                    label[h // 3] = count
                    stack[waiting] = h // 3
                    waiting += 1
        count += 1
    return count

"""Corners that share a tangent, and what it is: the grouping of MikkTSpace.

A half-edge 3 f + k runs from corner k of face f to the next one.
"""

from __future__ import annotations

import numpy as np

from aobake.tracing.compiled import inlined, kernel
from aobake.tracing.vectors import dot, length, minus

__all__ = ["ANY", "PRESERVING", "UNUSABLE", "sew", "share_tangents"]

PRESERVING = 1  # the face's texture coordinates turn the same way as its corners
ANY = 2  # they have no area: it goes with whatever group reaches it
UNUSABLE = 4  # two corners at one place: it takes no part


@kernel
def sew(order, edge, forward, across):
    """Fill across (3 F,) with the half-edge on the other side of each; -1 at first, and for none.

    order : half-edges, those of one edge in a row, ascending
    edge : (3 F,), which edge; forward : (3 F,) bool, the way it is run along
    At an edge of many faces the first ones that run against each other are neighbours.
    """
    for i in range(len(order)):
        one, at = order[i], i + 1
        while across[one] < 0 and at < len(order) and edge[order[at]] == edge[one]:
            other = order[at]
            if across[other] < 0 and forward[other] != forward[one]:
                across[one], across[other] = other, one
            at += 1


@kernel
def share_tangents(corners, along, state, vertex, across, stack, members, frames):
    """Fill frames (F, 3, 4): the tangent of each corner, zero where there is none, and the sign of its
    bitangent, zero where no group reaches it.

    corners : (F, 3, 6) float64, position and unit normal; along : (F, 3) float64, the unit direction of u
    state : (F,) uint8, of PRESERVING, ANY and UNUSABLE; changed
    vertex : (F, 3) int32, the same for corners that agree in all; across : (3 F,) int32
    stack, members : (2 F + 2,) and (F,) int64, scratch
    """
    for f in range(len(corners)):
        for k in range(3):
            if not state[f] & (ANY | UNUSABLE) and frames[f, k, 3] == 0.0:
                count = _group(corners, along, state, vertex, across, stack, members, frames, f, k)
                _normalise(members, count, frames)


@inlined
def _group(corners, along, state, vertex, across, stack, members, frames, f, k):
    """List the corners that share the tangent of one, which holds the sum of theirs; how many they are."""
    shared, turn = vertex[f, k], state[f] & PRESERVING
    top, count = 1, 0
    stack[0] = f
    while top > 0:
        top -= 1
        t = stack[top]
        i = 0 if vertex[t, 0] == shared else (1 if vertex[t, 1] == shared else 2)
        if frames[t, i, 3] != 0.0:
            continue
        if state[t] & ANY and frames[t, 0, 3] == frames[t, 1, 3] == frames[t, 2, 3] == 0.0:
            state[t] = ANY | turn
        if state[t] & PRESERVING != turn:
            continue
        frames[t, i, 3] = 1.0 if turn else -1.0
        members[count] = 3 * t + i
        count += 1
        if not state[t] & ANY:
            tangent = _weighted(corners, along, t, i)
            for axis in range(3):
                frames[f, k, axis] += tangent[axis]
        for side in (3 * t + (i + 2) % 3, 3 * t + i):  # the last one is followed first
            if across[side] >= 0:
                stack[top] = across[side] // 3
                top += 1
    return count


@inlined
def _normalise(members, count, frames):
    """Give all members of a group the tangent of the first one, at length 1."""
    f, k = members[0] // 3, members[0] % 3
    size = length((frames[f, k, 0], frames[f, k, 1], frames[f, k, 2]))
    for axis in range(3):
        value = frames[f, k, axis] / size if size > 0.0 else 0.0
        for at in range(count):
            frames[members[at] // 3, members[at] % 3, axis] = value


@inlined
def _weighted(corners, along, t, i):
    """The direction of u of a face, across the normal of one of its corners, times the angle there."""
    normal = (corners[t, i, 3], corners[t, i, 4], corners[t, i, 5])
    here = _place(corners, t, i)
    ahead = _across(minus(_place(corners, t, (i + 1) % 3), here), normal)
    back = _across(minus(_place(corners, t, (i + 2) % 3), here), normal)
    tangent = _across((along[t, 0], along[t, 1], along[t, 2]), normal)
    angle = np.arccos(max(-1.0, min(1.0, dot(ahead, back))))
    return (angle * tangent[0], angle * tangent[1], angle * tangent[2])


@inlined
def _place(corners, t, i):
    return (corners[t, i, 0], corners[t, i, 1], corners[t, i, 2])


@inlined
def _across(vector, normal):
    """The part of a vector across a normal, at length 1; zero if there is none."""
    rise = dot(vector, normal)
    flat = (
        vector[0] - rise * normal[0],
        vector[1] - rise * normal[1],
        vector[2] - rise * normal[2],
    )
    size = length(flat)
    if size > 0.0:
        flat = (flat[0] / size, flat[1] / size, flat[2] / size)
    return flat

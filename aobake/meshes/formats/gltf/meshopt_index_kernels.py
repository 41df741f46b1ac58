"""Compiled loops of the meshopt decoder for indices: bytes in, numbers out, every read checked.

A status is 0 for a whole stream, else one of the constants of meshopt_kernels.
Source: KHR_meshopt_compression, appendix A, modes 1 and 2, by A. Kapoulkine and others.

Tried: recent edges and vertices in 32 bits instead of 64, 0.88 of the processor seconds of triangles. Not taken
up yet: the kernel takes 1 and 5 % of reading two small models, at 300 to 420 MB/s.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.gltf.meshopt_kernels import CUT, HEADER, REFERENCE, TAIL
from aobake.tracing.arena import zeros
from aobake.tracing.compiled import inlined, kernel

__all__ = ["indices", "triangles"]

ByteArray = NDArray[np.uint8]
Whole: TypeAlias = int | np.int64  # what a compiled loop takes for a whole number
WordArray = NDArray[np.uint32]
State = NDArray[np.int64]

WRAP = 0xFFFFFFFF
# What the decoder of triangles remembers: where it reads, the next new vertex, the last one given
# explicitly, and how many edges and vertices were ever put into the two lists of sixteen.
AT, NEXT, LAST, EDGES, VERTICES = 0, 1, 2, 3, 4


@inlined
def _varint(data: ByteArray, at: Whole, end: Whole) -> tuple[Whole, Whole]:
    """An unsigned number of up to five bytes and where reading goes on, or -1."""
    value = np.int64(0)
    for shift in range(0, 35, 7):
        if at >= end:
            return np.int64(0), np.int64(-1)
        byte = np.int64(data[at])
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value & WRAP, np.int64(at)
    return np.int64(0), np.int64(-1)


@kernel
def indices(arena: ByteArray, data: ByteArray, count: Whole, out: WordArray) -> Whole:
    """Decode `count` indices of any kind into out, (count,)."""
    if len(data) < 1 or data[0] != 0xD1:
        return HEADER
    end = len(data) - 4
    if end < 1:
        return CUT
    last = zeros(arena, 2, np.int64)
    at: Whole = np.int64(1)
    for i in range(count):
        value, at = _varint(data, at, end)
        if at < 0:
            return CUT
        delta = ~(value >> 2) if value & 2 else value >> 2
        last[value & 1] = (last[value & 1] + delta) & WRAP
        out[i] = last[value & 1]
    return 0 if at == end else TAIL


@inlined
def _new(state: State) -> Whole:
    """The next new vertex."""
    vertex = state[NEXT]
    state[NEXT] = (vertex + 1) & WRAP
    return np.int64(vertex)


@inlined
def _explicit(data: ByteArray, end: Whole, state: State) -> Whole:
    """A vertex given by its distance from the last such one, or -1."""
    value, at = _varint(data, state[AT], end)
    if at < 0:
        return np.int64(-1)
    state[AT] = at
    state[LAST] = (state[LAST] + (~(value >> 1) if value & 1 else value >> 1)) & WRAP
    return np.int64(state[LAST])


@inlined
def _keep_vertex(vertices: State, state: State, vertex: Whole) -> None:
    vertices[state[VERTICES] & 15] = vertex
    state[VERTICES] += 1


@inlined
def _keep_edge(edges: State, state: State, a: Whole, b: Whole) -> None:
    edges[state[EDGES] & 15, 0] = a
    edges[state[EDGES] & 15, 1] = b
    state[EDGES] += 1


@inlined
def _on_edge(
    data: ByteArray,
    end: Whole,
    code: Whole,
    state: State,
    edges: State,
    vertices: State,
    abc: State,
) -> Whole:
    """A triangle on a recent edge; the status."""
    low = code & 15
    if code >> 4 >= state[EDGES]:
        return REFERENCE
    edge = (state[EDGES] - 1 - (code >> 4)) & 15
    abc[0], abc[1] = edges[edge, 0], edges[edge, 1]
    if 0 < low < 13:
        if low >= state[VERTICES]:
            return REFERENCE
        abc[2] = vertices[(state[VERTICES] - 1 - low) & 15]
        return 0
    if low == 0:
        abc[2] = _new(state)
    elif low == 15:
        abc[2] = _explicit(data, end, state)
        if abc[2] < 0:
            return CUT
    else:
        state[LAST] = (state[LAST] + (-1 if low == 13 else 1)) & WRAP
        abc[2] = state[LAST]
    _keep_vertex(vertices, state, abc[2])
    return 0


@inlined
def _on_its_own(
    data: ByteArray, end: Whole, ways: State, state: State, vertices: State, abc: State
) -> Whole:
    """A triangle whose corners come each its own way: 0 new, 15 explicit, else recent; the status."""
    for j in range(3):
        if ways[j] == 0:
            abc[j] = _new(state)
        elif ways[j] == 15:
            abc[j] = _explicit(data, end, state)
            if abc[j] < 0:
                return CUT
        else:
            if ways[j] > state[VERTICES]:
                return REFERENCE
            abc[j] = vertices[(state[VERTICES] - ways[j]) & 15]
    for j in range(3):
        if ways[j] == 0 or ways[j] == 15:
            _keep_vertex(vertices, state, abc[j])
    return 0


@inlined
def _ways(data: ByteArray, end: Whole, low: Whole, state: State, ways: State) -> Whole:
    """How the corners of a triangle on its own are given; the status."""
    ways[0] = 15 if low == 15 else 0
    if low < 14:
        pair = np.int64(data[end + low])
        if pair >> 4 == 15 or pair & 15 == 15:
            return REFERENCE
    else:
        if state[AT] >= end:
            return CUT
        pair = np.int64(data[state[AT]])
        state[AT] += 1
        if pair == 0:
            state[NEXT] = 0
    ways[1], ways[2] = pair >> 4, pair & 15
    return 0


@kernel
def triangles(arena: ByteArray, data: ByteArray, count: Whole, out: WordArray) -> Whole:
    """Decode `count` / 3 triangles into out, (count,)."""
    if len(data) < 1 or data[0] != 0xE1:
        return HEADER
    end = len(data) - 16
    state = zeros(arena, 5, np.int64)
    state[AT] = 1 + count // 3
    if state[AT] > end:
        return CUT
    edges, vertices = zeros(arena, (16, 2), np.int64), zeros(arena, 16, np.int64)
    abc, ways = zeros(arena, 3, np.int64), zeros(arena, 3, np.int64)
    for t in range(count // 3):
        code = np.int64(data[1 + t])
        if code >> 4 < 15:
            status = _on_edge(data, end, code, state, edges, vertices, abc)
        else:
            status = _ways(data, end, code & 15, state, ways)
            if status == 0:
                status = _on_its_own(data, end, ways, state, vertices, abc)
            if status == 0:
                _keep_edge(edges, state, abc[1], abc[0])
        if status != 0:
            return status
        for j in range(3):
            out[3 * t + j] = abc[j]
        _keep_edge(edges, state, abc[2], abc[1])
        _keep_edge(edges, state, abc[0], abc[2])
    return 0 if state[AT] == end else TAIL

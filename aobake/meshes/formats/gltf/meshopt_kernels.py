"""Compiled loops of the meshopt decoder for vertices: bytes in, bytes out, every read checked.

A status is 0 for a whole stream, else one of the constants below.
Source: KHR_meshopt_compression, appendix A, mode 0, by A. Kapoulkine and others.

Tried: one element after the other and its four bytes within, instead of one byte of all elements after the
other, 1.06 of the processor seconds (vertex streams of two small models). The kernel takes 6 and 13 % of
reading them, at 80 to 100 MB/s of what comes out.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.arena import zeros
from aobake.tracing.compiled import inlined, kernel

__all__ = ["CUT", "HEADER", "REFERENCE", "TAIL", "attributes"]

HEADER, CUT, TAIL, REFERENCE = 1, 2, 3, 4

ByteArray = NDArray[np.uint8]
Whole: TypeAlias = int | np.int64  # what a compiled loop takes for a whole number

BLOCK_BYTES = 8192
MOST_IN_BLOCK = 256
GROUP = 16
ZERO, LITERAL = 2, 3  # control modes of version 1 that hold no groups


@inlined
def _group(data: ByteArray, at: Whole, bits: Whole, out: ByteArray, start: Whole) -> Whole:
    """Sixteen deltas of `bits` bits each, sentinels followed by whole bytes; where reading goes on, or -1."""
    if bits == 0:
        for i in range(GROUP):  # loops, not slices: these take seconds to compile
            out[start + i] = 0
        return at
    if at + 2 * bits > len(data):
        return -1
    if bits == 8:
        for i in range(GROUP):
            out[start + i] = data[at + i]
        return at + GROUP
    extra = at + 2 * bits
    sentinel = (1 << bits) - 1
    each = 8 // bits
    for i in range(GROUP):
        place = i % each
        shift = place if bits == 1 else 8 - bits * (place + 1)
        value = (data[at + i // each] >> shift) & sentinel
        if value == sentinel:
            if extra >= len(data):
                return -1
            value = data[extra]
            extra += 1
        out[start + i] = value
    return extra


@inlined
def _bytes(data: ByteArray, at: Whole, count: Whole, mode: Whole, out: ByteArray) -> Whole:
    """The deltas of one byte of all elements of a block; where reading goes on, or -1.

    mode : 0 and 1 as the control modes of version 1, -1 for version 0
    """
    groups = (count + GROUP - 1) // GROUP
    header = at
    at += (groups + 3) // 4
    if at > len(data):
        return -1
    for group in range(groups):
        code = (data[header + group // 4] >> (2 * (group % 4))) & 3
        if mode == 0:
            bits = (1 << code) >> 1
        elif mode == 1:
            bits = 1 << code
        else:
            bits = 0 if code == 0 else 1 << code
        at = _group(data, at, bits, out, group * GROUP)
        if at < 0:
            return -1
    return at


@inlined
def _byte_deltas(
    deltas: ByteArray, count: Whole, last: ByteArray, out: ByteArray, first: Whole, stride: Whole
) -> None:
    """Channel mode 0: each of four bytes is a difference of its own."""
    for j in range(4):
        value = np.int64(last[j])
        for i in range(count):
            d = np.int64(deltas[j, i])
            value = (value + ((d >> 1) ^ -(d & 1))) & 0xFF
            out[first + i * stride + j] = value
        last[j] = value


@inlined
def _short_deltas(
    deltas: ByteArray, count: Whole, last: ByteArray, out: ByteArray, first: Whole, stride: Whole
) -> None:
    """Channel mode 1: differences of two 16-bit numbers."""
    for j in range(0, 4, 2):
        value = np.int64(last[j]) | np.int64(last[j + 1]) << 8
        for i in range(count):
            d = np.int64(deltas[j, i]) | np.int64(deltas[j + 1, i]) << 8
            value = (value + ((d >> 1) ^ -(d & 1))) & 0xFFFF
            out[first + i * stride + j] = value & 0xFF
            out[first + i * stride + j + 1] = value >> 8
        last[j] = value & 0xFF
        last[j + 1] = value >> 8


@inlined
def _word_deltas(
    deltas: ByteArray,
    count: Whole,
    turn: Whole,
    last: ByteArray,
    out: ByteArray,
    first: Whole,
    stride: Whole,
) -> None:
    """Channel mode 2: exclusive or of 32-bit numbers, turned by some bits."""
    value = np.int64(0)
    for j in range(4):
        value |= np.int64(last[j]) << (8 * j)
    for i in range(count):
        d = np.int64(0)
        for j in range(4):
            d |= np.int64(deltas[j, i]) << (8 * j)
        value ^= ((d >> turn) | (d << (32 - turn))) & 0xFFFFFFFF
        for j in range(4):
            out[first + i * stride + j] = (value >> (8 * j)) & 0xFF
    for j in range(4):
        last[j] = (value >> (8 * j)) & 0xFF


@inlined
def _four_bytes(
    data: ByteArray, at: Whole, end: Whole, block: Whole, control: Whole, deltas: ByteArray
) -> Whole:
    """The deltas of four bytes of all elements of a block; where reading goes on, or -1.

    control : a control byte of version 1, two bits for each of the four; -1 for version 0
    """
    for j in range(4):
        mode = -1 if control < 0 else (control >> (2 * j)) & 3
        if mode == LITERAL:
            if at + block > end:
                return -1
            for i in range(block):
                deltas[j, i] = data[at + i]
            at += block
        elif mode == ZERO:
            for i in range(block):
                deltas[j, i] = 0
        else:
            at = _bytes(data, at, block, mode, deltas[j])
            if at < 0 or at > end:
                return -1
    return at


@inlined
def _block(
    data: ByteArray,
    at: Whole,
    end: Whole,
    block: Whole,
    modes: ByteArray,
    last: ByteArray,
    out: ByteArray,
    stride: Whole,
    deltas: ByteArray,
) -> Whole:
    """Decode a block of elements into the front of out; where reading goes on, or -1.

    modes : a channel mode for each four bytes; empty for version 0
    """
    control = at
    at += len(modes)
    if at > end:
        return -1
    for k in range(0, stride, 4):
        old = len(modes) == 0
        at = _four_bytes(
            data, at, end, block, -1 if old else np.int64(data[control + k // 4]), deltas
        )
        if at < 0:
            return -1
        channel = np.int64(0) if old else np.int64(modes[k // 4])
        if channel & 3 == 0:
            _byte_deltas(deltas, block, last[k:], out, k, stride)
        elif channel & 3 == 1:
            _short_deltas(deltas, block, last[k:], out, k, stride)
        else:
            _word_deltas(deltas, block, channel >> 4, last[k:], out, k, stride)
    return at


@kernel
def attributes(
    arena: ByteArray, data: ByteArray, count: Whole, stride: Whole, out: ByteArray
) -> Whole:
    """Decode `count` elements of `stride` bytes into out, (count * stride,); versions 0 and 1."""
    if len(data) < 1 or (data[0] != 0xA0 and data[0] != 0xA1):
        return HEADER
    version = data[0] & 1
    channels = stride // 4 if version == 1 else 0
    tail = max(stride + channels, 24 if version == 1 else 32)
    end = len(data) - tail
    if end < 1:
        return CUT
    last, modes = zeros(arena, stride, np.uint8), zeros(arena, channels, np.uint8)
    for k in range(stride):
        last[k] = data[len(data) - channels - stride + k]
    for k in range(channels):
        mode = data[len(data) - channels + k]
        modes[k] = mode
        if mode & 15 > 2 or (mode & 15 < 2 and mode >> 4 != 0):
            return REFERENCE
    most = min((BLOCK_BYTES // stride) & ~15, MOST_IN_BLOCK)
    deltas = zeros(arena, (4, MOST_IN_BLOCK), np.uint8)
    at: Whole = np.int64(1)
    done: Whole = np.int64(0)
    while done < count:
        block = min(count - done, most)
        at = _block(data, at, end, block, modes, last, out[done * stride :], stride, deltas)
        if at < 0:
            return CUT
        done += block
    return 0 if at == end else TAIL

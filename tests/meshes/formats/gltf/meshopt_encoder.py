"""A small encoder of meshopt streams: as plain as the format allows, to test the decoder with.

Written from KHR_meshopt_compression, appendix A, independently of the decoder. It does not try to
compress; it picks the encodings that a test asks for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ByteArray = NDArray[np.uint8]
GROUP = 16


def zigzag(delta: NDArray[np.int64], bits: int) -> NDArray[np.int64]:
    """Signed differences, wrapped to `bits`, as unsigned numbers with the sign in the lowest bit."""
    half = 1 << (bits - 1)
    signed = (delta + half) % (2 * half) - half
    return np.where(signed < 0, ~(signed << 1), signed << 1) & (2 * half - 1)


def group(values: ByteArray, bits: int) -> bytes:
    """Sixteen values of `bits` bits; those that do not fit follow as bytes."""
    if bits == 0:
        assert not values.any()
        return b""
    if bits == 8:
        return values.tobytes()
    sentinel = (1 << bits) - 1
    small = np.minimum(values, sentinel).astype(int)
    rows = small.reshape(-1, 8 // bits)
    each = 8 // bits
    places = np.arange(each) if bits == 1 else np.arange(each)[::-1]
    stored = (rows << (bits * places)).sum(axis=1).astype(np.uint8)
    extra = values[small == sentinel].tobytes()
    return bytes(stored.tobytes() + extra)


def channel(column: ByteArray, choices: tuple[int, ...]) -> bytes:
    """The values of one byte of all elements of a block, each group with the next of the choices that fits."""
    padded = np.concatenate([column, np.zeros(-len(column) % GROUP, np.uint8)]).reshape(-1, GROUP)
    codes, body = [], b""
    for number, row in enumerate(padded):
        code = number % 4
        if choices[code] == 0 and row.any():
            code = 3
        codes.append(code)
        body += group(row, choices[code])
    codes += [0] * (-len(codes) % 4)
    head = bytes(
        sum(code << (2 * k) for k, code in enumerate(codes[i : i + 4]))
        for i in range(0, len(codes), 4)
    )
    return head + body


def deltas(data: ByteArray, last: ByteArray, mode: int, turn: int) -> ByteArray:
    """What is stored for (N, 4) bytes of a channel, given the element before."""
    rows = np.concatenate([last[None], data])
    if mode == 0:
        return zigzag(rows[1:].astype(np.int64) - rows[:-1], 8).astype(np.uint8)
    if mode == 1:
        wide = np.ascontiguousarray(rows).view("<u2").astype(np.int64)
        return zigzag(wide[1:] - wide[:-1], 16).astype("<u2").view(np.uint8)
    wide = np.ascontiguousarray(rows).view("<u4")[:, 0].astype(np.int64)
    change = wide[1:] ^ wide[:-1]
    turned = ((change << turn) | (change >> (32 - turn))) & 0xFFFFFFFF
    return turned.astype("<u4").view(np.uint8).reshape(-1, 4)


def attributes(
    data: ByteArray, version: int, control: int = 1, mode: int = 0, turn: int = 0
) -> bytes:
    """A stream of mode ATTRIBUTES for (N, stride) bytes.

    control, mode, turn : the control mode and the channel mode of every byte; version 1 only
    """
    count, stride = data.shape
    last = data[0].copy() if count else np.zeros(stride, np.uint8)
    first = last.copy()
    most = min((8192 // stride) & ~15, 256)
    bits = {0: (0, 1, 2, 4), 1: (1, 2, 4, 8)}[control] if version and control < 2 else (0, 2, 4, 8)
    stream = bytes([0xA0 | version])
    for start in range(0, count, most):
        block = data[start : start + most]
        if version:
            stream += bytes([control * 0b01010101]) * (stride // 4)
        for k in range(0, stride, 4):
            stored = deltas(block[:, k : k + 4], last[k : k + 4], mode, turn)
            for j in range(4):
                stream += (
                    stored[:, j].tobytes()
                    if version and control == 3
                    else channel(stored[:, j], bits)
                )
        last = block[-1].copy()
    tail = first.tobytes() + (bytes([mode | turn << 4]) * (stride // 4) if version else b"")
    return stream + bytes(max(0, (24 if version else 32) - len(tail))) + tail


def varint(value: int) -> bytes:
    """Seven bits to a byte, lowest first."""
    out = []
    while value > 127:
        out.append(128 | value & 127)
        value >>= 7
    return bytes([*out, value])


def indices(values: list[int]) -> bytes:
    """A stream of mode INDICES; the two baselines take turns."""
    last = [0, 0]
    stream = b"\xd1"
    for number, value in enumerate(values):
        baseline = number % 2
        delta = value - last[baseline]
        stream += varint(((delta << 1) ^ (-1 if delta < 0 else 0)) << 1 | baseline)
        last[baseline] = value
    return stream + bytes(4)


def triangles(faces: list[tuple[int, int, int]]) -> bytes:
    """A stream of mode TRIANGLES in which every corner is given explicitly."""
    last = 0
    data = b""
    for face in faces:
        data += b"\xff"
        for value in face:
            delta = value - last
            data += varint((delta << 1) ^ (-1 if delta < 0 else 0))
            last = value
    return b"\xe1" + b"\xff" * len(faces) + data + bytes(16)

"""Buffer views compressed with EXT_meshopt_compression or KHR_meshopt_compression.

Source: KHR_meshopt_compression, appendices A (streams) and B (filters).
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.formats.gltf import meshopt_index_kernels as index_kernels
from aobake.meshes.formats.gltf import meshopt_kernels as kernels
from aobake.meshes.formats.gltf.element import Element
from aobake.tracing.arena import reserved

__all__ = ["decompress"]

Stored = TypeVar("Stored", np.int8, np.int16, np.uint8, np.uint16)

MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
FILTER_STRIDES = {"NONE": range(257), "OCTAHEDRAL": (4, 8), "QUATERNION": (8,)}
FILTER_STRIDES |= {"EXPONENTIAL": range(4, 257, 4), "COLOR": (4, 8)}
PROBLEMS = {
    kernels.HEADER: "begins with a byte of no known version",
    kernels.CUT: "is cut short",
    kernels.TAIL: "goes on after its last element",
    kernels.REFERENCE: "refers to what was never written",
}
# A block of 256 elements takes a byte for each four of their bytes at least; a triangle takes one.
ELEMENTS_PER_BYTE = 1024
SCRATCH = 2048, 5  # bytes and pieces of memory: the last element, modes, and deltas of 256 elements


def decompress(stream: memoryview, packed: Element) -> memoryview:
    """The uncompressed bytes of a buffer view.

    packed : the extension of the buffer view: mode, filter, count, byteStride
    Raises InputError where the stream is cut or lies.
    """
    mode, name = packed.text("mode"), packed.text("filter", "NONE")
    count, stride = packed.integer("count"), packed.integer("byteStride")
    _check(mode, name, count, stride, packed)
    if count > ELEMENTS_PER_BYTE * len(stream):
        raise InputError(
            f"{packed.where} claims {count} elements in {len(stream)} bytes. Export it again."
        )
    data = np.frombuffer(stream, np.uint8)
    if mode == "ATTRIBUTES":
        out = np.empty(count * stride, np.uint8)
        status = kernels.attributes(reserved(*SCRATCH), data, count, stride, out)
    else:
        words = np.empty(count, np.uint32)
        decode = index_kernels.triangles if mode == "TRIANGLES" else index_kernels.indices
        status = decode(reserved(*SCRATCH), data, count, words)
        out = words.astype(np.uint16 if stride == 2 else np.uint32, copy=False).view(np.uint8)
    if status:
        raise InputError(f"{packed.where}: the stream {PROBLEMS[int(status)]}. Export it again.")
    return _filtered(out, name, stride).data.cast("B")


def _check(mode: str, name: str, count: int, stride: int, packed: Element) -> None:
    problem = ""
    if mode not in MODES:
        problem = f"its mode is {mode[:20]!r}; {', '.join(MODES)} exist"
    elif name not in FILTER_STRIDES:
        problem = f"its filter is {name[:20]!r}; {', '.join(FILTER_STRIDES)} exist"
    elif mode == "ATTRIBUTES" and (stride % 4 or not 4 <= stride <= 256):
        problem = f"its byteStride is {stride}; a multiple of 4 up to 256 is needed"
    elif mode != "ATTRIBUTES" and (stride not in (2, 4) or name != "NONE"):
        problem = f"its byteStride is {stride} and its filter {name}; 2 or 4 and none are needed"
    elif mode == "TRIANGLES" and count % 3:
        problem = f"its count is {count}; a multiple of 3 is needed"
    elif stride not in FILTER_STRIDES[name]:
        problem = f"the filter {name} does not go with a byteStride of {stride}"
    if problem:
        raise InputError(f"{packed.where}: {problem}. Export it again.")


def _filtered(data: NDArray[np.uint8], name: str, stride: int) -> NDArray[np.uint8]:
    with np.errstate(all="ignore"):
        if name == "OCTAHEDRAL":
            if stride == 4:
                return _octahedral(data.view(np.int8).reshape(-1, 4))
            return _octahedral(data.view(np.int16).reshape(-1, 4))
        if name == "QUATERNION":
            return _quaternion(data.view(np.int16).reshape(-1, 4))
        if name == "EXPONENTIAL":
            return _exponential(data.view(np.int32))
        if name == "COLOR":
            if stride == 4:
                return _color(data.reshape(-1, 4))
            return _color(data.view(np.uint16).reshape(-1, 4))
    return data


def _rounded(values: NDArray[np.float32], most: int, kind: np.dtype[Stored]) -> NDArray[Stored]:
    """Nearest whole numbers, halves away from zero, within the type; what is not finite gives 0."""
    scaled = np.nan_to_num(values * np.float32(most), nan=0.0, posinf=0.0, neginf=0.0)
    whole = np.trunc(scaled + np.copysign(np.float32(0.5), scaled))
    info = np.iinfo(kind)
    found: NDArray[Stored] = np.clip(whole, info.min, info.max).astype(kind)
    return found


def _octahedral(data: NDArray[Stored]) -> NDArray[np.uint8]:
    values = data.astype(np.float32)
    x, y = values[:, 0] / values[:, 2], values[:, 1] / values[:, 2]
    z = 1 - np.abs(x) - np.abs(y)
    fold = np.minimum(z, 0)
    x, y = x - np.copysign(fold, x), y - np.copysign(fold, y)
    unit = np.stack([x, y, z], axis=1)
    unit /= np.sqrt((unit * unit).sum(axis=1, keepdims=True))
    out = data.copy()
    out[:, :3] = _rounded(unit, np.iinfo(data.dtype).max, data.dtype)
    return out.reshape(-1).view(np.uint8)


def _quaternion(data: NDArray[np.int16]) -> NDArray[np.uint8]:
    one = (data[:, 3] | 3).astype(np.float32)
    three = data[:, :3].astype(np.float32) / one[:, None] * np.float32(np.sqrt(0.5))
    largest = np.sqrt(np.maximum(0, 1 - (three * three).sum(axis=1)))
    turned = _rounded(np.concatenate([three, largest[:, None]], axis=1), 32767, data.dtype)
    out = np.empty_like(data)
    rows = np.arange(len(data))
    for place, column in ((1, 0), (2, 1), (3, 2), (0, 3)):
        out[rows, ((data[:, 3] & 3) + place) % 4] = turned[:, column]
    return out.reshape(-1).view(np.uint8)


def _exponential(data: NDArray[np.int32]) -> NDArray[np.uint8]:
    mantissa = (data << 8) >> 8
    values: NDArray[np.float32] = np.ldexp(mantissa.astype(np.float32), data >> 24)
    return values.view(np.uint8)


def _color(data: NDArray[Stored]) -> NDArray[np.uint8]:
    y, alpha = data[:, 0].astype(np.int32), data[:, 3].astype(np.int32)
    signed = data.view(np.int8 if data.dtype == np.uint8 else np.int16).astype(np.int32)
    co, cg = signed[:, 1], signed[:, 2]
    top = np.frexp(alpha.astype(np.float64))[1]  # the place of the highest bit, counted from 1
    scale = (1 << top) - 1
    alpha &= scale >> 1
    alpha = (alpha << 1) | (alpha & 1)
    rgba = np.stack([y + co - cg, y + cg, y - co - cg, alpha], axis=1).astype(np.float32)
    most = np.iinfo(data.dtype).max
    unit = rgba / np.maximum(scale, 1).astype(np.float32)[:, None]
    return _rounded(unit, most, data.dtype).reshape(-1).view(np.uint8)

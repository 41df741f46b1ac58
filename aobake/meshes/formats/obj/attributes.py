"""Texture coordinates and colours of an OBJ file, read from its text when they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.attributes import DeferredAttributes
from aobake.meshes.formats.obj.geometry import BEYOND, Geometry, vertex_values
from aobake.meshes.formats.obj.statements import blocks
from aobake.meshes.formats.tokens import IndexArray
from aobake.meshes.scene import Attribute, FloatArray, IntArray

__all__ = ["attributes_of"]

RGB = slice(3, 6)  # v x y z r g b


def attributes_of(
    text: bytes, where: str, geometry: Geometry, triangles: IntArray
) -> DeferredAttributes:
    """TEXCOORD_0 from vt, and COLOR_0 from the vertex lines, where the file has them.

    triangles : (F, 3) int32, which corners of the file the triangles have
    Asking for one raises InputError where it cannot be read, or a corner points at what does not exist.
    """
    readers: dict[str, Callable[[], Attribute]] = {}
    if (geometry.corner_textures >= 0).any():
        textures = geometry.corner_textures
        readers["TEXCOORD_0"] = partial(_texture_coordinates, text, where, textures, triangles)
    if any(numbers >= RGB.stop for numbers in geometry.values):
        readers["COLOR_0"] = partial(_colors, text, where)
    return DeferredAttributes(readers)


def _texture_coordinates(
    text: bytes, where: str, textures: NDArray[np.int32], triangles: IntArray
) -> Attribute:
    """vt by corner, turned so that v runs down; a corner without one has that of the lower left."""
    found, _ = _columns(text, where, b"vt", slice(0, 2))
    if (worst := int(textures.max(initial=-1))) >= len(found):
        raise InputError(
            f"{where}: a face points at texture coordinates {_number(worst)}, and the file has {len(found)} (vt). "
            "Export it again."
        )
    uv = np.concatenate([found, [[0.0, 0.0]]]) * (1.0, -1.0) + (0.0, 1.0)
    rows = np.where(textures < 0, len(found), textures).astype(np.int32)
    return Attribute(values=uv, corners=rows[triangles])


def _number(row: int) -> str:
    """A row as it is written in the file."""
    return "before the first" if row == BEYOND - 1 else str(row + 1)


def _colors(text: bytes, where: str) -> Attribute:
    """r g b of the vertex lines; white where a line has none."""
    found, counts = _columns(text, where, b"v", RGB)
    if found.max(initial=0.0) > 1.0:
        found /= 255.0  # some tools count colours in bytes
    found[counts < RGB.stop] = 1.0
    return Attribute(values=found)


def _columns(
    text: bytes, where: str, keyword: bytes, columns: slice
) -> tuple[FloatArray, IndexArray]:
    """(S, k) numbers of every statement of a keyword, 0 where it has fewer, and (S,) how many it has.

    Raises InputError, with the line, for a word that is no number.
    """
    width = columns.stop - columns.start
    found, counted = [np.zeros((0, width))], [np.zeros(0, np.int64)]
    for block in blocks(text, where):
        statements = np.flatnonzero(block.keyword(keyword))
        values, counts = vertex_values(block, statements, text, where)
        begin = np.cumsum(counts) - counts
        rows = np.zeros((len(statements), width))
        for column, place in enumerate(range(columns.start, columns.stop)):
            has = counts > place
            rows[has, column] = values[begin[has] + place]
        found.append(rows)
        counted.append(counts)
    return np.concatenate(found), np.concatenate(counted)

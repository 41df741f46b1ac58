"""New texture coordinates for an OBJ file: vt lines, and the faces that use them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats.obj.geometry import Geometry
from aobake.meshes.formats.obj.statements import Block, blocks
from aobake.meshes.formats.polygons import triangle_corners
from aobake.meshes.formats.tokens import IndexArray
from aobake.meshes.lightmap import Unwrapped
from aobake.meshes.scene import FloatArray, IntArray

__all__ = ["Change", "new_coordinates", "vt_lines"]


@dataclass(frozen=True)
class Change:
    """Bytes of a text that are replaced: from start up to end."""

    start: int
    end: int
    new: bytes


def new_coordinates(
    text: bytes, geometry: Geometry, layout: Unwrapped, line_end: bytes, where: str
) -> list[Change]:
    """What gives an OBJ file the texture coordinates of a layout.

    geometry : of the text
    The new vt lines stand before the first face. Vertices and normals of the faces stay as they are
    written; a polygon whose triangles differ in the coordinates of a corner is written as triangles.
    Raises OutputError where the layout is one of other faces, and where lines have texture coordinates.
    """
    triangles = triangle_corners(geometry.positions, geometry.corners, geometry.sizes)
    corners = geometry.corners[triangles]
    if layout.faces.shape != corners.shape or (layout.source[layout.faces] != corners).any():
        raise OutputError(f"{where}: the layout is one of other faces. Bake the file as it is.")
    surfaces = np.flatnonzero(geometry.sizes > 2)
    if not len(surfaces):
        return []
    first = int(geometry.places[surfaces[0]])
    before = _count_before(text, first, where)
    faces = _Faces.of(geometry, triangles, layout.faces, before)
    lines = line_end.join([*vt_lines(layout.uv), b""])
    return [Change(first, first, lines), *_rewritten(text, faces, line_end, where)]


def vt_lines(uv: FloatArray) -> list[bytes]:
    """A vt line for each of (N, 2) coordinates whose v runs down: that of OBJ runs up."""
    return [b"vt %.8g %.8g" % (u, 1.0 - v) for u, v in uv.tolist()]


@dataclass(frozen=True, eq=False)
class _Faces:
    """Faces to be written.

    begin : (P + 1,) first corner of each polygon;  number : (C,) new coordinates of each corner, from 1
    whole : (P,) whether a polygon stays one;  triangles : (F, 3) corners, of polygon p from first_triangle[p]
    numbers : (F, 3) new coordinates of the triangles' corners, from 1
    """

    begin: IndexArray
    number: IndexArray
    whole: NDArray[np.bool_]
    first_triangle: IndexArray
    triangles: IntArray
    numbers: IndexArray

    @classmethod
    def of(cls, geometry: Geometry, triangles: IntArray, layout: IntArray, before: int) -> _Faces:
        numbers = layout.astype(np.int64) + before + 1
        number = np.zeros(len(geometry.corners), np.int64)
        number[triangles] = numbers
        counts = np.maximum(geometry.sizes - 2, 0)
        polygon = np.repeat(np.arange(len(counts)), counts)
        whole = np.ones(len(counts), np.bool_)
        whole[polygon[(number[triangles] != numbers).any(axis=1)]] = False
        begin = np.concatenate([[0], np.cumsum(geometry.sizes)])
        first = np.concatenate([[0], np.cumsum(counts)])
        return cls(begin, number, whole, first, triangles, numbers)


def _count_before(text: bytes, position: int, where: str) -> int:
    """vt lines before a position. Raises OutputError where lines (l) count them as well."""
    count = 0
    for block in blocks(text, where):
        places = block.starts[block.first] + block.offset
        count += int((block.keyword(b"vt") & (places < position)).sum())
        for line in np.flatnonzero(block.keyword(b"l")).tolist():
            if (
                b"/"
                in block.text[block.starts[block.first[line]] : block.line_ends[line]].tobytes()
            ):
                raise OutputError(
                    f"{where}: its lines (l) have texture coordinates, whose numbers would change. Write GLB."
                )
    return count


def _rewritten(text: bytes, faces: _Faces, line_end: bytes, where: str) -> Iterator[Change]:
    polygon = 0
    for block in blocks(text, where):
        statements = np.flatnonzero(block.keyword(b"f"))
        heads = block.first[statements]
        starts = block.starts[heads] + block.offset
        ends = block.ends[heads + block.words[statements] - 1] + block.offset
        written = _written(_templates(text, block, statements), faces, polygon, line_end)
        for start, end, new in zip(starts.tolist(), ends.tolist(), written, strict=False):
            if new:
                yield Change(start, end, new)
        polygon += len(statements)


def _templates(text: bytes, block: Block, statements: IndexArray) -> list[list[bytes]]:
    """Every corner of these face statements, with %d in the place of its texture coordinates."""
    found = []
    words = block.words[statements]
    index = np.repeat(block.first[statements] - np.cumsum(words) + words, words)
    index += np.arange(len(index))
    begins, ends = block.starts[index] + block.offset, block.ends[index] + block.offset
    spans = zip(begins.tolist(), ends.tolist(), strict=True)
    for count in words.tolist():
        corners = [text[start:end].split(b"/") for start, end in islice(spans, count)][1:]
        found.append(
            [
                b"%s/%%d/%s" % (c[0], c[2]) if len(c) == 3 and c[2] else c[0] + b"/%d"
                for c in corners
            ]
        )
    return found


def _written(
    polygons: list[list[bytes]], faces: _Faces, first: int, line_end: bytes
) -> Iterator[bytes]:
    """Each polygon as one face or as several; b'' for one without a triangle.

    polygons : templates of the corners of polygons from number `first` on
    """
    last = first + len(polygons)
    begin, rows = faces.begin[first : last + 1], faces.first_triangle[first : last + 1]
    number = iter(faces.number[begin[0] : begin[-1]].tolist())
    local = (
        faces.triangles[rows[0] : rows[-1]] - np.repeat(begin[:-1], np.diff(rows))[:, np.newaxis]
    )
    triangles = zip(local.tolist(), faces.numbers[rows[0] : rows[-1]].tolist(), strict=True)
    for templates, whole in zip(polygons, faces.whole[first:last].tolist(), strict=True):
        own = list(islice(number, len(templates)))
        parts = list(islice(triangles, max(len(templates) - 2, 0)))
        if not parts:
            yield b""
        elif whole:
            yield _face(templates, own)
        else:
            yield line_end.join(_face([templates[c] for c in cs], ns) for cs, ns in parts)


def _face(templates: list[bytes], numbers: list[int]) -> bytes:
    return b"f " + b" ".join([t % n for t, n in zip(templates, numbers, strict=True)])

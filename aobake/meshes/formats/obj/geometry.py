"""Vertices, normals and faces from the statements of an OBJ file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.formats.obj.refusals import (
    refuse_beyond_vertices,
    refuse_corner,
    refuse_few_numbers,
    refuse_number,
)
from aobake.meshes.formats.obj.statements import Block, arguments, blocks
from aobake.meshes.formats.tokens import IndexArray, floats, integers, word_spans
from aobake.meshes.scene import FloatArray

__all__ = ["BEYOND", "Geometry", "parse", "vertex_values"]

SLASH = ord("/")
BEYOND = 2**31 - 1  # a number that nothing has


@dataclass
class Geometry:
    """What an OBJ file holds, in its own order.

    positions : (V, 3) float64        normals : (N, 3) float64
    corners : (C,) vertex of each corner of each face, from 0
    corner_normals, corner_textures : (C,) its normal and its texture coordinates, from 0; -1 where it has none
    sizes : (F,) corners of each face     places : (F,) position of each face statement in the file
    values : how many vertices have how many numbers
    others : each further statement's keyword, and how many there are
    names : keyword -> what follows it, for those of NAMING; uses : position and name of each usemtl
    """

    positions: FloatArray
    normals: FloatArray
    corners: IndexArray
    corner_normals: IndexArray
    corner_textures: NDArray[np.int32]
    sizes: IndexArray
    places: IndexArray
    texture_coordinates: int = 0
    values: Counter[int] = field(default_factory=Counter)
    others: Counter[bytes] = field(default_factory=Counter)
    names: dict[bytes, list[bytes]] = field(default_factory=dict)
    uses: list[tuple[int, bytes]] = field(default_factory=list)


NAMING = (b"o", b"g", b"usemtl", b"mtllib")


def parse(text: bytes, where: str) -> Geometry:
    """Read every statement of an OBJ file.

    where : the file, for messages
    Raises InputError, with the line, for a word that is no number and an index that points nowhere.
    """
    parts: list[Geometry] = []
    vertices = normals = textures = 0
    for block in blocks(text, where):
        part = _part(block, text, where, (vertices, normals, textures))
        vertices += len(part.positions)
        normals += len(part.normals)
        textures += part.texture_coordinates
        parts.append(part)
    whole = Geometry(
        positions=np.concatenate([np.zeros((0, 3)), *(part.positions for part in parts)]),
        normals=np.concatenate([np.zeros((0, 3)), *(part.normals for part in parts)]),
        corners=_concatenated([part.corners for part in parts]),
        corner_normals=_concatenated([part.corner_normals for part in parts]),
        corner_textures=_concatenated([part.corner_textures for part in parts]).astype(np.int32),
        sizes=_concatenated([part.sizes for part in parts]),
        places=_concatenated([part.places for part in parts]),
        texture_coordinates=sum(part.texture_coordinates for part in parts),
    )
    for part in parts:
        whole.values += part.values
        whole.others += part.others
        whole.uses += part.uses
        for keyword, names in part.names.items():
            whole.names.setdefault(keyword, []).extend(names)
    refuse_beyond_vertices(
        whole.corners >= vertices,
        whole.corners + 1,
        np.full(len(whole.corners), vertices),
        whole.sizes,
        whole.places,
        text,
        where,
    )
    return whole


def _concatenated(parts: Sequence[NDArray[np.integer]]) -> IndexArray:
    return np.concatenate([np.zeros(0, np.int64), *parts])


def _part(block: Block, text: bytes, where: str, before: tuple[int, int, int]) -> Geometry:
    """The geometry of one block; so many vertices, normals and texture coordinates lie before it."""
    is_v, is_vn, is_vt, is_f = (block.keyword(word) for word in (b"v", b"vn", b"vt", b"f"))
    # `f` alone, and faces of one or two corners, hold no triangle; others pass them over as well.
    faces = np.flatnonzero(is_f)
    corners, corner_textures, corner_normals = _corners(block, faces, text, where)
    sizes = block.words[faces] - 1
    places = block.starts[block.first[faces]] + block.offset
    if (corners <= 0).any():
        there = np.repeat(np.cumsum(is_v)[faces] + before[0], sizes)
        resolved = np.where(corners < 0, corners + there + 1, corners)
        refuse_beyond_vertices(resolved < 1, corners, there, sizes, places, text, where)
        corners = resolved
    corner_normals = _from_first(corner_normals, np.cumsum(is_vn)[faces] + before[1], sizes)
    corner_textures = _from_first(corner_textures, np.cumsum(is_vt)[faces] + before[2], sizes)
    positions, counts = _rows(block, np.flatnonzero(is_v), text, where)
    part = Geometry(
        positions=positions,
        normals=_rows(block, np.flatnonzero(is_vn), text, where)[0],
        corners=corners - 1,
        corner_normals=corner_normals - 1,
        corner_textures=(corner_textures - 1).astype(np.int32),
        sizes=sizes,
        places=places,
        texture_coordinates=int(is_vt.sum()),
        values=counts,
    )
    _add_others(part, block, np.flatnonzero(~(is_v | is_vn | is_vt | is_f)), text)
    return part


def _from_first(written: IndexArray, before: IndexArray, sizes: IndexArray) -> IndexArray:
    """Numbers of corners from 1, those beyond all as BEYOND; before : (F,) how many there are at each face."""
    if (written < 0).any():
        resolved = written + np.repeat(before, sizes) + 1
        written = np.where(written < 0, np.where(resolved < 1, BEYOND, resolved), written)
    return np.minimum(written, BEYOND)


def _add_others(part: Geometry, block: Block, statements: IndexArray, text: bytes) -> None:
    word = block.first[statements]
    for start, end, line_end in zip(
        (block.starts[word] + block.offset).tolist(),
        (block.ends[word] + block.offset).tolist(),
        (block.line_ends[statements] + block.offset).tolist(),
        strict=True,
    ):
        keyword = text[start:end]
        part.others[keyword[:32]] += 1
        if keyword in NAMING:
            name = text[end:line_end].strip()
            part.names.setdefault(keyword, []).append(name)
            part.uses += [(start, name)] if keyword == b"usemtl" else []


def vertex_values(
    block: Block, statements: IndexArray, text: bytes, where: str
) -> tuple[NDArray[np.float64], IndexArray]:
    """All numbers of these statements, one after the other, and (S,) how many each has.

    Raises InputError for a word that is no number.
    """
    counts = block.words[statements] - 1
    values = floats(arguments(block, statements), int(counts.sum()))
    if values is None:
        refuse_number(block, statements, text, where)
    return values, counts


def _rows(
    block: Block, statements: IndexArray, text: bytes, where: str
) -> tuple[FloatArray, Counter[int]]:
    """(S, 3) the first three numbers of each statement, and how many statements have how many."""
    values, counts = vertex_values(block, statements, text, where)
    if (counts < 3).any():
        refuse_few_numbers(block, statements[counts < 3], text, where)
    begin = np.cumsum(counts) - counts
    unique, times = np.unique(counts, return_counts=True)
    return values[begin[:, None] + np.arange(3)], Counter(
        dict(zip(unique.tolist(), times.tolist(), strict=True))
    )


def _corners(
    block: Block, faces: IndexArray, text: bytes, where: str
) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Vertex, texture coordinates and normal of every corner as written.

    From 1, negative from the end; 0 for no texture coordinates and for no normal.
    """
    count = int((block.words[faces] - 1).sum())
    written = arguments(block, faces)
    if b"/" not in written:
        vertex = integers(written, count)
        if vertex is None:
            refuse_corner(block, faces, text, where)
        nothing = np.zeros(count, np.int64)
        return vertex, nothing, nothing
    found = _slashed(np.frombuffer(written, np.uint8), count)
    if found is None:
        refuse_corner(block, faces, text, where)
    return found


def _slashed(
    written: NDArray[np.uint8], count: int
) -> tuple[IndexArray, IndexArray, IndexArray] | None:
    """The same where corners are v, v/vt, v//vn or v/vt/vn, in any mixture; None where one is not."""
    slash = written == SLASH
    spaced = np.where(slash, np.uint8(32), written)
    starts, _ = word_spans(spaced)
    numbers = integers(spaced.tobytes(), len(starts))
    corner_starts, _ = word_spans(written)
    leads = np.zeros(len(written), bool)
    leads[corner_starts] = True
    is_vertex = leads[starts]
    if numbers is None or len(corner_starts) != count or int(is_vertex.sum()) != count:
        return None
    slashes = np.cumsum(slash, dtype=np.int32)
    corner = np.cumsum(is_vertex) - 1
    slot = slashes[starts] - slashes[corner_starts][corner]
    if (slot > 2).any():
        return None
    texture, normal = np.zeros((2, count), np.int64)
    texture[corner[slot == 1]] = numbers[slot == 1]
    normal[corner[slot == 2]] = numbers[slot == 2]
    return numbers[is_vertex], texture, normal

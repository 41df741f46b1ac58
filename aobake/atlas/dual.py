"""A mesh as unwrapping sees it: welded faces that have an area, their neighbours, the price of cuts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.topology_kernels import connected
from aobake.meshes.scene import FloatArray, IntArray

__all__ = ["Dual", "Groups", "connected_groups", "dual_of", "groups_of"]

FLAT, SHARP = (
    0.95,
    0.5,
)  # cosines between normals: cuts are dear where it is flatter, cheap where sharper
CHEAPEST = 0.25  # share of its length that a cut along a crease costs


@dataclass(frozen=True, eq=False, kw_only=True)
class Dual:
    """Faces as a graph.

    vertices, faces : (V, 3) float64, (F, 3) int32, welded
    opposite : (F, 3) int32, the half-edge 3 g + l that edge k of face f shares with face g; -1: none
    cost : (F, 3) float64, what a cut along each edge costs: its length, less at a crease
    area, normal, center : (F,), (F, 3) unit length, (F, 3), float64
    """

    vertices: FloatArray
    faces: IntArray
    opposite: IntArray
    cost: FloatArray
    area: FloatArray
    normal: FloatArray
    center: FloatArray


@dataclass(frozen=True, eq=False)
class Groups:
    """Faces in groups: those of group g are order[starts[g] : starts[g + 1]].

    of : (F,) int32 the group of each face, -1 for none
    slot : (F,) int32 the place of each face within its group
    """

    of: IntArray
    order: IntArray
    starts: NDArray[np.int64]
    slot: IntArray

    def __len__(self) -> int:
        return len(self.starts) - 1

    def sizes(self) -> NDArray[np.int64]:
        """(groups,) number of faces of each."""
        return np.diff(self.starts)

    def faces(self, group: int) -> IntArray:
        """The faces of one group, in ascending order."""
        return self.order[self.starts[group] : self.starts[group + 1]]


def groups_of(of: IntArray, count: int) -> Groups:
    """Faces by their group (F,), from -1 to below count."""
    order = np.argsort(of, kind="stable").astype(np.int32)
    order = order[np.searchsorted(of[order], 0) :]
    starts = np.searchsorted(of[order], np.arange(count + 1))
    slot = np.zeros(len(of), np.int32)
    slot[order] = np.arange(len(order)) - starts[of[order]]
    return Groups(of, order, starts, slot)


def connected_groups(dual: Dual, of: IntArray) -> Groups:
    """The parts of each group (F,) that are connected across edges; -1: in no group."""
    label = np.empty(len(of), np.int32)
    return groups_of(label, connected(dual.opposite, of, np.empty_like(label), label))


def dual_of(vertices: FloatArray, faces: IntArray) -> Dual:
    """The graph of faces (F, 3) that have an area, over vertices (V, 3) that are welded.

    Faces are neighbours across an edge that exactly two of them share and run along in opposite ways.
    The back of a card, faces on the same vertices, is a sheet of its own. Empty arrays for no faces.
    """
    corners = vertices[faces]
    sides = np.roll(corners, -1, axis=1) - corners
    doubled = np.cross(sides[:, 0], sides[:, 1])
    twice = np.linalg.norm(doubled, axis=1)
    normal = doubled / np.where(twice > 0.0, twice, 1.0)[:, None]
    opposite = _opposite(faces, len(vertices))
    other = np.where(opposite >= 0, opposite // 3, np.arange(len(faces))[:, None])
    bend = np.einsum("fi,fki->fk", normal, normal[other])
    share = CHEAPEST + (1.0 - CHEAPEST) * np.clip((bend - SHARP) / (FLAT - SHARP), 0.0, 1.0)
    return Dual(
        vertices=vertices,
        faces=faces,
        opposite=opposite,
        cost=np.linalg.norm(sides, axis=2) * share,
        area=0.5 * twice,
        normal=normal,
        center=corners.mean(axis=1),
    )


def _opposite(faces: IntArray, vertices: int) -> IntArray:
    """(F, 3) the half-edge on the other side of each; -1 where there is none, or several."""
    opposite: IntArray = np.full(3 * len(faces), -1, np.int32)
    if not len(faces):
        return opposite.reshape(-1, 3)
    begin = faces.astype(np.int64).reshape(-1)
    end = np.roll(faces, -1, axis=1).astype(np.int64).reshape(-1)
    sheet = np.repeat(_sheets(faces), 3)
    key = np.minimum(begin, end) * vertices + np.maximum(begin, end)
    order = np.lexsort((sheet, key)) if sheet.any() else np.argsort(key, kind="stable")
    same = (np.diff(key[order]) == 0) & (np.diff(sheet[order]) == 0)
    same = np.concatenate([[False], same, [False]])
    first = np.flatnonzero(same[1:-1] & ~same[:-2] & ~same[2:])  # a pair, and no third
    one, two = order[first], order[first + 1]
    opposed = begin[one] != begin[two]
    opposite[one[opposed]], opposite[two[opposed]] = two[opposed], one[opposed]
    return opposite.reshape(-1, 3)


def _sheets(faces: IntArray) -> NDArray[np.int64]:
    """(F,) how many earlier faces have the same three vertices."""
    sheet = np.zeros(len(faces), np.int64)
    sides = np.sort(faces, axis=1)
    order = np.lexsort(sides.T)
    same = (np.diff(sides[order], axis=0) == 0).all(axis=1)
    if same.any():
        rows = np.arange(len(faces))
        first = np.maximum.accumulate(np.where(np.concatenate([[True], ~same]), rows, 0))
        sheet[order] = rows - first
    return sheet

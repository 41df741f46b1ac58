"""Texture coordinates that are there: whether they can hold a lightmap, and what their charts are.

They can where every place of the surface has a place of its own on the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.existing_kernels import DEEPEST, ROOM, find_partners
from aobake.atlas.topology_kernels import connected
from aobake.meshes.coincident import first_equal_row
from aobake.meshes.scene import FloatArray, IntArray

__all__ = ["Fault", "Unfolded", "Verdict", "chart_numbers", "face_areas", "judge"]

Fault = Literal["not finite", "out of range", "collapsed", "overlapping"]

BEYOND = 0.5  # texels: a clamped lookup out there still reads the texels at the border alone
COLLAPSED = 1e-6  # of the area that a face would have, were the whole page drawn to one scale
DEEP = 0.5  # texels by which triangles may lie on each other: quantised coordinates do
SHALLOW = 0.5  # of its own height, for a triangle that is smaller than that
ROUNDING = 1e-3  # texels: float32 coordinates on 8192 of them
FEW = 1e-3  # of the layout's area, that faces smaller than a texel may take up being at fault


@dataclass(frozen=True, eq=False, kw_only=True)
class Unfolded:
    """A mesh with the texture coordinates that are to be judged.

    name : what a user would call it
    corners : (F, 3, 2) float64, u and v at the corners of each face
    areas : (F,) float64 of its faces, as face_areas gives them; those of 0 do not matter
    """

    name: str
    corners: FloatArray
    areas: FloatArray


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What was found about a set of texture coordinates.

    uv_set : the n of TEXCOORD_n
    fault : the first thing that is wrong with it; None: it can hold a lightmap
    sentence : what to say of it, without a full stop: how many triangles, and which one among them
    count : how many triangles are at fault
    triangles : (index of the mesh, number of the face) of the first one at fault, and of the one that it
        overlaps
    """

    uv_set: int
    fault: Fault | None
    sentence: str
    count: int = 0
    triangles: tuple[tuple[int, int], ...] = ()


def face_areas(vertices: FloatArray, faces: NDArray[np.integer]) -> FloatArray:
    """(F,) areas of triangles; 0 where a vertex is not finite."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    with np.errstate(all="ignore"):
        areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.where(np.isfinite(areas), areas, 0.0)


def judge(unfolded: Sequence[Unfolded], uv_set: int, size: int) -> Verdict:
    """Whether meshes that share a page can be baked into the texture coordinates they have.

    uv_set : the n of TEXCOORD_n, for the sentence
    size : width and height of the page, in texels; what is too small to be seen there is no fault
    In range is 0 to 1, and half a texel beyond; mirrored charts are as good as others. Triangles overlap
    where one would have to be moved by over half a texel, or by over half of its height if it is lower
    than one. What is smaller than a texel may overlap or collapse up to a thousandth of the layout, since
    coordinates of few bits fold some. Meshes without faces that matter are without fault.
    """
    corners = np.concatenate([np.zeros((0, 3, 2)), *(mesh.corners for mesh in unfolded)])
    areas = np.concatenate([np.zeros(0), *(mesh.areas for mesh in unfolded)])
    report = _Report(uv_set, unfolded, areas > 0.0)
    at_fault = report.matters & ~np.isfinite(corners).all(axis=(1, 2))
    if at_fault.any():
        return report.verdict("not finite", at_fault, "have coordinates that are not finite")
    off = BEYOND / size
    at_fault = report.matters & ((corners < -off) | (corners > 1.0 + off)).any(axis=(1, 2))
    if at_fault.any():
        return report.verdict("out of range", at_fault, "reach beyond 0 to 1")
    flat = np.where(report.matters[:, None], corners.reshape(-1, 6) * size, 0.0)
    covered = _areas_in_texels(flat)
    at_fault = _collapsed(covered, areas)
    if at_fault.any():
        return report.verdict("collapsed", at_fault, "have no area there")
    partner = _overlaps(flat, covered)
    if (partner >= 0).any():
        return report.verdict("overlapping", partner >= 0, "overlap others", partner)
    sentence = f"TEXCOORD_{uv_set} is in range and free of overlaps"
    return Verdict(uv_set=uv_set, fault=None, sentence=sentence)


def chart_numbers(corners: FloatArray, faces: IntArray, usable: NDArray[np.bool_]) -> IntArray:
    """(F,) int32, the chart of each face, from 0 in the order of their first faces; -1: not usable.

    corners : (F, 3, 2) float64 texture coordinates
    faces : (F, 3), vertices of the mesh, the same number for all that are at one place
    Faces are in one chart where they share an edge of the mesh that has the same coordinates on both sides.
    """
    chosen = np.flatnonzero(usable)
    ends = np.concatenate([corners[chosen], faces[chosen, :, None]], axis=2).reshape(-1, 3)
    end = first_equal_row(ends).reshape(-1, 3)
    edges = np.stack([end, np.roll(end, -1, axis=1)], axis=2).reshape(-1, 2)
    first = first_equal_row(np.sort(edges, axis=1).astype(np.uint32))
    order = np.argsort(first, kind="stable")  # edges that are the same follow each other
    following, same = np.roll(order, -1), first[order] == np.roll(first[order], -1)
    across = np.empty(len(first), np.int32)
    across[order] = np.where(same, following, first[order])  # and form a ring
    numbers = np.full(len(faces), -1, np.int32)
    found = np.full(len(chosen), -1, np.int32)
    connected(across.reshape(-1, 3), np.zeros(len(chosen), np.int32), np.empty_like(found), found)
    numbers[chosen] = found
    return numbers


@dataclass(frozen=True, eq=False)
class _Report:
    """How triangles are named: matters (F,) bool over the faces of all meshes in a row."""

    uv_set: int
    unfolded: Sequence[Unfolded]
    matters: NDArray[np.bool_]

    def verdict(
        self,
        fault: Fault,
        at_fault: NDArray[np.bool_],
        finding: str,
        partner: IntArray | None = None,
    ) -> Verdict:
        """The verdict on the triangles at fault, with the first of them named."""
        count, first = int(at_fault.sum()), int(np.argmax(at_fault))
        numbers = [first] if partner is None else [first, int(partner[first])]
        triangles = tuple(self._triangle(number) for number in numbers)
        named = [
            f"triangle {face} of {self.unfolded[mesh].name or f'mesh {mesh}'}"
            for mesh, face in triangles
        ]
        of = f"{count:,} of {int(self.matters.sum()):,} triangles {finding}"
        return Verdict(
            uv_set=self.uv_set,
            fault=fault,
            sentence=f"TEXCOORD_{self.uv_set}: {of}, {' overlaps '.join(named)} among them",
            count=count,
            triangles=triangles,
        )

    def _triangle(self, number: int) -> tuple[int, int]:
        ends = np.cumsum([len(mesh.corners) for mesh in self.unfolded])
        mesh = int(np.searchsorted(ends, number, side="right"))
        return mesh, number - int(ends[mesh]) + len(self.unfolded[mesh].corners)


def _areas_in_texels(flat: FloatArray) -> FloatArray:
    ux, uy, vx, vy = (flat[:, 2 + k] - flat[:, k % 2] for k in range(4))
    return np.asarray(0.5 * np.abs(ux * vy - uy * vx))


def _collapsed(covered: FloatArray, areas: FloatArray) -> NDArray[np.bool_]:
    """(F,) which faces take next to no area of the page; none where that is too little to matter."""
    surface, page = float(areas.sum()), float(covered.sum())
    if page < 1.0:  # no scale could be told from so little
        return areas > 0.0
    fair = areas * (page / surface)
    flat = (areas > 0.0) & (covered < COLLAPSED * fair)
    if (fair[flat] >= 1.0).any() or float(fair[flat].sum()) > max(FEW * page, 1.0):
        return flat
    return np.zeros(len(areas), bool)


def _overlaps(flat: FloatArray, covered: FloatArray) -> IntArray:
    """(F,) int32, a triangle that each one lies on; all -1 where that is too little to matter."""
    sides = np.stack([flat, np.roll(flat, -2, axis=1)]).reshape(2, -1, 3, 2)
    longest = np.sqrt(((sides[1] - sides[0]) ** 2).sum(axis=2)).max(axis=1, initial=0.0)
    height = 2.0 * covered / np.where(longest > 0.0, longest, 1.0)
    partner = _partners(flat, SHALLOW * height, np.flatnonzero(height > ROUNDING))
    found = partner >= 0
    low = height <= DEEP / SHALLOW
    if (found & ~low).any() or float(covered[found].sum()) > FEW * float(covered.sum()):
        return partner
    return np.full(len(flat), -1, np.int32)


def _partners(flat: FloatArray, depths: FloatArray, chosen: NDArray[np.int64]) -> IntArray:
    """(F,) int32, a triangle that each of the chosen ones lies on, -1 for none."""
    across, up = flat[:, 0::2], flat[:, 1::2]
    boxes = np.stack([across.min(1), up.min(1), across.max(1), up.max(1)], axis=1)
    listed = np.zeros((1 + ROOM) * len(chosen), np.int32)
    listed[: len(chosen)] = chosen
    stack = np.zeros((DEEPEST, 2), np.int64)
    stack[0, 1] = len(chosen)
    partner = np.full(len(flat), -1, np.int32)
    find_partners(flat, boxes, np.maximum(depths, ROUNDING), DEEP, listed, stack, partner)
    return partner

"""The scene as the tracer sees it: conditioned, rounded to float32, in one tree.

A mesh that stands in one place is put there in float64, before it is rounded. A mesh that stands in
several is kept once, in a unit frame of its own, and instanced by Embree. So is the memory: a forest
of one tree costs one tree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from aobake.tracing import embree
from aobake.tracing.conditioning import UnitFrame, detail_at_vertices, split_long_edges, unit_frame
from aobake.tracing.embree import HitFilter

__all__ = ["Placement", "Triangles", "Watched", "World", "build_world"]

FloatArray = NDArray[np.float64]
ScalarT = TypeVar("ScalarT", bound=np.generic)
WorldArrays: TypeAlias = tuple[
    NDArray[np.float32], NDArray[np.uint32], NDArray[np.int64], NDArray[np.int64], int,
    NDArray[np.int64], FloatArray, FloatArray,
]  # fmt: skip

SLACK = 8 * 2.0**-24  # of a transform's reach: Embree applies it in float32, to the ray
# Rays of a point, squared, for each triangle, from which on neighbouring rays meet much the same boxes of the tree:
# Embree then follows a packet together. Its rate over that of each ray by itself, scans, sixteen lanes: 4,000
# triangles 1.09 at 256 rays (0.99 at 128), 16,000 1.23 at 512 (1.01 at 256), 70,000 1.20 at 1,024 (0.97 at
# 256), 280,000 1.08 at 1,024 (0.85 at 256). The same rays are found occluded. Nearest hits differ in last
# bits, and filters are asked about a hit more than once, so that only plain surfaces are traced so.
COHERENT = 4


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles in a space of their own.

    vertices : (V, 3) float64; faces with a vertex that is not finite must have been left out
    faces : (F, 3) uint32
    hit_filter : decides which hits on these triangles count; None: all do. With data of its own for each
        triangle they are traced as they are: large ones are not split
    """

    vertices: FloatArray
    faces: NDArray[np.uint32]
    hit_filter: HitFilter | None = None


@dataclass(frozen=True, eq=False)
class Placement:
    """Triangles number `part`, placed by a finite (3, 4) float64 transform."""

    part: int
    transform: FloatArray


@dataclass(frozen=True, eq=False)
class Watched:
    """A few (P, 3) float64 points that will be asked for, and how fine what is around them may be."""

    positions: FloatArray
    detail: float


@dataclass(frozen=True, eq=False)
class World:
    """A built scene.

    tree : Embree's
    frame : from the scene's space to the tree's
    arrays : what origins.py looks triangles up in: vertices (N, 3) float32, faces (M, 3) uint32, first
        vertex and first face of each body, number of bodies that stand where they are, body of each
        instance behind those, transforms (3 I, 4) float64 and slack (I,) of each instance
    triangles : those of all instances
    filtered : whether there are surfaces of which some hits do not count, or count in part
    """

    tree: embree.Tree
    frame: UnitFrame
    arrays: WorldArrays
    triangles: int
    filtered: bool

    def keeps_together(self, rays: float) -> bool:
        """Whether Embree had better follow neighbouring ones of so many rays of a point together."""
        return not self.filtered and rays**2 >= COHERENT * self.triangles


@dataclass(frozen=True, eq=False)
class _Body:
    """Conditioned triangles that become one geometry of Embree's."""

    vertices: FloatArray
    faces: NDArray[np.uint32]
    hit_filter: HitFilter | None


def build_world(
    parts: Sequence[Triangles],
    placements: Sequence[Placement],
    center: FloatArray | None = None,
    watched: Watched | None = None,
) -> World:
    """Condition and build what stands in a scene. Raises EngineError.

    center : (3,) float64, where coordinates are to be finest; None: amid the vertices
    watched : points besides the vertices that large triangles must not blur; or None
    """
    uses = np.bincount(np.array([p.part for p in placements], np.int64), minlength=len(parts))
    instanced = [
        bool(uses[p.part] > 1) and _can_be_instanced(p.transform, parts[p.part].hit_filter)
        for p in placements
    ]
    fixed = [p for p, shared in zip(placements, instanced, strict=True) if not shared]
    moving = [p for p, shared in zip(placements, instanced, strict=True) if shared]
    clouds = [_place(p.transform, _spread(parts[p.part])) for p in placements]
    frame = unit_frame(clouds, center)
    bodies = _fixed_bodies(parts, fixed, moving, frame, watched)
    kept = sorted({p.part for p in moving})
    frames = {number: unit_frame([_spread(parts[number])]) for number in kept}
    for number in kept:
        part = parts[number]
        bodies.append(_Body(frames[number].apply(part.vertices), part.faces, part.hit_filter))
    arrays = _pool(bodies, len(bodies) - len(kept), *_instances(moving, kept, frames, frame))
    triangles = sum(len(parts[p.part].faces) for p in placements)
    filtered = any(body.hit_filter is not None for body in bodies)
    return World(_tree(bodies, arrays), frame, arrays, triangles, filtered)


def _can_be_instanced(transform: FloatArray, hit_filter: HitFilter | None) -> bool:
    """Whether an instance can have this transform; otherwise its triangles are put in place.

    One that flattens has no inverse. One that mirrors shows a filter function that tells sides a space
    in which fronts are backs.
    """
    linear = transform[:, :3]
    size = float(np.abs(linear).max())
    volume = float(np.linalg.det(linear / size)) if size > 0.0 else 0.0
    sided = hit_filter is not None and hit_filter.sided
    return abs(volume) > 1e-6 and not (sided and volume < 0.0)


def _place(transform: FloatArray, points: FloatArray) -> FloatArray:
    """(N, 3) points where the transform puts them; untouched by the identity, to the last bit."""
    if np.array_equal(transform, np.eye(3, 4)):
        return points
    return points @ transform[:, :3].T + transform[:, 3]


def _spread(part: Triangles) -> FloatArray:
    """The vertices that faces use, without the others, which may lie anywhere."""
    used = np.zeros(len(part.vertices), bool)
    used[part.faces.reshape(-1)] = True
    return part.vertices if used.all() else part.vertices[used]


def _as_they_are(part: Triangles) -> bool:
    """Whether a filter knows these triangles by their numbers, so that each has to stay one."""
    return part.hit_filter is not None and part.hit_filter.data is not None


def _fixed_bodies(
    parts: Sequence[Triangles],
    fixed: Sequence[Placement],
    moving: Sequence[Placement],
    frame: UnitFrame,
    watched: Watched | None,
) -> list[_Body]:
    """What stands where it is: one body per filter with large triangles split, others as they are."""
    placed = [frame.apply(_place(p.transform, parts[p.part].vertices)) for p in [*fixed, *moving]]
    sizes = [
        detail_at_vertices(at, parts[p.part].faces)
        for at, p in zip(placed, [*fixed, *moving], strict=True)
    ]
    details = list(placed)
    if watched is not None:
        details.append(frame.apply(watched.positions))
        sizes.append(np.full(len(watched.positions), watched.detail * frame.scale))
    standing = [(at, parts[p.part]) for at, p in zip(placed, fixed, strict=False)]
    bodies = [_Body(at, part.faces, part.hit_filter) for at, part in standing if _as_they_are(part)]
    plain = [(at, part) for at, part in standing if not _as_they_are(part)]
    for hit_filter in dict.fromkeys(part.hit_filter for _, part in plain):
        split = [
            split_long_edges(at, part.faces, details, sizes)
            for at, part in plain
            if part.hit_filter is hit_filter
        ]
        first = np.cumsum([0, *(len(vertices) for vertices, _ in split)])
        faces = [
            faces + np.uint32(start) if start else faces
            for (_, faces), start in zip(split, first, strict=False)
        ]
        bodies.append(_Body(_joined([v for v, _ in split]), _joined(faces), hit_filter))
    return bodies


def _joined(arrays: list[NDArray[ScalarT]]) -> NDArray[ScalarT]:
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _instances(
    moving: Sequence[Placement],
    kept: Sequence[int],
    frames: Mapping[int, UnitFrame],
    frame: UnitFrame,
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Which kept body each instance is, its (3, 4) transform from that body's frame, its slack."""
    matrices = np.empty((len(moving), 3, 4))
    for number, placement in enumerate(moving):
        own = frames[placement.part]
        linear, shift = placement.transform[:, :3], placement.transform[:, 3]
        matrices[number, :, :3] = linear * (frame.scale / own.scale)
        matrices[number, :, 3] = (linear @ own.center + shift - frame.center) * frame.scale
    reach = np.abs(matrices).sum(axis=2).max(axis=1) if len(moving) else np.zeros(0)
    body = np.array([kept.index(p.part) for p in moving], np.int64)
    return body, matrices, SLACK * reach


def _pool(
    bodies: Sequence[_Body],
    fixed: int,
    instances: NDArray[np.int64],
    matrices: FloatArray,
    slacks: FloatArray,
) -> WorldArrays:
    """All bodies in one pair of float32 and uint32 buffers, with room for Embree to read ahead."""
    first_vertex = np.cumsum([0, *(len(body.vertices) for body in bodies)])
    first_face = np.cumsum([0, *(len(body.faces) for body in bodies)])
    spare = -(-embree.READ_AHEAD_BYTES // embree.VERTEX_BYTES)
    vertices = np.zeros((first_vertex[-1] + spare, 3), np.float32)
    faces = np.zeros((first_face[-1], 3), np.uint32)
    for number, body in enumerate(bodies):
        with np.errstate(over="ignore"):  # vertices that no face uses may lie anywhere
            vertices[first_vertex[number] : first_vertex[number + 1]] = body.vertices
        faces[first_face[number] : first_face[number + 1]] = body.faces
    rows = matrices.reshape(-1, 4)
    return vertices, faces, first_vertex, first_face, fixed, instances, rows, slacks


def _tree(bodies: Sequence[_Body], arrays: WorldArrays) -> embree.Tree:
    vertices, faces, first_vertex, first_face, fixed, instances, rows, _ = arrays
    matrices = rows.reshape(-1, 3, 4)
    geometry = [
        embree.Body(
            vertices[first_vertex[k] : first_vertex[k + 1]],
            faces[first_face[k] : first_face[k + 1]],
            body.hit_filter,
        )
        for k, body in enumerate(bodies)
    ]
    placed = list(zip(instances.tolist(), matrices.astype(np.float32), strict=True))
    return embree.build_tree(geometry[:fixed], geometry[fixed:], placed)

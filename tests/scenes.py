"""Meshes to test on: boxes, spheres, patches, and what can be done to them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake import Mesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

ORIGIN = np.zeros(3)
UP = np.array([0.0, 0.0, 1.0])
FAR = 1e4  # half size of what stands for an endless plane
WIDE = 1e3  # the same, where a scene must not be so large


# A cube of quadrangles, as an OBJ file.
CUBE_OBJ = """v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 1 5 8 4\n"""


class Triangles(NamedTuple):
    """vertices : (V, 3) float64; faces : (F, 3) int32, counter-clockwise as seen from the front"""

    vertices: FloatArray
    faces: IntArray


def unit(vector: ArrayLike) -> FloatArray:
    """(3,) vector at length 1."""
    v = np.asarray(vector, np.float64)
    return v / np.linalg.norm(v)


def rotation(axis: ArrayLike, angle: float) -> FloatArray:
    """(3, 3) rotation about an axis. Source: O. Rodrigues, 1840."""
    x, y, z = unit(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)


TURNED = rotation((1.0, 2.0, 3.0), 0.7)  # an attitude without the luck of the axes


def affine(linear: ArrayLike = 1.0, shift: ArrayLike = 0.0) -> FloatArray:
    """(4, 4) transform x -> linear x + shift; a number scales."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.asarray(linear, np.float64) * (np.eye(3) if np.ndim(linear) == 0 else 1.0)
    matrix[:3, 3] = shift
    return matrix


def mesh_of(triangles: Triangles, **more: object) -> Mesh:
    """A mesh of aobake with whatever else is given."""
    return Mesh(vertices=triangles.vertices, faces=triangles.faces, **more)  # type: ignore[arg-type]


def obj_text(mesh: Triangles) -> str:
    """An OBJ file of one mesh."""
    vertices = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in mesh.vertices]
    faces = [f"f {a} {b} {c}" for a, b, c in np.asarray(mesh.faces) + 1]
    return "\n".join([*vertices, *faces]) + "\n"


def joined(*parts: Triangles) -> Triangles:
    """Several meshes as one; nothing is welded."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])[:-1]
    faces = [part.faces + start for part, start in zip(parts, starts, strict=True)]
    return Triangles(
        np.concatenate([p.vertices for p in parts]), np.concatenate(faces).astype(np.int32)
    )


def moved(mesh: Triangles, linear: ArrayLike = 1.0, shift: ArrayLike = 0.0) -> Triangles:
    """The mesh after x -> linear x + shift; a number scales."""
    matrix = affine(linear, shift)
    return Triangles(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], mesh.faces)


def flipped(mesh: Triangles) -> Triangles:
    """The same faces, wound the other way round."""
    return Triangles(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]))


def unwelded(mesh: Triangles) -> Triangles:
    """The same faces, each with three vertices of its own: an angle between faces splits their normals."""
    count = 3 * len(mesh.faces)
    return Triangles(
        mesh.vertices[mesh.faces.reshape(-1)], np.arange(count, dtype=np.int32).reshape(-1, 3)
    )


def patch(
    a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike, nu: int = 1, nv: int = 1
) -> Triangles:
    """The quadrangle a b c d in nu x nv cells, facing (b - a) x (d - a); vertex i (nv + 1) + j."""
    u = np.linspace(0.0, 1.0, nu + 1)[:, None, None]
    v = np.linspace(0.0, 1.0, nv + 1)[None, :, None]
    corners = [np.asarray(x, np.float64) for x in (a, b, c, d)]
    weights = ((1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v)
    vertices = sum((w * x for w, x in zip(weights, corners, strict=True)), np.zeros(3)).reshape(
        -1, 3
    )
    k = (np.arange(nu)[:, None] * (nv + 1) + np.arange(nv)).reshape(-1)
    lower = np.stack([k, k + nv + 1, k + nv + 2], axis=1)
    upper = np.stack([k, k + nv + 2, k + 1], axis=1)
    return Triangles(np.asarray(vertices), np.concatenate([lower, upper]).astype(np.int32))


def floor(half: float = FAR, height: float = 0.0, cells: int = 1) -> Triangles:
    """A square that looks up, [-half, half]^2 at a height."""
    x = half
    return patch((-x, -x, height), (x, -x, height), (x, x, height), (-x, x, height), cells, cells)


def right_angle(size: float, cells: int = 4) -> Triangles:
    """A floor at z = 0 and a wall at x = 0, squares that share an edge and look at each other; not welded."""
    s = size
    return joined(
        patch((0, 0, 0), (s, 0, 0), (s, s, 0), (0, s, 0), cells, cells),
        patch((0, 0, 0), (0, s, 0), (0, s, s), (0, 0, s), cells, cells),
    )


BOX_SIDES = {
    "-x": (0, 4, 6, 2), "+x": (1, 3, 7, 5), "-y": (0, 1, 5, 4),
    "+y": (2, 6, 7, 3), "-z": (0, 2, 3, 1), "+z": (4, 5, 7, 6),
}  # fmt: skip


def box(
    low: ArrayLike = (-0.5, -0.5, -0.5),
    high: ArrayLike = (0.5, 0.5, 0.5),
    without: tuple[str, ...] = (),
) -> Triangles:
    """A box that looks outward, its eight corners welded (corner k is at the high end of axis i if bit i is set)."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    quads = [corners for side, corners in BOX_SIDES.items() if side not in without]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return Triangles(np.where(bits == 1, high, low), np.array(faces, np.int32))


def icosphere(
    subdivisions: int, radius: float = 1.0, center: ArrayLike = (0.0, 0.0, 0.0)
) -> Triangles:
    """A sphere of 20 * 4^subdivisions faces that looks outward."""
    g = (1.0 + math.sqrt(5.0)) / 2.0
    corners: list[tuple[float, float, float]] = [
        (-1, g, 0),
        (1, g, 0),
        (-1, -g, 0),
        (1, -g, 0),
        (0, -1, g),
        (0, 1, g),
    ]
    corners += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    vertices = np.array(corners, np.float64) / math.hypot(1.0, g)
    faces = np.array([(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4),
                      (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8),
                      (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)])  # fmt: skip
    for _ in range(subdivisions):
        vertices, faces = _subdivided(vertices, faces)
        vertices = vertices / np.linalg.norm(vertices, axis=1)[:, None]
    return Triangles(radius * vertices + np.asarray(center, np.float64), faces.astype(np.int32))


def subdivided(mesh: Triangles) -> Triangles:
    """Each face cut into four at the middles of its edges; the first vertices stay as they are."""
    vertices, faces = _subdivided(mesh.vertices, mesh.faces.astype(np.int64))
    return Triangles(vertices, faces.astype(np.int32))


def _subdivided(
    vertices: FloatArray, faces: NDArray[np.int64]
) -> tuple[FloatArray, NDArray[np.int64]]:
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, which = np.unique(sides, axis=0, return_inverse=True)
    x, y, z = (which.reshape(-1) + len(vertices)).reshape(3, -1)
    a, b, c = faces.T
    parts = [np.stack(corners, axis=1) for corners in ((a, x, z), (b, y, x), (c, z, y), (x, y, z))]
    middles = 0.5 * (vertices[edges[:, 0]] + vertices[edges[:, 1]])
    return np.concatenate([vertices, middles]), np.concatenate(parts)


def ring(radius: float, height: float, segments: int) -> FloatArray:
    """(segments, 3) corners of a regular polygon about the z axis, counter-clockwise from above."""
    t = 2.0 * math.pi * np.arange(segments) / segments
    return np.stack([radius * np.cos(t), radius * np.sin(t), np.full(segments, height)], axis=1)


def disc(
    radius: float, height: float, segments: int, center: ArrayLike = (0.0, 0.0, 0.0)
) -> Triangles:
    """A regular polygon about the z axis that looks down."""
    vertices = np.concatenate([[[0.0, 0.0, height]], ring(radius, height, segments)])
    i = np.arange(segments)
    faces = np.stack([np.zeros(segments, np.int64), 1 + (i + 1) % segments, 1 + i], axis=1)
    return Triangles(vertices + np.asarray(center, np.float64), faces.astype(np.int32))


def tube(radius: float, low: float, high: float, segments: int) -> Triangles:
    """The wall of a cylinder about the z axis, looking inward, open at both ends."""
    vertices = np.concatenate([ring(radius, low, segments), ring(radius, high, segments)])
    i = np.arange(segments)
    j = (i + 1) % segments
    faces = [
        np.stack([i, i + segments, j], axis=1),
        np.stack([j, i + segments, j + segments], axis=1),
    ]
    return Triangles(vertices, np.concatenate(faces).astype(np.int32))


def hexagon_around(point: ArrayLike, normal: ArrayLike, size: float) -> Triangles:
    """A small flat piece of surface whose vertex 0 is the point: so a vertex bake asks for the point itself."""
    n = unit(normal)
    t = unit(np.cross((1.0, 0.0, 0.0) if abs(n[0]) < 0.6 else (0.0, 1.0, 0.0), n))
    rim = ring(size, 0.0, 6)
    vertices = np.concatenate([[ORIGIN], rim[:, :1] * t + rim[:, 1:2] * np.cross(n, t)])
    i = np.arange(6)
    faces = np.stack([np.zeros(6, np.int64), 1 + i, 1 + (i + 1) % 6], axis=1)
    return Triangles(vertices + np.asarray(point, np.float64), faces.astype(np.int32))


# A wall at x = 0 that looks to +x, and vertex 0 of a speck of floor at distance 1 from it.
WALL = patch((0, -WIDE, -WIDE), (0, WIDE, -WIDE), (0, WIDE, WIDE), (0, -WIDE, WIDE))
BESIDE_A_WALL = joined(hexagon_around((1.0, 0.0, 0.0), UP, 1e-3), WALL)

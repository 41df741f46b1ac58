"""Meshes that break bakers, with the values that are right: closed forms, none of them measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Case", "cases"]

FloatArray = NDArray[np.float64]
Shape = tuple[FloatArray, NDArray[np.int64]]

AXIS = np.array([1.0, 2.0, 3.0]) / math.sqrt(14.0)
TURN_RAD = 0.7  # about AXIS: an attitude without any luck


@dataclass(frozen=True, eq=False)
class Case:
    """points : numbers of the vertices that are looked at; truth : what is right there;
    normals : prescribed ones (P, 3), or None; tolerance : what is allowed at 4,096 rays, and why."""

    name: str
    vertices: FloatArray
    faces: NDArray[np.int64]
    points: NDArray[np.int64]
    truth: FloatArray
    tolerance: float
    why: str
    normals: FloatArray | None = None


def turned(points: FloatArray) -> FloatArray:
    """Points, turned by TURN_RAD about AXIS (Rodrigues)."""
    c, s = math.cos(TURN_RAD), math.sin(TURN_RAD)
    along = (points @ AXIS)[..., None] * AXIS
    return np.asarray(points * c + np.cross(AXIS, points) * s + along * (1.0 - c))


def seen(point: FloatArray, normal: FloatArray, polygon: FloatArray) -> float:
    """Form factor of a polygon in front of a point. Source: Lambert 1760, the sum over its edges."""
    unit = polygon - point
    unit = unit / np.linalg.norm(unit, axis=1)[:, None]
    total = 0.0
    for a, b in zip(unit, np.roll(unit, -1, axis=0), strict=True):
        across = np.cross(a, b)
        size = float(np.linalg.norm(across))
        if size > 0.0:
            total += math.atan2(size, float(a @ b)) * float(across @ normal) / size
    return abs(total) / (2.0 * math.pi)


def grid(corner: list[float], u: list[float], v: list[float], nu: int = 1, nv: int = 1) -> Shape:
    """A parallelogram of 2 nu nv faces that looks along u x v."""
    o, a, b = np.array(corner, float), np.array(u, float), np.array(v, float)
    s, t = np.meshgrid(np.linspace(0, 1, nu + 1), np.linspace(0, 1, nv + 1), indexing="ij")
    vertices = o + s.reshape(-1, 1) * a + t.reshape(-1, 1) * b
    i, j = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    k = (i * (nv + 1) + j).reshape(-1)
    m = nv + 1
    faces = np.concatenate([np.stack([k, k + m, k + m + 1], 1), np.stack([k, k + m + 1, k + 1], 1)])
    return vertices, faces


def joined(*shapes: Shape) -> Shape:
    """Shapes as one mesh that shares no vertices."""
    first = np.cumsum([0, *(len(v) for v, _ in shapes)])
    vertices = np.concatenate([v for v, _ in shapes])
    return vertices, np.concatenate([f + n for (_, f), n in zip(shapes, first, strict=False)])


def box(low: float = -0.5, height: float = 1.0) -> Shape:
    """A box of unit width with eight vertices, standing at z = 0, faces outward."""
    x = [(i, j, k) for i in (low, -low) for j in (low, -low) for k in (0.0, height)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return np.array(x), np.array(faces)


def ball(level: int) -> Shape:
    """An octahedron, divided; faces outward."""
    vertices = np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array(
        [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    )
    for _ in range(level):
        sides = np.sort(np.stack([faces, np.roll(faces, -1, 1)], 2).reshape(-1, 2), axis=1)
        edges, of = np.unique(sides, axis=0, return_inverse=True)
        mid = (of.reshape(-1, 3) + len(vertices)).T
        middle = vertices[edges].sum(axis=1)
        vertices = np.concatenate([vertices, middle / np.linalg.norm(middle, axis=1)[:, None]])
        a, b, c = faces.T
        ab, bc, ca = mid
        four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = np.concatenate([np.stack(corner, 1) for corner in four])
    return vertices, faces


def pit() -> tuple[Shape, NDArray[np.int64], FloatArray, FloatArray]:
    """An open box, 1 x 2 x 0.8, seen from within: shape, inner vertices, their truth and normals."""
    w, d, h = 1.0, 2.0, 0.8
    opening = np.array([[0, 0, h], [w, 0, h], [w, d, h], [0, d, h]])
    walls = [
        ([0, 0, 0], [w, 0, 0], [0, d, 0], 6, 8),
        ([0, 0, 0], [0, d, 0], [0, 0, h], 8, 5),
        ([w, 0, 0], [0, 0, h], [0, d, 0], 5, 8),
        ([0, 0, 0], [0, 0, h], [w, 0, 0], 5, 6),
        ([0, d, 0], [w, 0, 0], [0, 0, h], 6, 5),
    ]
    shapes, points, truth, normals, first = [], [], [], [], 0
    for corner, u, v, nu, nv in walls:
        vertices, faces = grid(corner, u, v, nu, nv)
        normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        for i in range(1, nu):
            for j in range(1, nv):
                points.append(first + i * (nv + 1) + j)
                truth.append(seen(vertices[i * (nv + 1) + j], normal, opening))
                normals.append(normal)
        shapes.append((vertices, faces))
        first += len(vertices)
    return joined(*shapes), np.array(points), np.array(truth), np.array(normals)


def _pits() -> Iterator[Case]:
    (vertices, faces), points, truth, normals = pit()
    at, around = turned(vertices), turned(normals)
    noise = "sampling"
    for scale in (1e-9, 1e-6, 1e6, 1e9):
        yield Case(f"pit of size {scale:g}", at * scale, faces, points, truth, 0.009, noise)
    for offset in (1e5, 1e6, 1e7):
        yield Case(f"pit {offset:g} sizes away", at + offset, faces, points, truth, 0.009, noise)
    two = np.concatenate([at, at + 1e6]), np.concatenate([faces, faces + len(at)])
    both = np.concatenate([points, points + len(at)])
    yield Case("two pits 1e6 sizes apart", *two, both, np.tile(truth, 2), 0.009, noise)
    junk = np.concatenate([at, [[np.nan, 0, 0], [3, 3, 3], [3, 4, 3]]])
    more = np.concatenate([faces, [[len(at), len(at) + 1, len(at) + 2]]])
    yield Case("a NaN vertex in a face beside", junk, more, points, truth, 0.009, noise)
    both_sides = np.concatenate([faces, faces[:, ::-1]])
    yield Case("welded double walls", at, both_sides, points, truth, 0.009, noise, around)


def _gaps() -> Iterator[Case]:
    inner = np.array([i * 9 + j for i in range(1, 8) for j in range(1, 8)])
    for gap in (1e-4, 1e-5, 1e-6):
        upper = grid([0, 0, gap], [0, 1, 0], [1, 0, 0])
        vertices, faces = joined(grid([0, 0, 0], [1, 0, 0], [0, 1, 0], 8, 8), upper)
        why = "the gap's sides let in less"
        truth = np.zeros(len(inner))
        yield Case(f"plates {gap:g} apart", turned(vertices), faces, inner, truth, 0.001, why)
    v, f = ball(3)
    vertices, faces = joined((v, f), (v * (1 - 1e-6), f[:, ::-1]))
    truth = np.repeat([1.0, 0.0], len(v))
    every = np.arange(len(vertices))
    yield Case(
        "shell 1e-6 thick", turned(vertices), faces, every, truth, 1e-6, "nothing to estimate"
    )


def _contacts() -> Iterator[Case]:
    v, f = box()
    low = np.flatnonzero(v[:, 2] == 0.0)
    truth = np.full(4, (1.0 - 1.0 / math.sqrt(3.0)) / 2.0)
    for size in (20.0, 1e3, 1e5):
        ground = grid([-size, -size, 0], [2 * size, 0, 0], [0, 2 * size, 0])
        vertices, faces = joined((v + np.array([0.1, 0.2, 0.0]), f), ground)
        name = f"corners of a box on a ground {2 * size:g} wide"
        yield Case(name, turned(vertices), faces, low, truth, 0.006, "sampling; the ground's end")
    for size in (1e2, 1e5):
        wall = grid([0.5, -0.5, 0], [0, 1, 0], [0, 0, 1], 6, 6)
        ground = grid([-size, -size, 0], [2 * size, 0, 0], [0, 2 * size, 0])
        vertices, faces = joined(wall, ground)
        points = np.array([i * 7 + j for i in range(1, 6) for j in range(1, 6)])
        half = np.array([[0.5, -size, 0], [size, -size, 0], [size, size, 0], [0.5, size, 0]])
        normal = np.array([1.0, 0, 0])
        truth = np.array([1 - seen(vertices[p], normal, half) for p in points])
        name = f"wall on a ground {2 * size:g} wide"
        yield Case(name, turned(vertices), faces, points, truth, 0.009, "sampling")


def _needles() -> Iterator[Case]:
    angle = 2 * math.pi * np.arange(64) / 64
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    for size in (1e4, 1e5):
        plate = np.concatenate([0.5 * rim + [0, 0, 0.6], size * rim + [0, 0, 0.6]])
        k = np.arange(64)
        n = (k + 1) % 64
        faces = np.concatenate([np.stack([k, n, k + 64], 1), np.stack([n, n + 64, k + 64], 1)])
        receiver = grid([-0.05, -0.05, 0], [0.1, 0, 0], [0, 0.1, 0], 2, 2)
        vertices, faces = joined(receiver, (plate, faces))
        truth = np.array([seen(np.zeros(3), np.array([0, 0, 1.0]), plate[:64])])
        name = f"hole of size 1 in needles {size:g} long"
        yield Case(name, turned(vertices), faces, np.array([4]), truth, 0.005, "sampling")
    for half_deg in (45.0, 5.0, 1.0):
        radius = math.tan(math.radians(half_deg))
        cone = np.concatenate([[[0, 0, 0]], rim * [radius, radius, 1] + [0, 0, 1]])
        faces = np.stack([0 * k, 1 + k, 1 + n], axis=1)
        truth = np.array([seen(np.zeros(3), np.array([0, 0, 1.0]), cone[1:])])
        name = f"tip of a conical pit, {half_deg:g} degrees"
        yield Case(name, turned(cone), faces, np.array([0]), truth, 0.005, "sampling")


def _convex() -> Iterator[Case]:
    v, f = ball(2)
    every, open_ = np.arange(len(v)), np.ones(len(v))
    exact = "nothing to estimate"
    mixed = np.where(np.arange(len(f))[:, None] % 3 == 0, f[:, ::-1], f)
    yield Case("ball, mixed winding", turned(v), mixed, every, open_, 1e-6, exact)
    yield Case(
        "ball, every face twice", turned(v), np.concatenate([f, f]), every, open_, 1e-6, exact
    )
    room = turned(box()[0]), box()[1][:, ::-1]
    yield Case("closed room", *room, np.arange(8), np.zeros(8), 1e-6, exact)
    angle = 2 * math.pi * np.arange(16) / 16
    rim = np.stack([1e-4 * np.cos(angle), 1e-4 * np.sin(angle), 0 * angle], axis=1)
    k, n = 1 + np.arange(16), 1 + (np.arange(16) + 1) % 16
    spike = np.concatenate([[[0, 0, 1.0]], rim, [[0, 0, 0]]])
    faces = np.concatenate([np.stack([0 * k, k, n], 1), np.stack([0 * k + 17, n, k], 1)])
    name, points = "spike 1e4 times as long as wide", np.arange(18)
    yield Case(name, turned(spike), faces, points, np.ones(18), 1e-6, exact)


def cases() -> Iterator[Case]:
    """Every case, built when it is its turn."""
    families: tuple[Callable[[], Iterator[Case]], ...] = (
        _pits,
        _gaps,
        _contacts,
        _needles,
        _convex,
    )
    for family in families:
        yield from family()

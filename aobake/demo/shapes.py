"""The shapes of the hall: stones with rounded edges, turned things, walls with an arch, an apse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aobake.demo.patches import Patch, grid, joined
from aobake.meshes.scene import FloatArray

__all__ = ["Flutes", "apse", "arched_wall", "ball", "frame", "stone", "surround", "turned"]


@dataclass(frozen=True)
class Flutes:
    """Vertical grooves between two heights, as in the shaft of a column."""

    count: int
    depth: float
    low: float
    high: float


def stone(
    size: tuple[float, float, float], edge: float, step: float, *, bedded: bool = False
) -> Patch:
    """A block about the origin.

    size : along x, y and z; edge : radius of its rounded edges; step : longest side of a cell
    bedded : whether its underside is left out, since nothing can see it
    """
    half = np.array(size) / 2
    sides = []
    for axis in range(3):
        right, up = (axis + 1) % 3, (axis + 2) % 3
        across, along = (_marks(float(half[k]), edge, step) for k in (right, up))
        for sign in (1.0,) if bedded and axis == 1 else (1.0, -1.0):
            points = np.empty((len(along), len(across), 3))
            points[..., axis] = sign * half[axis]
            points[..., right] = sign * across
            points[..., up] = along[:, None]
            sides.append(_rounded(grid(points), half - edge, edge))
    return joined(*sides)


def turned(profile: FloatArray, segments: int, flutes: Flutes | None = None) -> Patch:
    """A surface of revolution about the y axis.

    profile : (N, 2) float64 of radius and height, with the outside to the right of its course
    """
    angles = np.linspace(0.0, 2 * np.pi, segments + 1)
    radius = np.repeat(profile[:, :1], segments + 1, axis=1)
    if flutes is not None:
        inside = np.minimum(profile[:, 1] - flutes.low, flutes.high - profile[:, 1])
        fade = np.clip(inside / (4 * flutes.depth), 0.0, 1.0)
        radius -= flutes.depth * fade[:, None] * np.abs(np.sin(angles * flutes.count / 2))
    points = np.empty((len(profile), segments + 1, 3))
    points[..., 0] = radius * np.sin(angles)
    points[..., 1] = profile[:, 1:]
    points[..., 2] = radius * np.cos(angles)
    points[:, -1] = points[:, 0]
    return grid(points, closed=True)


def ball(radius: float, segments: int) -> Patch:
    """A sphere about the origin."""
    elevation = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    profile = radius * np.stack([np.cos(elevation), np.sin(elevation)], axis=1)
    profile[[0, -1], 0] = 0.0
    return turned(profile, segments)


def arched_wall(
    size: tuple[float, float, float], arch: float, spring: float, step: float, *, edge: float
) -> Patch:
    """A wall with an arched opening right through it.

    size : width, height and depth; the wall stands on y = 0 and reaches from z = 0 to z = -depth
    arch : radius of the opening; spring : height at which its curve begins (0: it has no jambs)
    edge : radius of the opening's rounded rims
    """
    width, height, depth = size
    inner, outer = _outline(width / 2, height, arch, spring, step)
    shares = _shares(width / 2 - arch, step)
    inside = np.linspace(-edge, edge - depth, max(2, round(depth / step) + 1))
    front = [(t, edge, 0.0) for t in shares]
    back = [(t, edge, -depth) for t in shares[::-1]]
    section = [*front, *_rim(edge, 0.0, 1.0), *((0.0, 0.0, z) for z in inside)]
    section += [*reversed(_rim(edge, -depth, -1.0)), *back]
    panel = grid(_swept(inner, outer, np.array(section)))
    across = np.linspace(-width / 2, width / 2, round(width / step) + 1)
    top = np.array([[(x, height, z) for x in across] for z in (0.0, -depth / 2, -depth)])
    return joined(panel, grid(top))


def apse(size: tuple[float, float], sill: float, arch: float, spring: float, step: float) -> Patch:
    """A wall in the plane z = 0 with a niche in it: half a cylinder under a quarter of a sphere.

    size : width and height, from y = 0; sill : height of the niche's floor
    arch, spring : as for arched_wall, from the sill
    """
    width, height = size
    edge = 0.04
    inner, outer = _outline(width / 2, height - sill, arch, spring, step)
    front = [(t, edge, 0.0) for t in _shares(width / 2 - arch, step)]
    wall = grid(_swept(inner, outer, np.array([*front, *_rim(edge, 0.0, 1.0), (0.0, 0.0, -edge)])))
    inside = _bowl(arch, np.linspace(0.0, spring, max(2, round(spring / step) + 1)), step)
    outside = _bowl(arch + 0.15, np.linspace(-sill - 0.5, spring, 5), 2 * step)[:, ::-1]
    rows = np.linspace(0.0, 1.0, max(3, round(arch / step) + 1))[:, None, None]
    floor = (inside[0] * (1.0, 1.0, 0.0)) * (1.0 - rows) + inside[0] * rows
    bowl = joined(grid(inside), grid(outside), grid(floor)).moved(z=-edge)
    across = np.linspace(-width / 2, width / 2, round(width / step) + 1)
    up = np.linspace(-sill, 0.0, round(sill / step) + 1)
    below = np.stack([*np.meshgrid(across, up), np.zeros((len(up), len(across)))], axis=2)
    ledge = np.array([[(x, 0.0, z) for x in (-arch, arch)] for z in (0.0, -edge)])
    return joined(wall, bowl, grid(below), grid(ledge)).moved(y=sill)


def surround(half: tuple[float, float], radius: float, rim: float, step: float) -> Patch:
    """Ground about a rectangle, out to a circle with an edge: the grid follows both borders.

    half : half the width (x) and half the depth (z) of the rectangle; rim : height of the outer edge
    """
    count = 4 * round(2 * sum(half) / step)
    turns = np.linspace(0.0, 2 * np.pi, count + 1)
    corner = np.arctan2(half[1], half[0])
    for exact in (corner, np.pi - corner, np.pi + corner, 2 * np.pi - corner):
        turns[np.argmin(np.abs(turns - exact))] = exact
    direction = np.stack([np.cos(turns), -np.sin(turns)], axis=1)
    direction[-1] = direction[0]
    with np.errstate(divide="ignore"):
        inner = direction * np.min(np.array(half) / np.abs(direction), axis=1, keepdims=True)
    t = np.linspace(1.0, 0.0, round((radius - min(half)) / step) + 1)[:, None, None] ** 1.5
    points = np.zeros((len(t) + 3, len(turns), 3))
    points[3:, :, [0, 2]] = (1 - t) * inner + t * direction * (radius - rim / 4)
    points[:3, :, [0, 2]] = radius * direction
    points[:3, :, 1] = np.array([[-rim], [-rim / 2], [-rim / 4]])
    return grid(points, closed=True)


def frame(half: tuple[float, float], width: float) -> Patch:
    """A flat strip, facing up, along the border of a rectangle: half of its width on either side."""
    corners = np.array([(1, -1), (-1, -1), (-1, 1), (1, 1), (1, -1)], np.float64)
    points = np.zeros((2, len(corners), 3))
    for row, beyond in enumerate((width / 2, -width / 2)):
        points[row][:, [0, 2]] = corners * (np.array(half) + beyond)
    return grid(points, closed=True)


def _shares(length: float, step: float) -> FloatArray:
    """Shares of the way from a wall's border to its opening, denser where walls and cornices meet."""
    return 1.0 - np.linspace(0.0, 1.0, round(length / step) + 3) ** 1.5


def _marks(half: float, edge: float, step: float) -> FloatArray:
    """Where the cells of a side of a stone begin and end, denser in the rounding at both ends."""
    inner = half - edge
    middle = np.linspace(-inner, inner, max(2, int(np.ceil(2 * inner / step)) + 1))
    return np.concatenate([[-half], middle, [half]])


def _rounded(side: Patch, core: FloatArray, edge: float) -> Patch:
    """A side of a block, with all that lies outside of the core drawn in to the radius of its edge."""
    nearest = np.clip(side.vertices, -core, core)
    away = side.vertices - nearest
    normals = away / np.linalg.norm(away, axis=1, keepdims=True)
    return Patch(nearest + edge * normals, side.faces, normals)


def _outline(
    half_width: float, height: float, arch: float, spring: float, step: float
) -> tuple[FloatArray, FloatArray]:
    """An arched opening from its left foot to its right one, and the wall's border as seen from it."""
    jamb = np.linspace(0.0, spring, max(2, round(spring / step) + 1) if spring else 1)[:-1]
    turns = np.linspace(np.pi, 0.0, max(9, round(np.pi * arch / step)) | 1)
    corner = np.arctan2(height - spring, half_width)
    for exact in (np.pi - corner, corner):
        turns[np.argmin(np.abs(turns - exact))] = exact
    direction = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    with np.errstate(divide="ignore"):
        reach = np.minimum(
            half_width / np.abs(direction[:, 0]), (height - spring) / np.abs(direction[:, 1])
        )
    centre = np.array([0.0, spring])
    left = np.array([(-1.0, y) for y in jamb]).reshape(-1, 2)
    right = left[::-1] * (-1.0, 1.0)
    inner = [left * (arch, 1.0), centre + arch * direction, right * (arch, 1.0)]
    outer = [left * (half_width, 1.0), centre + reach[:, None] * direction]
    return np.concatenate(inner), np.concatenate([*outer, right * (half_width, 1.0)])


def _bowl(radius: float, heights: FloatArray, step: float) -> FloatArray:
    """Half a cylinder behind z = 0 through these heights, and a quarter of a sphere on top of it."""
    turns = np.linspace(0.0, np.pi, max(8, round(np.pi * radius / step)))
    elevation = np.linspace(0.0, np.pi / 2, max(5, round(np.pi / 2 * radius / step)))[1:]
    radii = radius * np.concatenate([np.ones_like(heights), np.cos(elevation)])
    radii[-1] = 0.0
    points = np.empty((len(radii), len(turns), 3))
    points[..., 0] = -radii[:, None] * np.cos(turns)
    points[..., 1] = np.concatenate([heights, heights[-1] + radius * np.sin(elevation)])[:, None]
    points[..., 2] = -radii[:, None] * np.sin(turns)
    return points


def _rim(edge: float, z: float, side: float) -> list[tuple[float, float, float]]:
    """The rounding between a wall's face at z and the opening, from the face inwards."""
    angles = np.radians([30.0, 60.0])
    return [(0.0, edge * (1 - np.sin(a)), z - side * edge * (1 - np.cos(a))) for a in angles]


def _swept(inner: FloatArray, outer: FloatArray, section: FloatArray) -> FloatArray:
    """Grid points: each (t, e, z) of the section, at every point of the outline.

    t : share of the way from the rim to the border; e : distance from the opening at t = 0
    """
    t, away, z = section.T[:, None, :, None]
    span = np.linalg.norm(outer - inner, axis=1)[:, None, None]
    direction = (outer - inner)[:, None, :] / span
    flat = inner[:, None, :] + direction * (away + t * (span - away))
    return np.concatenate([flat, np.broadcast_to(z, (*flat.shape[:2], 1))], axis=2)

"""Scenes whose ambient occlusion is known in closed form.

A = 1/pi * integral V (n.w) dw; 1 = open, 0 = occluded. So A is 1 less the configuration factors of what
is seen. Howell, A Catalog of Radiation Heat Transfer Configuration Factors, has most of the formulas;
Lambert's edge sum, which is exact for any planar polygon, bounds what the facets of a disc change.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from aobake.settings import Falloff
from tests.scenes import (
    FAR,
    ORIGIN,
    UP,
    FloatArray,
    Triangles,
    box,
    disc,
    flipped,
    floor,
    icosphere,
    joined,
    patch,
    ring,
    tube,
    unit,
)


def lambert_factor(point: ArrayLike, normal: ArrayLike, polygon: ArrayLike) -> float:
    """Factor of a planar polygon above the horizon of a point: 1/2pi of the sum over edges of angle times moment.

    Source: J. H. Lambert, Photometria, 1760; in vector form J. Arvo, PhD thesis, Yale, 1995.
    """
    n, q = unit(normal), np.asarray(polygon, np.float64) - np.asarray(point, np.float64)
    h = q @ n
    clipped: list[FloatArray] = []
    for i in range(len(q)):
        j = (i + 1) % len(q)
        if h[i] >= 0.0:
            clipped.append(q[i])
        if h[i] * h[j] < 0.0:
            clipped.append((q[i] * h[j] - q[j] * h[i]) / (h[j] - h[i]))
    total = 0.0
    for a, b in zip(clipped, clipped[1:] + clipped[:1], strict=True):
        c = np.cross(a, b)
        length = float(np.linalg.norm(c))
        if length > 0.0:
            total += math.atan2(length, float(a @ b)) * float(c @ n) / length
    return abs(total) / (2.0 * math.pi)


def disc_factor(radius: float, height: float, off: float = 0.0) -> float:
    """A parallel disc above an element, its axis off to a side."""
    s = off**2 + height**2 + radius**2
    return 0.5 * (1.0 - (s - 2.0 * radius**2) / math.sqrt(s * s - 4.0 * radius**2 * off**2))


def rectangle_factor(a: float, b: float, height: float) -> float:
    """A parallel rectangle a x b with one corner straight above the element."""
    x, y = a / height, b / height
    p, q = math.hypot(1.0, x), math.hypot(1.0, y)
    return (x / p * math.atan(y / p) + y / q * math.atan(x / q)) / (2.0 * math.pi)


def wall_factor(distance: float, height: float, left: float, right: float) -> float:
    """An upright wall that stands at a distance from an element of floor, to the left and right of its foot."""
    s = math.hypot(distance, height)
    sides = (math.atan(b / distance) - distance / s * math.atan(b / s) for b in (left, right))
    return sum(sides) / (2.0 * math.pi)


def sphere_factor(radius: float, distance: float, tilt: float) -> float:
    """A sphere whose centre lies at an angle from the normal; the part below the horizon does not count."""
    sine = radius / distance
    alpha = math.asin(sine)
    if tilt + alpha <= math.pi / 2:
        return sine**2 * math.cos(tilt)
    if tilt - alpha >= math.pi / 2:
        return 0.0
    x = math.sqrt(1.0 - sine**2) / sine
    y = max(-1.0, min(1.0, -x / math.tan(tilt)))
    s = math.sqrt(max(0.0, 1.0 - y * y))
    lit = sine**2 * (math.cos(tilt) * math.acos(y) - x * math.sin(tilt) * s)
    return (lit + math.atan2(math.sin(tilt) * s, x)) / math.pi


def plane_with_falloff(ratio: float, falloff: Falloff) -> float:
    """Openness under an endless parallel plane at `ratio` of max_distance."""
    c = min(1.0, ratio)
    if falloff == "linear":
        return 1.0 - (1.0 - c) ** 2
    if (
        falloff == "smooth"
    ):  # the integral of 2t (3u^2 - 2u^3), u = c/t, over t from c to 1, and c^2 beyond
        return 4.0 * c**3 - 3.0 * c**2 - 6.0 * c**2 * math.log(c)
    return c**2


@dataclass(frozen=True, eq=False, kw_only=True)
class Known:
    """A point whose openness is known.

    facets : how much the facets of the mesh, or its end where the formula has none, may change it
    """

    name: str
    mesh: Triangles
    openness: float
    point: FloatArray
    normal: FloatArray
    facets: float = 0.0
    max_distance: float | None = None
    falloff: Falloff = "none"


def _known(
    name: str, mesh: Triangles, openness: float, facets: float = 0.0, **more: object
) -> Known:
    point, normal = more.pop("point", ORIGIN), more.pop("normal", UP)
    return Known(
        name=name,
        mesh=mesh,
        openness=openness,
        point=np.asarray(point, np.float64),
        normal=unit(np.asarray(normal)),
        facets=facets,
        **more,  # type: ignore[arg-type]
    )


def known_scenes() -> list[Known]:
    """Every scene with a closed form; each attitude and size is arbitrary."""
    return [*_discs(), *_rectangles(), *_wedges(), *_spheres(), *_pits(), *_falloffs()]


def _discs() -> list[Known]:
    exact = [1.0 - disc_factor(r, h) for r, h in ((1.0, 1.0), (0.5, 2.0), (3.0, 0.1))]
    scenes = []
    for (r, h), value in zip(((1.0, 1.0), (0.5, 2.0), (3.0, 0.1)), exact, strict=True):
        polygon = 1.0 - lambert_factor(ORIGIN, UP, ring(r, h, 512))
        scenes.append(_known(f"disc {r} at {h}", disc(r, h, 512), value, abs(polygon - value)))
    value = 1.0 - disc_factor(1.0, 0.7, 1.3)
    shift = (1.3, 0.0, 0.0)
    polygon = 1.0 - lambert_factor(ORIGIN, UP, ring(1.0, 0.7, 512) + shift)
    scenes.append(_known("disc to a side", disc(1.0, 0.7, 512, shift), value, abs(polygon - value)))
    return scenes


def _rectangles() -> list[Known]:
    a, b, c = 1.0, 2.0, 0.8
    corner = patch((0, 0, c), (0, b, c), (a, b, c), (a, 0, c))
    wall = patch((0.5, -0.7, 0), (0.5, 1.4, 0), (0.5, 1.4, 1), (0.5, -0.7, 1))
    upper = patch((0, 0, 0.5), (0, 3, 0.5), (2, 3, 0.5), (2, 0, 0.5))
    lower = patch((0, 0, 0), (2, 0, 0), (2, 3, 0), (0, 3, 0))
    seen = sum(rectangle_factor(u, v, 0.5) for u in (0.6, 1.4) for v in (0.6, 2.4))
    tilted = unit((math.sin(2.0), 0.0, math.cos(2.0)))
    return [
        _known("corner of a rectangle overhead", corner, 1.0 - rectangle_factor(a, b, c)),
        _known("wall", wall, 1.0 - wall_factor(0.5, 1.0, 0.7, 1.4)),
        _known("between plates", joined(lower, upper), 1.0 - seen, point=(0.6, 0.6, 0.0)),
        _known(
            "over a plane", floor(height=-1.0), (1.0 + tilted[2]) / 2.0, 1.0 / FAR, normal=tilted
        ),
    ]


def _wedges() -> list[Known]:
    """Points on the floor of a groove of dihedral angle phi, whose other wall has a slant width w."""
    scenes = []
    for phi, x, w in ((2.0 * math.pi / 3.0, 1.0, 2.0), (0.6, 1.0, 0.8), (math.pi / 3.0, 1.0, FAR)):
        up = np.array([math.cos(phi), 0.0, math.sin(phi)])
        side = np.array([0.0, FAR, 0.0])
        wall = patch(-side, side, w * up + side, w * up - side)
        s = (x - w * math.cos(phi)) / math.hypot(x - w * math.cos(phi), w * math.sin(phi))
        name = f"groove of {math.degrees(phi):.0f} degrees, {w:g} wide"
        scenes.append(_known(name, wall, (1.0 + s) / 2.0, 4.0 * (x + w) / FAR, point=(x, 0.0, 0.0)))
    # The last one is as wide as it is long; its other wall covers the sky to (1 - cos phi) / 2 within x / FAR.
    endless = (1.0 - math.cos(math.pi / 3.0)) / 2.0
    last = scenes.pop()
    scenes.append(_known("endless groove", last.mesh, endless, 2.0 / FAR, point=(1.0, 0.0, 0.0)))
    return scenes


def _spheres() -> list[Known]:
    scenes = []
    ball = icosphere(5)
    a, b, c = ball.vertices[ball.faces].transpose(1, 0, 2)
    fronts = np.cross(b - a, c - a)
    inner = float((np.einsum("ij,ij->i", fronts, a) / np.linalg.norm(fronts, axis=1)).min())
    for name, distance, tilt in (
        ("above", 1.8, 0.5),
        ("cut by the horizon", 1.8, 1.25),
        ("mostly below", 1.8, 1.9),
    ):
        at = distance * np.array([math.sin(tilt), 0.0, math.cos(tilt)])
        seen = sphere_factor(1.0, distance, tilt)
        facets = seen - sphere_factor(inner, distance, tilt)
        scenes.append(
            _known(f"sphere {name}", Triangles(ball.vertices + at, ball.faces), 1.0 - seen, facets)
        )
    rho = 0.8
    standing = Triangles(ball.vertices + np.array([rho, 0.0, 1.0]), ball.faces)
    facets = (1.0 / (rho**2 + 1.0)) ** 1.5 - sphere_factor(
        inner, math.hypot(rho, 1.0), math.atan2(rho, 1.0)
    )
    scenes.append(_known("beside a sphere", standing, 1.0 - (1.0 / (rho**2 + 1.0)) ** 1.5, facets))
    return scenes


def _pits() -> list[Known]:
    w, d, h = 1.0, 2.0, 0.8
    pit = flipped(box((0.0, 0.0, 0.0), (w, d, h), without=("+z",)))
    trench = flipped(box((0.0, -200.0, 0.0), (w, 200.0, h), without=("+z", "-y", "+y")))
    well = joined(tube(1.0, 0.0, 1.5, 512), flipped(disc(1.0, 0.0, 512)))
    x, y, z = 0.3, 0.7, 0.3
    on_floor = sum(rectangle_factor(u, v, h) for u in (x, w - x) for v in (y, d - y))
    slot = 0.5 * (x / math.hypot(x, h) + (w - x) / math.hypot(w - x, h))
    rim = abs(disc_factor(1.0, 1.5) - lambert_factor(ORIGIN, UP, ring(1.0, 1.5, 512)))
    room = flipped(box())
    walls = joined(
        patch((0, 0, 0), (0, FAR, 0), (0, FAR, FAR), (0, 0, FAR)),
        patch((0, 0, 0), (0, 0, FAR), (FAR, 0, FAR), (FAR, 0, 0)),
    )
    return [
        _known("floor of a pit", pit, on_floor, point=(x, y, 0.0)),
        _known(
            "wall of a pit", pit, wall_factor(h - z, w, y, d - y), point=(0, y, z), normal=(1, 0, 0)
        ),
        _known("floor of a trench", trench, slot, 1e-5, point=(x, 0.0, 0.0)),
        _known("bottom of a well", well, disc_factor(1.0, 1.5), rim),
        _known("closed room", room, 0.0, point=(0.1, -0.2, -0.5)),
        _known("floor in a corner", walls, 0.25, 4.0 / FAR, point=(0.6, 0.9, 0.0)),
        _known(
            "tip of a corner",
            joined(walls, floor()),
            math.sqrt(3.0) / 4.0,
            4.0 / FAR,
            normal=(1, 1, 1),
        ),
    ]


def _falloffs() -> list[Known]:
    kinds: tuple[Falloff, ...] = ("none", "linear", "smooth")
    ceiling = flipped(floor(50.0, 0.4))
    return [
        _known(
            f"ceiling, falloff {kind}",
            ceiling,
            plane_with_falloff(0.4, kind),
            max_distance=1.0,
            falloff=kind,
        )
        for kind in kinds
    ]

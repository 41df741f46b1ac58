"""Where rays land: the normal that is seen there, and where rays to the lights start.

land takes 12 % of the processor seconds of the picture that primary.py tells of.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import inlined, kernel
from aobake.tracing.vectors import cross, dot, largest, length, minus, row

__all__ = ["land", "scratch"]

OFFSET_ULPS = 8.0  # the plane test errs by at most 4 half-ulps of the triangle (Ize 2013)
ULP = 2.0**-23
EDGE_ON = 1e-3  # cosine to the viewer that is left to a normal that looks away


@inlined
def plus(a, b, factor):
    """a + factor b."""
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


@inlined
def at_length_one(a, otherwise):
    """a at length 1; the other vector where a has none."""
    size = length(a)
    return (a[0] / size, a[1] / size, a[2] / size) if size > 0.0 else otherwise


@inlined
def placed(point, normal, linear, shift, t):
    """A point and a normal as the transform of thing t puts them; the normal by cofactors, of any length."""
    at, a, b, c = row(shift, t), row(linear, 3 * t), row(linear, 3 * t + 1), row(linear, 3 * t + 2)
    at = plus(plus(plus(at, a, point[0]), b, point[1]), c, point[2])
    turned = plus((0.0, 0.0, 0.0), cross(b, c), normal[0])
    return at, plus(plus(turned, cross(c, a), normal[1]), cross(a, b), normal[2])


def scratch() -> NDArray[np.float64]:
    """Memory for land, of one thread: three corners and the normals at them."""
    return np.zeros((6, 3))


@kernel
def land(bodies, things, hits, directions, scratch, normal, origin, front):
    """Fill in, for each hit, the normal that is seen, where rays to lights start, and whether it is a front.

    bodies : vertices, normals (V, 3) float32, faces (F, 3) int32, pooled
    things : first face (T,) int64, how many stand where they are, columns of linear (3 T, 3), shift (T, 3)
        and sharp (T,) float32, see stage.Stage
    hits : thing (N,), face (N,) int32, weights (3, N) float32
    directions : (3, N) float32 of the rays
    scratch : of scratch()
    normal, origin : (3, N) float32; front : (N,) bool
    The origin is off the triangle by what rounding asks for, and on the curved surface that the normals
    stand for. Source: J. Hanika, Hacking the shadow terminator, Ray Tracing Gems II, 2021.
    """
    vertices, normals, faces = bodies
    first_face, fixed, linear, shift, sharp = things
    thing, face, weights = hits
    zero = (0.0, 0.0, 0.0)
    for i in range(len(thing)):
        t = thing[i]
        f = first_face[t] + face[i]
        largest_number, flat = 0.0, zero
        for k in range(3):
            corner, own = row(vertices, faces[f, k]), row(normals, faces[f, k])
            if t >= fixed:
                corner, own = placed(corner, own, linear, shift, t)
            largest_number = max(largest_number, largest(corner))
            flat = plus(flat, corner, float(weights[k, i]))
            for c in range(3):
                scratch[k, c], scratch[3 + k, c] = corner[c], own[c]
        ray = (float(directions[0, i]), float(directions[1, i]), float(directions[2, i]))
        first = row(scratch, 0)
        across = cross(minus(row(scratch, 1), first), minus(row(scratch, 2), first))
        front[i] = dot(across, ray) <= 0.0
        facing = plus(zero, at_length_one(across, ray), 1.0 if front[i] else -1.0)
        mixed, at = zero, plus(flat, facing, OFFSET_ULPS * ULP * largest_number)
        for k in range(3):
            own = at_length_one(row(scratch, 3 + k), facing)
            along = dot(own, facing)
            if abs(along) < sharp[t]:
                own, along = facing, 1.0
            own = plus(zero, own, 1.0 if along >= 0.0 else -1.0)
            below = min(dot(minus(flat, row(scratch, k)), own), 0.0)
            mixed = plus(mixed, own, float(weights[k, i]))
            at = plus(at, own, -float(weights[k, i]) * below)
        seen = at_length_one(mixed, facing)
        # Beside silhouettes they look away from the viewer, and no light would come back.
        seen = at_length_one(plus(seen, ray, -max(dot(seen, ray) + EDGE_ON, 0.0)), facing)
        for c in range(3):
            normal[c, i], origin[c, i] = seen[c], at[c]

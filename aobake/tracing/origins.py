"""Where rays start: just off the surface, on the side where the point is seen from.

A ray must not start on the surface, whose rounded coordinates would hide it, nor so far off that it
jumps over a thin gap. And where surfaces touch, no offset along the normal need be right: a corner of
a box that stands on a ground has a normal that points below the ground. So the triangles within a few
ulps of the point are looked up, and the origin is put

1. at a distance that the rounding errors ask for: two ulps of the point's coordinates, three ulps
   of the largest extent of the triangles around it, for the triangle test in float32, and what the
   transform of an instance adds;
2. in a direction that lies in front of all the triangles that the point belongs to, and on the same
   side of every other touching triangle as they do;
3. no farther than half way to any surface that faces the point across a gap.

The error bounds follow T. Ize, Robust BVH ray traversal, JCGT 2(2), 2013 (relative error of a float32
edge and plane test, here at most 4 x 2^-24), and C. Waechter, N. Binder, A fast and robust method for
avoiding self-intersection, Ray Tracing Gems, 2019 (offsets in ulps along the geometric normal).

place_origins takes 3 % of a vertex bake of a scan at 256 rays, 11 % of one of a small house at 64. What was
tried stands in contacts.py and docs/performance.md.
"""

from __future__ import annotations

import numpy as np

from aobake.tracing.compiled import inlined, kernel
from aobake.tracing.contacts import MOST_TOUCHING, ULP, new_touching, query_buffers, touching
from aobake.tracing.vectors import cross, dot, length, minus, row

__all__ = [
    "CONTACT",
    "DOUBTFUL",
    "ENCLOSED",
    "OPEN",
    "PLAIN",
    "SLIVERS",
    "THIN",
    "UNRESOLVED",
    "place_origins",
    "scratch",
]

# what was found about a point; OPEN (everything lies below it) and UNRESOLVED are not found here
PLAIN, OPEN, SLIVERS, CONTACT, THIN, DOUBTFUL, ENCLOSED, UNRESOLVED = range(8)

SEARCH_ULPS = 32.0  # radius of what counts as touching, in ulps of the point's largest coordinate
SMALLEST = 1e-20  # coordinates below this are as good as 0
ORDINARY = 0.3  # a normal at least this much in front of every triangle needs no further thought
OWN = 0.02  # a triangle is the point's own if its front looks along the normal at least this much
OWN_AT_TIPS = 1e-9  # where none looks along it by that much: the tip of a needle, or of a deep pit
LIFT = 0.1  # how steeply a step from the point into its own triangle's front side rises
COPLANAR = 1e-6  # 1 - |cosine| between planes that count as one
HIDDEN = 2
STEEPEST, FARTHEST = 1e-4, 0.05  # least margin to make up for, and how far the origin may go for it
# A triangle that rises along the normal makes a hollow: right in its corner a ray may slip through, since
# no float32 test is sure beside a vertex. A few ulps more cost nothing there.
HOLLOW, OUT_OF_CORNERS = 0.5, 16.0
# The plane of a sliver errs by its aspect more than that of other triangles; beside convex edges.
SLIVER, BESIDE_SLIVERS, OF_WIDTH, FLAT, LEVEL = 10.0, 0.2, 0.25, 0.999, 0.05
HOPELESS = 5e3  # aspect beyond which rays are lost all the same: up to 0.01 of a value
WANTED, ROUNDS = 0.25, 48  # margin that the search for a direction stops at, and its patience


@inlined
def covers(near, j, q, margin):
    """Whether touching triangle j holds q, a point of its plane, give or take a margin."""
    front = row(near.fronts, j)
    for k in range(3):
        a, b = row(near.corners, 3 * j + k), row(near.corners, 3 * j + (k + 1) % 3)
        side = minus(b, a)
        if dot(cross(side, minus(q, a)), front) < -margin * length(side):
            return False
    return True


@inlined
def same_corners(near, i, j, margin):
    """Whether two touching triangles have the same corners, in any order: a wall with two sides."""
    for k in range(3):
        a, found = row(near.corners, 3 * i + k), False
        for m in range(3):
            found = found or length(minus(a, row(near.corners, 3 * j + m))) <= margin
        if not found:
            return False
    return True


@inlined
def above(near, j):
    """How far the point is in front of the plane of touching triangle j."""
    return -dot(row(near.corners, 3 * j), row(near.fronts, j))


@inlined
def lies_in_plane(near, i, j, margin):
    """Whether all corners of triangle i are in the plane of triangle j. Near its tip, any needle's are."""
    front, height = row(near.fronts, j), above(near, j)
    for k in range(3):  # noqa: SIM110 - compiled
        if abs(dot(row(near.corners, 3 * i + k), front) + height) > margin:
            return False
    return True


@inlined
def lies_against(near, i, step, margin):
    """Whether triangle i lies face to face on another one at the point: a box on its ground.

    A reversed twin of the same three corners does not count: that is one wall with two sides, unless
    its surface goes on beside it.
    """
    inward = row(near.inward, i)
    q = (step * inward[0], step * inward[1], step * inward[2])
    for j in range(near.filled):
        if (
            dot(row(near.fronts, i), row(near.fronts, j)) < COPLANAR - 1.0
            and (lies_in_plane(near, i, j, margin) or lies_in_plane(near, j, i, margin))
            and covers(near, j, q, margin)
            and (not same_corners(near, i, j, margin) or goes_on(near, j, margin))
        ):
            return True
    return False


@inlined
def goes_on(near, j, margin):
    """Whether the surface of triangle j goes on beside it without a twin: a ground, and no wall's back."""
    for k in range(near.filled):
        if k == j or dot(row(near.fronts, j), row(near.fronts, k)) < 1.0 - COPLANAR:
            continue
        if abs(above(near, k)) <= margin and not has_twin(near, k, margin):
            return True
    return False


@inlined
def has_twin(near, k, margin):
    """Whether another touching triangle has the corners of triangle k."""
    for m in range(near.filled):  # noqa: SIM110 - compiled
        if m != k and same_corners(near, k, m, margin):
            return True
    return False


@inlined
def side_of(near, j, normal, own, step, margin, sides):
    """The side of triangle j that the point's own triangles lead to: 1, -1, or 0 where it is no matter.

    A step from the point into each of its own triangles, and a little up, ends in the space that the
    point is seen from.
    """
    front, vote = row(near.fronts, j), 0.0
    for i in range(near.filled):
        if sides[i] == 1 and dot(row(near.fronts, i), normal) > own:
            along = dot(row(near.fronts, i), front)
            if abs(along) > 1.0 - COPLANAR and abs(above(near, j)) <= margin:
                return 0  # the back of a wall: it asks for nothing new
            vote += step * (dot(row(near.inward, i), front) + LIFT * along) + above(near, j)
    return 1 if vote > 0.0 else -1 if vote < 0.0 else 0


@inlined
def least_front(near, normal):
    """How much a triangle's front must look along the normal to belong to the point; less at sharp tips."""
    for i in range(near.filled):
        if dot(row(near.fronts, i), normal) > OWN:
            return OWN
    return OWN_AT_TIPS


@inlined
def take_sides(near, normal, step, margin, sides):
    """Fill sides (K,) with 1 or -1, the side of each triangle that the point is seen from; 0: no matter.

    The point's own triangles are those whose front looks along its normal; those that lie face to face
    on others are hidden and have no say. Returns PLAIN, CONTACT where some of them are hidden, or
    ENCLOSED where all of its own are.
    """
    own = least_front(near, normal)
    belong, hidden = 0, 0
    for i in range(near.filled):
        sides[i] = 0
        if dot(row(near.fronts, i), normal) > own:
            belong += 1
            sides[i] = 1
            if lies_against(near, i, step, margin):
                hidden += 1
                sides[i] = HIDDEN
    enclosed = belong > 0 and hidden == belong
    for i in range(near.filled):
        if sides[i] == HIDDEN:
            sides[i] = 1 if enclosed else 0
    for j in range(near.filled):
        if not dot(row(near.fronts, j), normal) > own:
            sides[j] = side_of(near, j, normal, own, step, margin, sides)
    return ENCLOSED if enclosed else CONTACT if hidden > 0 else PLAIN


@inlined
def direction_in_front(near, normal, sides):
    """(direction on the wanted side of all triangles, near the normal; its margin).

    The margin is the least cosine to a triangle's wanted side; not above 0 where there is no such
    direction. Source: the perceptron of Rosenblatt, 1958, which finds one if one exists.
    """
    m, best, found = normal, -2.0, normal
    for _ in range(ROUNDS):
        margin, worst = 2.0, -1
        for j in range(near.filled):
            if sides[j] != 0:
                along = sides[j] * dot(m, row(near.fronts, j))
                if along < margin:
                    margin, worst = along, j
        if margin > best:
            best, found = margin, m
        if margin >= WANTED:
            break
        push, front = sides[worst] * (WANTED + 0.05 - margin), row(near.fronts, worst)
        m = (m[0] + push * front[0], m[1] + push * front[1], m[2] + push * front[2])
        size = length(m)
        if size < 1e-9:
            break
        m = (m[0] / size, m[1] / size, m[2] / size)
    return found, best


@inlined
def room_ahead(near, direction, distance, margin):
    """At most `distance`, and at most half way to any triangle that the way there would cross."""
    for j in range(near.filled):
        height = above(near, j)
        approach = dot(direction, row(near.fronts, j)) * (-1.0 if height > 0.0 else 1.0)
        gap = abs(height)
        if gap > margin and approach > 0.0 and distance * approach > 0.5 * gap:
            way = gap / approach
            met = (way * direction[0], way * direction[1], way * direction[2])
            if covers(near, j, met, margin):
                distance = 0.5 * way
    return distance


def scratch() -> tuple[object, ...]:
    """Memory for place_origins, of one thread."""
    return query_buffers(), new_touching(), np.zeros(MOST_TOUCHING, np.int64)


@kernel
def place_origins(  # noqa: C901 - one point from lookup to origin
    functions, scene, world, positions, normals, scratch, origins, states
):
    """Put the origin of each point's rays, and say what was found around it.

    functions : (address of rtcPointQuery, address of the callback of contacts.py)
    scene : address of the tree
    world : the arrays of world.World, in units of the tree
    positions, normals : (P, 3) float64, in units of the tree; normals of length 1
    scratch : of scratch()
    origins : (P, 3) float32, filled
    states : (P,) uint8, filled with PLAIN, SLIVERS (a triangle is too
        narrow for float32), CONTACT (the surface rests on another one there), THIN (a gap
        is narrower than the rounding errors ask for), DOUBTFUL (no side is in front of all that touch)
        or ENCLOSED (the surface lies against another one on all sides: nothing is seen)
    """
    buffers, near, sides = scratch
    ask = (functions[0], functions[1], scene)
    for p in range(len(positions)):
        point, normal = row(positions, p), row(normals, p)
        largest = max(abs(point[0]), abs(point[1]), abs(point[2]), SMALLEST)
        radius = SEARCH_ULPS * ULP * largest
        near = touching(ask, world, point, radius, buffers, near)
        distance = ULP * (2.0 * largest + 3.0 * near.extent) + near.slack
        if 4.0 * distance > radius:
            # What the rounding of large triangles cannot tell from the point touches it.
            radius = 4.0 * distance
            near = touching(ask, world, point, radius, buffers, near)
        rounding = 2.0 * ULP * (largest + near.extent) + near.slack
        states[p] = PLAIN
        direction, wanted, least, rise = normal, distance, 1.0, -1.0
        for j in range(near.filled):
            least = min(least, dot(normal, row(near.fronts, j)))
            rise = max(rise, dot(normal, row(near.inward, j)))
        if least < ORDINARY:
            states[p] = take_sides(near, normal, radius, rounding, sides)
            direction, least = direction_in_front(near, normal, sides)
            if least < 0.0 or near.filled == MOST_TOUCHING:
                states[p] = max(states[p], DOUBTFUL)
            # Between steep walls, a few ulps from each of them is a long way from the tip.
            steep = min(distance / max(least, STEEPEST), FARTHEST * near.reach)
            wanted = max(steep, distance / max(least, 0.1))
        if rise > HOLLOW:
            wanted = max(wanted, min(OUT_OF_CORNERS * distance, FARTHEST * near.reach))
        if near.aspect > SLIVER and least < FLAT and rise < LEVEL:
            blunt = min(BESIDE_SLIVERS * near.aspect * distance, OF_WIDTH * near.width)
            wanted = max(wanted, blunt)
        if near.aspect > HOPELESS:
            states[p] = max(states[p], SLIVERS)
        if least < ORDINARY or wanted > distance:
            if 2.0 * wanted > radius:
                near = touching(ask, world, point, 2.0 * wanted, buffers, near)
            room = room_ahead(near, direction, wanted, rounding)
            if room < distance:
                states[p] = max(states[p], THIN)
            distance = room
        for i in range(3):
            origins[p, i] = point[i] + distance * direction[i]

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
"""

from __future__ import annotations

import numpy as np

from aobake.tracing.compiled import inlined, kernel
from aobake.tracing.contacts import NO_INSTANCE, candidates_near, query_buffers

__all__ = ["DOUBTFUL", "ENCLOSED", "PLAIN", "TOUCHING", "place_origins"]

PLAIN, TOUCHING, DOUBTFUL, ENCLOSED = 0, 1, 2, 3  # what was found about a point

ULP = 2.0**-23  # of a float32 in [1, 2); half of it below
SEARCH_ULPS = 32.0  # radius of what counts as touching, in ulps of the point's largest coordinate
MOST_TOUCHING = 128  # triangles weighed at one point
ORDINARY = 0.3  # a normal at least this much in front of every triangle needs no further thought
OWN = 0.02  # a triangle is the point's own if its front looks along the normal at least this much
LIFT = 0.1  # how steeply a step from the point into its own triangle's front side rises
COPLANAR = 1e-6  # 1 - |cosine| between planes that count as one
WANTED, ROUNDS = 0.25, 48  # margin that the search for a direction stops at, and its patience


@inlined
def dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def load_triangle(world, row, point, corners):  # type: ignore[no-untyped-def]
    """Corners (3, 3) of a triangle in float64, relative to the point; returns the slack of its place.

    row : (instance or NO_INSTANCE, geometry, primitive), as Embree numbers them
    """
    vertices, faces, first_vertex, first_face, flat, placed, matrices, slacks = world
    instance = np.int64(row[0]) - flat
    alone = row[0] == NO_INSTANCE
    body = np.int64(row[1]) if alone else flat + placed[instance]
    face = faces[first_face[body] + np.int64(row[2])]
    for k in range(3):
        v = vertices[first_vertex[body] + np.int64(face[k])]
        x, y, z = float(v[0]), float(v[1]), float(v[2])
        if alone:
            corners[k, 0], corners[k, 1], corners[k, 2] = x - point[0], y - point[1], z - point[2]
        else:
            m = matrices[instance]
            for i in range(3):
                corners[k, i] = m[i, 0] * x + m[i, 1] * y + m[i, 2] * z + m[i, 3] - point[i]
    return 0.0 if alone else slacks[instance]


@inlined
def distance_to_triangle(a, b, c):  # type: ignore[no-untyped-def]
    """How far the triangle a b c is from 0. Source: Ericson, Real-Time Collision Detection, 5.1.5."""
    ab0, ab1, ab2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ac0, ac1, ac2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    d1 = -(ab0 * a[0] + ab1 * a[1] + ab2 * a[2])
    d2 = -(ac0 * a[0] + ac1 * a[1] + ac2 * a[2])
    d3 = -(ab0 * b[0] + ab1 * b[1] + ab2 * b[2])
    d4 = -(ac0 * b[0] + ac1 * b[1] + ac2 * b[2])
    d5 = -(ab0 * c[0] + ab1 * c[1] + ab2 * c[2])
    d6 = -(ac0 * c[0] + ac1 * c[1] + ac2 * c[2])
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v, w = 0.0, 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        total = va + vb + vc
        v, w = vb / total, vc / total
    x = a[0] + v * ab0 + w * ac0
    y = a[1] + v * ab1 + w * ac1
    z = a[2] + v * ab2 + w * ac2
    return np.sqrt(x * x + y * y + z * z)


@inlined
def gather(world, rows, point, radius, corners, fronts, inward):  # type: ignore[no-untyped-def]
    """Keep the triangles that touch the point; returns (count, largest extent, largest slack).

    corners (K, 3, 3) relative to the point, fronts (K, 3) unit normals, inward (K, 3) unit vectors
    from the point towards the triangles' centres, within their planes: filled for the first `count`.
    """
    count, extent, slack = 0, 0.0, 0.0
    for r in range(len(rows)):
        if count == MOST_TOUCHING:
            break
        t, f, u = corners[count], fronts[count], inward[count]
        loose = load_triangle(world, rows[r], point, t)
        if not distance_to_triangle(t[0], t[1], t[2]) <= radius + loose:
            continue
        a0, a1, a2 = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
        b0, b1, b2 = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
        f[0], f[1], f[2] = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
        length = np.sqrt(dot(f, f))
        if not length > 0.0:
            continue
        for i in range(3):
            f[i] /= length
            u[i] = (t[0, i] + t[1, i] + t[2, i]) / 3.0
        rise = dot(u, f)
        for i in range(3):
            u[i] -= rise * f[i]
        length = np.sqrt(dot(u, u))
        for i in range(3):
            u[i] = u[i] / length if length > 0.0 else 0.0
        for k in range(3):
            extent = max(extent, np.sqrt(dot(t[k], t[k])))
        slack = max(slack, loose)
        count += 1
    return count, extent, slack


@inlined
def covers(t, f, q, margin):  # type: ignore[no-untyped-def]
    """Whether the triangle t with unit normal f holds q, a point of its plane, give or take a margin."""
    for k in range(3):
        a, b = t[k], t[(k + 1) % 3]
        e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        q0, q1, q2 = q[0] - a[0], q[1] - a[1], q[2] - a[2]
        c0, c1, c2 = e1 * q2 - e2 * q1, e2 * q0 - e0 * q2, e0 * q1 - e1 * q0
        if c0 * f[0] + c1 * f[1] + c2 * f[2] < -margin * np.sqrt(e0 * e0 + e1 * e1 + e2 * e2):
            return False
    return True


@inlined
def same_corners(s, t, margin):  # type: ignore[no-untyped-def]
    """Whether two triangles have the same corners, in any order: a wall modelled from both sides."""
    for i in range(3):
        found = False
        for k in range(3):
            d0, d1, d2 = s[i, 0] - t[k, 0], s[i, 1] - t[k, 1], s[i, 2] - t[k, 2]
            found = found or d0 * d0 + d1 * d1 + d2 * d2 <= margin * margin
        if not found:
            return False
    return True


@inlined
def lies_against(i, count, corners, fronts, inward, step, margin):  # type: ignore[no-untyped-def]
    """Whether triangle i lies face to face on another one at the point: a box on its ground.

    A reversed twin of the same three corners does not count: that is one wall with two sides.
    """
    q = np.empty(3)
    for j in range(count):
        if dot(fronts[i], fronts[j]) > COPLANAR - 1.0:
            continue
        if abs(dot(corners[j, 0], fronts[j])) > margin or same_corners(corners[i], corners[j], margin):
            continue
        for k in range(3):
            q[k] = step * inward[i, k]
        if covers(corners[j], fronts[j], q, margin):
            return True
    return False


@inlined
def take_sides(normal, count, corners, fronts, inward, step, margin, sides):  # type: ignore[no-untyped-def]
    """Fill sides (K,) with 1 or -1, the side of each triangle that the point is seen from; 0: no matter.

    The point's own triangles are those whose front looks along its normal. A step from the point into
    each of them, and a little up, ends in the space that the point is seen from, and so tells the side
    of every other triangle that passes through. Returns whether all of its own lie against others.
    """
    own, covered = 0, 0
    for i in range(count):
        sides[i] = 0
        if dot(fronts[i], normal) > OWN:
            own += 1
            sides[i] = 1
            if lies_against(i, count, corners, fronts, inward, step, margin):
                covered += 1
                sides[i] = 2
    enclosed = own > 0 and covered == own
    for i in range(count):
        if sides[i] == 2:
            sides[i] = 1 if enclosed else 0
    for j in range(count):
        if dot(fronts[j], normal) > OWN:
            continue
        vote = 0.0
        for i in range(count):
            if sides[i] == 1 and dot(fronts[i], normal) > OWN:
                along = dot(fronts[i], fronts[j])
                if abs(along) > 1.0 - COPLANAR and abs(dot(corners[j, 0], fronts[j])) <= margin:
                    vote = 0.0  # the back of a wall, or its twin: it asks for nothing new
                    break
                vote += step * (dot(inward[i], fronts[j]) + LIFT * along) - dot(corners[j, 0], fronts[j])
        sides[j] = 1 if vote > 0.0 else -1 if vote < 0.0 else 0
    return enclosed


@inlined
def direction_in_front(normal, count, fronts, sides, out):  # type: ignore[no-untyped-def]
    """Fill out (3,) with a direction on the wanted side of all triangles, near the normal; its margin.

    The margin is the least cosine to a triangle's wanted side; not above 0 where there is no such
    direction. Source: the perceptron of Rosenblatt, 1958, which finds one if one exists.
    """
    m = np.empty(3)
    best = -2.0
    for i in range(3):
        m[i] = normal[i]
    for _ in range(ROUNDS):
        margin, worst = 2.0, -1
        for j in range(count):
            if sides[j] != 0:
                along = sides[j] * dot(m, fronts[j])
                if along < margin:
                    margin, worst = along, j
        if margin > best:
            best = margin
            for i in range(3):
                out[i] = m[i]
        if margin >= WANTED:
            break
        push = sides[worst] * (WANTED + 0.05 - margin)
        for i in range(3):
            m[i] += push * fronts[worst, i]
        length = np.sqrt(dot(m, m))
        if length < 1e-9:
            break
        for i in range(3):
            m[i] /= length
    return best


@inlined
def room_ahead(direction, distance, count, corners, fronts, margin):  # type: ignore[no-untyped-def]
    """At most `distance`, and at most half way to any triangle that lies across a gap."""
    for j in range(count):
        above = -dot(corners[j, 0], fronts[j])
        approach = -dot(direction, fronts[j]) if above > 0.0 else dot(direction, fronts[j])
        gap = abs(above)
        if gap > margin and approach > 0.0 and distance * approach > 0.5 * gap:
            distance = 0.5 * gap / approach
    return distance


@kernel
def place_origins(functions, scene, world, positions, normals, origins, states):  # type: ignore[no-untyped-def]
    """Put the origin of each point's rays, and say what was found around it.

    functions : (address of rtcPointQuery, address of the callback of contacts.py)
    scene : address of the tree
    world : the arrays of world.World, in units of the tree
    positions, normals : (P, 3) float64, in units of the tree; normals of length 1
    origins : (P, 3) float32, filled
    states : (P,) uint8, filled with PLAIN, TOUCHING (other surfaces touch the point), DOUBTFUL (no side
        is in front of all that touch) or ENCLOSED (the surface lies against another one: nothing is seen)
    """
    buffers = query_buffers()
    corners = np.empty((MOST_TOUCHING, 3, 3))
    fronts, inward = np.empty((MOST_TOUCHING, 3)), np.empty((MOST_TOUCHING, 3))
    sides = np.empty(MOST_TOUCHING, np.int64)
    direction = np.empty(3)
    for p in range(len(positions)):
        point, normal = positions[p], normals[p]
        largest = max(abs(point[0]), abs(point[1]), abs(point[2]), 1e-6)
        radius = SEARCH_ULPS * ULP * largest
        rows = candidates_near(functions[0], functions[1], scene, point, radius, buffers)
        count, extent, slack = gather(world, rows, point, radius, corners, fronts, inward)
        distance = ULP * (2.0 * largest + 3.0 * extent) + slack
        if 4.0 * distance > radius:  # large triangles: what they cannot tell from the point touches it
            radius = 4.0 * distance
            rows = candidates_near(functions[0], functions[1], scene, point, radius, buffers)
            count, extent, slack = gather(world, rows, point, radius, corners, fronts, inward)
        states[p] = PLAIN
        least = 1.0
        for j in range(count):
            least = min(least, dot(normal, fronts[j]))
        for i in range(3):
            direction[i] = normal[i]
        if least < ORDINARY:
            rounding = 2.0 * ULP * largest + slack
            states[p] = TOUCHING if least < OWN else PLAIN
            if take_sides(normal, count, corners, fronts, inward, radius, rounding, sides):
                states[p] = ENCLOSED
            least = direction_in_front(normal, count, fronts, sides, direction)
            if least < 0.0:
                states[p] = max(states[p], DOUBTFUL)
            distance = room_ahead(direction, distance / max(least, 0.1), count, corners, fronts, rounding)
        for i in range(3):
            origins[p, i] = point[i] + distance * direction[i]

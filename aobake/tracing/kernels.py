"""The compiled loops: points in, sums over their rays out.

A point's rays go out in packets of neighbouring directions, made here, traced by Embree and
counted at once; they never exist in memory together. A packet has eight lanes, or sixteen where the processor has
instructions for them (1.04 to 1.2 times the rate); it is made and counted by eights all the same, so that what
is added up does not depend on it. A feature that is off (a ground, a limit by the
geometric normal, sums of open directions or of distances) is passed as None, for which numba compiles a kernel
without it.

The error estimate comes from the same pass: along a Hilbert curve over the hemisphere the squared
differences of successive values add up to a measure of how long the boundary of the visible region is, and
those within packets, which lie farther apart, tell whether it is a line at all (see rounds.py).

Approaches tried: one ray at a time (0.7 of the rate); directions scrambled per ray (0.5); a list of
made-up rays for a whole block, traced in a second pass (0.9, and 48 bytes a ray).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.tracing.compiled import aligned, inlined, kernel
from aobake.tracing.foreign import call_packet
from aobake.tracing.lanes import (
    ALL,
    at_most,
    below,
    count,
    divided,
    eight,
    minus,
    picked,
    plus,
    put,
    put_mask,
    spread,
    times,
)

__all__ = ["LINEAR", "SMOOTH", "SUMS", "scratch", "trace"]

LINEAR, SMOOTH = 0, 1
SUMS = 5  # columns of what trace adds up

# Rows of RTCRayN and RTCHitN: N lanes of 32 bits each. Of them eight are looked at together, from lane `at` on.
ORIGIN, NEAR, DIRECTION, TIME, FAR, MASK, RAY_NUMBER, FLAGS = 0, 3, 4, 7, 8, 9, 10, 11
GEOMETRY_ID, INSTANCE_ID = 18, 19
RAY_HIT_FLOATS = 21 * 8
MOST_LANES = 16


@inlined
def mix(seed, index):
    """64 well-mixed bits of a seed and an index. Source: SplitMix64, Steele, Lea, Flood, 2014."""
    z = np.uint64(seed) * np.uint64(0xD1342543DE82EF95) + np.uint64(index)
    for _ in range(2):
        z += np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return z


@inlined
def turned_frame(normal, bits, frame):
    """Fill frame (3, 3) with a tangent, a bitangent and the unit normal, turned by an angle from bits.

    Source: Duff et al., Building an orthonormal basis, revisited, JCGT 6(1), 2017.
    """
    x, y, z = float(normal[0]), float(normal[1]), float(normal[2])
    length = np.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    angle = float(bits >> np.uint64(11)) * (2.0 * np.pi / 2.0**53)
    c, s = np.cos(angle), np.sin(angle)
    tx, ty, tz = 1.0 + sign * x * x * a, sign * b, -sign * x
    ux, uy, uz = b, sign + y * y * a, -y
    frame[0, 0], frame[0, 1], frame[0, 2] = c * tx + s * ux, c * ty + s * uy, c * tz + s * uz
    frame[1, 0], frame[1, 1], frame[1, 2] = c * ux - s * tx, c * uy - s * ty, c * uz - s * tz
    frame[2, 0], frame[2, 1], frame[2, 2] = x, y, z


@inlined
def aim(rays, directions, frame, far, lanes, at):
    """Point the eight rays along directions (3, 8), given about +z, in the frame."""
    x, y, z = eight(directions, 0), eight(directions, 8), eight(directions, 16)
    for i in range(3):
        along = plus(times(x, spread(frame[0, i])), times(y, spread(frame[1, i])))
        put(rays, lanes * (DIRECTION + i) + at, plus(along, times(z, spread(frame[2, i]))))
    put(rays, lanes * FAR + at, spread(far))


@inlined
def set_out(rays, origin, lanes, at):
    """Put the origin of eight rays; the rows that stay the same for every packet of a point."""
    for i in range(3):
        put(rays, lanes * (ORIGIN + i) + at, spread(origin[i]))


@inlined
def ready(rays, words, lanes, at):
    """Rows that no packet changes: near end, time, mask and flags."""
    for k in range(8):
        rays[lanes * NEAR + at + k] = 0.0
        rays[lanes * TIME + at + k] = 0.0
        for row in range(MASK, FLAGS + 1):
            words[lanes * row + at + k] = -1 if row == MASK else 0


@inlined
def that_count(rays, left, geometric, lanes, at):
    """The rays that count: the first so many, of them those above the geometric surface where one is given."""
    counts = ALL if left >= 8 else (1 << left) - 1
    if geometric is not None:
        first = lanes * DIRECTION + at
        x = times(eight(rays, first), spread(geometric[0]))
        y = times(eight(rays, first + lanes), spread(geometric[1]))
        z = times(eight(rays, first + 2 * lanes), spread(geometric[2]))
        counts &= ~at_most(plus(plus(x, y), z), spread(np.float32(0.0)))
    return counts


@inlined
def stop_at_ground(rays, ground, point, falloff, distances, lanes, at):
    """End the sinking rays at the ground: at once where any hit settles them, else at its distance.

    Returns those that are settled.
    """
    if ground is None:
        return 0
    axis, heights = ground
    height, far = spread(heights[point]), eight(rays, lanes * FAR + at)
    sinking = minus(spread(np.float32(-0.0)), eight(rays, lanes * (DIRECTION + axis) + at))
    stopped = below(spread(np.float32(0.0)), sinking) & at_most(height, times(sinking, far))
    if falloff is None and distances is None:
        put(rays, lanes * FAR + at, picked(stopped, spread(np.float32(-np.inf)), far))
        return stopped
    put(rays, lanes * FAR + at, picked(stopped, divided(height, sinking), far))
    return 0


@inlined
def tell_filters(rays, words, number, falloff, distances, lanes, at):
    """Note what filters of surfaces that stop a share need: how much of a ray is left, or by what to draw."""
    if falloff is None and distances is None:
        put(rays, lanes * RAY_NUMBER + at, spread(np.float32(1.0)))
    else:
        for k in range(8):
            words[lanes * RAY_NUMBER + at + k] = 8 * number + k


@inlined
def forget_hits(words, falloff, distances, lanes, at):
    """What Embree wants to find in a packet whose nearest hits it is to look for."""
    if falloff is not None or distances is not None:
        for k in range(8):
            words[lanes * GEOMETRY_ID + at + k] = -1
            words[lanes * INSTANCE_ID + at + k] = -1


@inlined
def told_by_any_hit(rays, far, counts, falloff, distances, lanes, at):
    """The rays that met nothing, of those that count; and those that have to be looked at one by one.

    These are the ones of which a surface stopped a share, and all where the nearest hits are looked for.
    """
    if falloff is not None or distances is not None:
        return 0, ALL
    is_open = counts & ~below(eight(rays, lanes * FAR + at), spread(far))
    left = eight(rays, lanes * RAY_NUMBER + at)
    return is_open, is_open & below(left, spread(np.float32(1.0)))


@inlined
def changes(is_open, counts, before):
    """(how often successive rays that count differ, the last of them as 0 or 1), whatever lies between them.

    before : the ray before these: a number below 0 if there is none
    """
    first, filled, known = counts & -counts, is_open, counts
    for step in (1, 2, 4):  # a ray that does not count takes after the one before it
        filled |= (filled << step) & ~known
        known |= known << step
    changed = float(count((filled ^ (filled << 1)) & counts & ~first))
    if counts == 0:
        return changed, before
    if before >= 0.0:
        step = (1.0 if is_open & first else 0.0) - before
        changed += step * step
    return changed, float(filled >> 7 & 1)


@inlined
def openness(rays, k, far, falloff, distances, lanes):
    """How open the ray in lane k is: as much as is left of it where it met nothing, 1 if no surface stops a share."""
    reached = rays[lanes * FAR + k]
    if falloff is None:
        if distances is None:
            return float(rays[lanes * RAY_NUMBER + k]) if reached >= far else 0.0
        return 1.0 if reached >= far else 0.0
    u = min(max(reached / far, 0.0), 1.0)
    return u if falloff == LINEAR else u * u * (3.0 - 2.0 * u)


@inlined
def gather(open_directions, distances, point, rays, k, value, lanes):
    """Add the direction of the ray in lane k, as much as it is open, and how far it got, but no farther than counts."""
    if open_directions is not None:
        for i in range(3):
            open_directions[point, i] += value * rays[lanes * (DIRECTION + i) + k]
    if distances is not None:
        distances[1][point] += min(rays[lanes * FAR + k], distances[0])


@inlined
def gather_open(open_directions, point, rays, is_open, lanes, at):
    """Add the directions of the open rays."""
    if open_directions is not None:
        for k in range(8):
            if is_open >> k & 1:
                gather(open_directions, None, point, rays, at + k, 1.0, lanes)


@inlined
def met(rays, counts, before, point, far, falloff, open_directions, distances, lanes, at):
    """What eight rays met: sum of openness, of its squares, and of squared successive differences; the last one's.

    before : the openness of the ray before these: a number below 0 if there is none
    """
    is_open, shared = told_by_any_hit(rays, far, counts, falloff, distances, lanes, at)
    if shared == 0:
        inside = float(count(is_open))
        changed, before = changes(is_open, counts, before)
        gather_open(open_directions, point, rays, is_open, lanes, at)
        return inside, inside, changed, before
    inside, squares, changed = 0.0, 0.0, 0.0
    for k in range(8):
        if counts >> k & 1:
            value = openness(rays, at + k, far, falloff, distances, lanes)
            inside += value
            squares += value * value
            gather(open_directions, distances, point, rays, at + k, value, lanes)
            if before >= 0.0:
                changed += (value - before) * (value - before)
            before = value
    return inside, squares, changed, before


def scratch() -> tuple[
    NDArray[np.generic],
    NDArray[np.generic],
    NDArray[np.generic],
    NDArray[np.int64],
    NDArray[np.float32],
]:
    """Memory for trace, of one thread: a packet, its words, a mask, sets of lanes by eights, a frame."""
    packet = aligned(RAY_HIT_FLOATS // 8 * MOST_LANES, np.float32)
    masks, counts = aligned(MOST_LANES, np.int32), np.zeros(MOST_LANES // 8, np.int64)
    return packet, packet.view(np.int32), masks, counts, np.zeros((3, 3), np.float32)


@kernel
def trace(
    functions,
    scene,
    origins,
    normals,
    geometric,
    numbers,
    seed,
    sets,
    sizes,
    far,
    ground,
    falloff,
    scratch,
    out,
    open_directions,
    distances,
):
    """Trace a set of directions from each point and add up how open they are.

    functions : of embree.packets
    scene : address of the tree
    origins, normals : (P, 3) float32; normals of any length above 0
    geometric : (P, 3) float32, directions below it do not count; or None
    numbers : (P,) int64, what makes a point's directions its own, together with the seed
    sets : of sized_sets.SizedSets
    sizes : (P,) int64, rows of the table: how large each point's set is
    far : float32, where rays end; may be infinite
    ground : (axis, (P,) float32 heights of the origins above it), or None
    falloff : LINEAR or SMOOTH, for which the nearest hit is looked for; None: any hit closes a ray
    scratch : of scratch()
    out : (P, 5) float64: sum of openness, sum of squared successive differences, rays counted; of the packets
        whose rays all count the sum of squared differences of every two of them, and how many they are
    open_directions : (P, 3) float64, to which directions are added, each as much as it is open; or None
    distances : (how far a ray counts at most, (P,) float64 to which it is added how far they got), for which the
        nearest hit is looked for; or None
    """
    packet, words, valid, counts, frame = scratch
    any_hit, nearest_hit, lanes, asked = functions
    directions, table = sets.directions, sets.table
    halves = lanes // 8
    for half in range(halves):
        ready(packet, words, lanes, 8 * half)
    call = any_hit if falloff is None and distances is None else nearest_hit
    for point in range(len(origins)):
        bits = mix(seed, numbers[point])
        turned_frame(normals[point], bits, frame)
        for half in range(halves):
            set_out(packet, origins[point], lanes, 8 * half)
        size = sizes[point]
        rays, length = table[size, 0], table[size, 1]
        begin = table[size, 2] + np.int64(bits & np.uint64(table[size, 3] - 1)) * length
        chosen = directions[begin : begin + length]
        total, rough, counted = 0.0, 0.0, 0
        apart, whole = 0.0, 0
        before = -1.0
        above = None if geometric is None else geometric[point]
        for first in range(0, len(chosen), halves):
            for half in range(halves):
                counts[half] = 0
                if first + half < len(chosen):
                    aim(packet, chosen[first + half], frame, far, lanes, 8 * half)
                    left = rays - 8 * (first + half)
                    counts[half] = that_count(packet, left, above, lanes, 8 * half)
                    tell_filters(packet, words, first + half, falloff, distances, lanes, 8 * half)
                    forget_hits(words, falloff, distances, lanes, 8 * half)
                settled = stop_at_ground(packet, ground, point, falloff, distances, lanes, 8 * half)
                put_mask(valid, 8 * half, counts[half] & ~settled)
            call_packet(call, valid.ctypes.data, scene, packet.ctypes.data, asked)
            for half in range(min(halves, len(chosen) - first)):
                inside, squares, changed, before = met(
                    packet, counts[half], before, point, far, falloff, open_directions, distances,
                    lanes, 8 * half,
                )  # fmt: skip
                number = count(counts[half])
                total += inside
                rough += changed
                counted += number
                if number == 8:
                    apart += 8.0 * squares - inside * inside
                    whole += 1
        out[point, 0], out[point, 1], out[point, 2] = total, rough, counted
        out[point, 3], out[point, 4] = apart, whole

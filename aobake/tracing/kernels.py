"""The compiled loops: points in, sums over their rays out.

A point's rays go out in packets of eight neighbouring directions, made here, traced by Embree and
counted at once; they never exist in memory together. A feature that is off (a ground, a limit by the
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
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from aobake.tracing.compiled import aligned, inlined, tight_kernel

__all__ = ["LINEAR", "SMOOTH", "SUMS", "scratch", "trace"]

LINEAR, SMOOTH = 0, 1
SUMS = 5  # columns of what trace adds up

# Rows of RTCRay8 and RTCHit8, eight 32-bit values each.
ORIGIN, NEAR, DIRECTION, TIME, FAR, MASK, RAY_NUMBER, FLAGS = 0, 3, 4, 7, 8, 9, 10, 11
GEOMETRY_ID, INSTANCE_ID = 18, 19
RAY_HIT_FLOATS = 21 * 8


@intrinsic
def call_packet(typingctx, function, valid, scene, rays):
    """function(valid, scene, rays, no arguments), all given as integer addresses."""
    signature = types.void(types.intp, types.intp, types.intp, types.intp)

    def generate(context, builder, signature, arguments):
        pointer = ir.IntType(8).as_pointer()
        prototype = ir.FunctionType(ir.VoidType(), [pointer] * 4)
        function, *addresses = arguments
        target = builder.inttoptr(function, prototype.as_pointer())
        given = [builder.inttoptr(address, pointer) for address in addresses]
        builder.call(target, [*given, cgutils.get_null_value(pointer)])
        return context.get_dummy_value()

    return signature, generate


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
def aim(rays, directions, frame, far):
    """Point the eight rays along directions (3, 8), given about +z, in the frame."""
    for k in range(8):
        x, y, z = directions[0, k], directions[1, k], directions[2, k]
        rays[8 * DIRECTION + k] = x * frame[0, 0] + y * frame[1, 0] + z * frame[2, 0]
        rays[8 * DIRECTION + 8 + k] = x * frame[0, 1] + y * frame[1, 1] + z * frame[2, 1]
        rays[8 * DIRECTION + 16 + k] = x * frame[0, 2] + y * frame[1, 2] + z * frame[2, 2]
        rays[8 * FAR + k] = far


@inlined
def set_out(rays, origin):
    """Put the origin of all eight rays; the rows that stay the same for every packet of a point."""
    for k in range(8):
        rays[8 * ORIGIN + k] = origin[0]
        rays[8 * ORIGIN + 8 + k] = origin[1]
        rays[8 * ORIGIN + 16 + k] = origin[2]


@inlined
def ready(rays, words):
    """Rows that no packet changes: near end, time, mask and flags."""
    for k in range(8):
        rays[8 * NEAR + k] = 0.0
        rays[8 * TIME + k] = 0.0
        for row in range(MASK, FLAGS + 1):
            words[8 * row + k] = -1 if row == MASK else 0


@inlined
def choose(counts, rays, lanes, geometric):
    """Mark the rays that count: those of the set, above the geometric surface where one is given."""
    for k in range(8):
        counts[k] = -1 if k < lanes else 0
    if geometric is not None:
        for k in range(8):
            along = (
                rays[8 * DIRECTION + k] * geometric[0]
                + rays[8 * DIRECTION + 8 + k] * geometric[1]
                + rays[8 * DIRECTION + 16 + k] * geometric[2]
            )
            if along <= 0.0:
                counts[k] = 0


@inlined
def stop_at_ground(valid, rays, ground, point, falloff, distances):
    """End the sinking rays at the ground: at once where any hit settles them, else at its distance."""
    axis, heights = ground
    for k in range(8):
        sinking = -rays[8 * (DIRECTION + axis) + k]
        if sinking > 0.0 and heights[point] <= sinking * rays[8 * FAR + k]:
            if falloff is None and distances is None:
                rays[8 * FAR + k] = -np.inf
                valid[k] = 0
            else:
                rays[8 * FAR + k] = heights[point] / sinking


@inlined
def tell_filters(rays, words, number, falloff, distances):
    """Note what filters of surfaces that stop a share need: how much of a ray is left, or by what to draw."""
    for k in range(8):
        if falloff is None and distances is None:
            rays[8 * RAY_NUMBER + k] = 1.0
        else:
            words[8 * RAY_NUMBER + k] = 8 * number + k


@inlined
def forget_hits(words):
    """What Embree wants to find in a packet whose nearest hits it is to look for."""
    for k in range(8):
        words[8 * GEOMETRY_ID + k] = -1
        words[8 * INSTANCE_ID + k] = -1


@inlined
def openness(rays, k, far, falloff, distances):
    """How open ray k counts: as much as is left of it where it met nothing, 1 if no surface stops a share."""
    reached = rays[8 * FAR + k]
    if falloff is None:
        if distances is None:
            return float(rays[8 * RAY_NUMBER + k]) if reached >= far else 0.0
        return 1.0 if reached >= far else 0.0
    u = min(max(reached / far, 0.0), 1.0)
    return u if falloff == LINEAR else u * u * (3.0 - 2.0 * u)


@inlined
def gather(open_directions, distances, point, rays, k, value):
    """Add the direction of ray k, as much as it is open, and how far it got, but no farther than counts."""
    if open_directions is not None:
        for i in range(3):
            open_directions[point, i] += value * rays[8 * (DIRECTION + i) + k]
    if distances is not None:
        distances[1][point] += min(rays[8 * FAR + k], distances[0])


def scratch() -> tuple[
    NDArray[np.generic], NDArray[np.generic], NDArray[np.generic], NDArray[np.float32]
]:
    """Memory for trace, of one thread: a packet, its words, two masks, a frame."""
    packet = aligned(RAY_HIT_FLOATS, np.float32)
    return packet, packet.view(np.int32), aligned(16, np.int32), np.zeros((3, 3), np.float32)


@tight_kernel
def trace(
    functions,
    scene,
    origins,
    normals,
    geometric,
    numbers,
    seed,
    sets,
    rays,
    far,
    ground,
    falloff,
    scratch,
    out,
    open_directions,
    distances,
):
    """Trace `rays` directions from each point and add up how open they are.

    functions : (address of rtcOccluded8, address of rtcIntersect8)
    scene : address of the tree
    origins, normals : (P, 3) float32; normals of any length above 0
    geometric : (P, 3) float32, directions below it do not count; or None
    numbers : (P,) int64, what makes a point's directions its own, together with the seed
    sets : (SETS, packets, 3, 8) float32 of sampling.direction_sets(rays)
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
    packet, words, masks, frame = scratch
    valid, counts = masks[:8], masks[8:16]
    ready(packet, words)
    call = functions[0] if falloff is None and distances is None else functions[1]
    for point in range(len(origins)):
        bits = mix(seed, numbers[point])
        turned_frame(normals[point], bits, frame)
        set_out(packet, origins[point])
        chosen = sets[np.int64(bits & np.uint64(len(sets) - 1))]
        total, rough, counted = 0.0, 0.0, 0
        apart, whole = 0.0, 0
        before = -1.0
        for number in range(len(chosen)):
            aim(packet, chosen[number], frame, far)
            choose(
                counts, packet, rays - 8 * number, None if geometric is None else geometric[point]
            )
            for k in range(8):
                valid[k] = counts[k]
            tell_filters(packet, words, number, falloff, distances)
            if ground is not None:
                stop_at_ground(valid, packet, ground, point, falloff, distances)
            if falloff is not None or distances is not None:
                forget_hits(words)
            call_packet(call, masks.ctypes.data, scene, packet.ctypes.data)
            lanes, inside, squares = 0, 0.0, 0.0
            for k in range(8):
                if counts[k] != 0:
                    value = openness(packet, k, far, falloff, distances)
                    total += value
                    lanes += 1
                    inside += value
                    squares += value * value
                    gather(open_directions, distances, point, packet, k, value)
                    if before >= 0.0:
                        rough += (value - before) * (value - before)
                    before = value
            counted += lanes
            if lanes == 8:
                apart += 8.0 * squares - inside * inside
                whole += 1
        out[point, 0], out[point, 1], out[point, 2] = total, rough, counted
        out[point, 3], out[point, 4] = apart, whole

"""Which points everything that occludes lies below: told without a ray, where telling costs less than tracing.

See tracing/support.py for how. It takes the hull of all that occludes. A scan has few such points and much
to make a hull of, so some points are looked at one by one first. That is decided once for a bake, whatever
bands its points come in.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.meshes.scene import FloatArray
from aobake.overrides import forced
from aobake.points import SurfacePoints
from aobake.prepare import Prepared
from aobake.settings import TraceSettings
from aobake.tracing.conditioning import UnitFrame, unit_frame
from aobake.tracing.support import MARGIN, Hull, hull_of, open_sky
from aobake.tracing.world import Placement

__all__ = ["EVERYTHING", "OpenSky", "expected_share", "hull_rays", "sky_over"]

EVERYTHING = -1  # stands for all that occludes, beside the numbers of instances
TRIED = 64  # points that are looked at one by one, to tell how many there may be
RAYS_A_VERTEX = 200  # that could be traced while a vertex is taken into the hull
LEAST_RAYS = 100_000  # fewer are traced long before the library that makes hulls is loaded
AT_ONCE = 1 << 14  # vertices


@dataclass(frozen=True, eq=False)
class OpenSky:
    """What is known of the sky over a scene.

    hulls : of what occludes an instance, or everything: the frame that it is in, and the hull of what occludes
    """

    hulls: Mapping[int, tuple[UnitFrame, Hull]]

    def over(self, owner: int, points: SurfacePoints) -> NDArray[np.bool_] | None:
        """(P,) whether all that occludes an instance lies below a point's plane; None where nobody looked."""
        if owner not in self.hulls:
            return None
        frame, hull = self.hulls[owner]
        return open_sky(frame.apply(points.positions), points.normals, points.geometric, hull)


def sky_over(
    prepared: Prepared,
    points: SurfacePoints,
    count: int,
    ground: float | None,
    settings: TraceSettings,
) -> OpenSky:
    """What to know before tracing.

    points : those that will be traced, or some like them; count : how many there will be
    """
    found = {}
    for owner, placements, chosen in _groups(prepared, points):
        mine = points.only(chosen)
        frame = _frame(prepared, placements)
        expected = round(count * len(mine) / max(1, len(points)))
        if expected_share(prepared, placements, frame, mine, expected, ground, settings) > 0.0:
            hull = hull_of(np.concatenate([*_corners(prepared, placements, frame)]))
            if hull is not None:
                found[owner] = frame, hull
    return OpenSky(found)


def expected_share(
    prepared: Prepared,
    placements: Sequence[Placement],
    frame: UnitFrame,
    points: SurfacePoints,
    count: int,
    ground: float | None,
    settings: TraceSettings,
) -> float:
    """How many of the points everything lies below, by a sample; 0 where it does not pay to find them.

    Over a ground it is never known: the ground goes on without an end, and is seen from most points.
    """
    chosen = forced(settings.effect).get("open_sky")
    if chosen is False or ground is not None or not len(points) or not placements:
        return 0.0
    worth = count * settings.rays
    price = 0 if chosen else max(LEAST_RAYS, hull_rays(prepared, placements))
    if worth < price:
        return 0.0
    few = points.only(np.linspace(0, len(points) - 1, min(TRIED, len(points))).astype(np.int64))
    share = 1.0 if chosen else _share_open(prepared, placements, frame, few)
    return share if worth * share >= price else 0.0


def hull_rays(prepared: Prepared, placements: Sequence[Placement]) -> int:
    """How many rays could be traced while the hull is made."""
    return RAYS_A_VERTEX * sum(len(prepared.parts[p.part].vertices) for p in placements)


def _groups(
    prepared: Prepared, points: SurfacePoints
) -> Iterator[tuple[int, Sequence[Placement], NDArray[np.int64]]]:
    """What occludes which points: (instance or EVERYTHING, placements, numbers of points)."""
    if prepared.own is None:
        yield EVERYTHING, prepared.placements, np.arange(len(points))
        return
    for owner in np.unique(points.owners[points.owners >= 0]).tolist():
        yield owner, prepared.own[owner], np.flatnonzero(points.owners == owner)


def _frame(prepared: Prepared, placements: Sequence[Placement]) -> UnitFrame:
    if prepared.own is None:
        return prepared.world.frame
    identity = UnitFrame(np.zeros(3), 1.0)
    return unit_frame([cloud for cloud in _clouds(prepared, placements, identity) if len(cloud)])


def _share_open(
    prepared: Prepared, placements: Sequence[Placement], frame: UnitFrame, points: SurfacePoints
) -> float:
    """How many of a few points have everything below them, as a share."""
    share = 0.0
    for up in (points.normals, points.geometric):
        if up is not None:
            level = np.einsum("ij,ij->i", frame.apply(points.positions), up) + MARGIN
            left = np.arange(len(points))
            for cloud in _clouds(prepared, placements, frame):
                left = left[(cloud @ up[left].T).max(axis=0, initial=-np.inf) <= level[left]]
                if not len(left):
                    break
            share = max(share, len(left) / len(points))
    return share


def _clouds(
    prepared: Prepared, placements: Sequence[Placement], frame: UnitFrame
) -> Iterator[FloatArray]:
    """All vertices of what stands in a scene, in the frame, some at a time."""
    for placement in placements:
        used = _used(prepared, placement.part)
        for first in range(0, len(used), AT_ONCE):
            yield _placed(placement, used[first : first + AT_ONCE], frame)


def _corners(
    prepared: Prepared, placements: Sequence[Placement], frame: UnitFrame
) -> Iterator[FloatArray]:
    """Points with the same hull as what stands in a scene: of a mesh that stands often, its own hull's."""
    known: dict[int, FloatArray] = {}
    uses = np.bincount([placement.part for placement in placements])
    for placement in placements:
        if placement.part not in known:
            used = _used(prepared, placement.part)
            hull = hull_of(used) if uses[placement.part] > 1 else None
            known[placement.part] = used if hull is None else hull.corners
        yield _placed(placement, known[placement.part], frame)


def _used(prepared: Prepared, part: int) -> FloatArray:
    """(N, 3) the vertices that faces use."""
    triangles = prepared.parts[part]
    return triangles.vertices[np.unique(triangles.faces)]


def _placed(placement: Placement, points: FloatArray, frame: UnitFrame) -> FloatArray:
    linear, shift = placement.transform[:, :3], placement.transform[:, 3]
    return frame.apply(points @ linear.T + shift)

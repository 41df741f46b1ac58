"""How large the triangles of a scene are, as what is interpolated over them sees it."""

from __future__ import annotations

import numpy as np

from aobake.meshes.scene import Scene

__all__ = ["typical_edge"]


def typical_edge(scene: Scene) -> tuple[float, float]:
    """(longest edge of a triangle, a mean by area over the whole scene; diagonal of the scene's box).

    In scene units; what is not finite is passed over. (0.0, 0.0) for a scene without triangles.
    """
    weighted, whole = 0.0, 0.0
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for instance, mesh in scene.placed():
        with np.errstate(all="ignore"):
            places = mesh.vertices @ instance.transform[:3, :3].T + instance.transform[:3, 3]
            corners = places[mesh.faces]
            sides = corners - np.roll(corners, 1, axis=1)
            longest = np.sqrt(np.square(sides).sum(axis=2)).max(axis=1, initial=0.0)
            area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
            usable = np.isfinite(area) & np.isfinite(longest) & (area > 0.0)
        if usable.any():
            weighted += float((area * longest)[usable].sum())
            whole += float(area[usable].sum())
            low = np.minimum(low, corners[usable].min(axis=(0, 1)))
            high = np.maximum(high, corners[usable].max(axis=(0, 1)))
    if not (whole > 0.0 and np.isfinite(weighted)):
        return 0.0, 0.0
    return weighted / whole, float(np.linalg.norm(high - low))

"""Where the instances of a scene begin and end."""

from __future__ import annotations

import numpy as np

from aobake.meshes.scene import FloatArray, Scene

__all__ = ["boxes", "diagonal"]


def boxes(scene: Scene) -> FloatArray:
    """(I, 2, 3) the lowest and the highest corner of each instance, in scene units.

    Of the finite vertices that faces use; (inf, -inf) where there are none, and where the transform is not
    finite.
    """
    found = np.full((len(scene.instances), 2, 3), [[np.inf], [-np.inf]])
    used = [mesh.vertices[np.unique(mesh.faces)] for mesh in scene.meshes]
    for number, instance in enumerate(scene.instances):
        with np.errstate(all="ignore"):
            places = used[instance.mesh] @ instance.transform[:3, :3].T + instance.transform[:3, 3]
        places = places[np.isfinite(places).all(axis=1)]
        if len(places):
            found[number] = places.min(axis=0), places.max(axis=0)
    return found


def diagonal(scene: Scene) -> float:
    """The diagonal of the box around a scene, in scene units; 0 where there is nothing to put a box around."""
    found = boxes(scene)
    if not np.isfinite(found).any():
        return 0.0
    return float(np.linalg.norm(found[:, 1].max(axis=0) - found[:, 0].min(axis=0)))

"""Ambient occlusion as people write it today: numpy makes random rays, trimesh asks Embree, one thread."""

from __future__ import annotations

import numpy as np
import trimesh
from exchange import Request, answer

AT_ONCE = 1_000_000  # rays in memory
SETTINGS = {
    "rays": "independent, cosine-distributed, made by numpy; 1,000,000 at a time",
    "origin": "1e-4 of the mesh's diagonal along the normal",
    "query": "mesh.ray.intersects_any with embreex, one thread; its tree is built within the clock",
}


def prepare(request: Request):
    rng = np.random.default_rng(request.seed)
    vertices, faces, normals = (request.arrays[k] for k in ("vertices", "faces", "normals"))
    helper = np.where(np.abs(normals[:, :1]) < 0.5, [[1.0, 0, 0]], [[0, 1.0, 0]])
    tangent = np.cross(helper, normals)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normals, tangent)

    def bake(samples: int) -> np.ndarray:
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        start = vertices + 1e-4 * mesh.scale * normals
        ao = np.empty(len(vertices))
        step = max(1, AT_ONCE // samples)
        for first in range(0, len(vertices), step):
            p = slice(first, first + step)
            u, v = rng.random((2, len(start[p]), samples, 1))
            r, phi = np.sqrt(u), 2 * np.pi * v
            directions = (
                r * np.cos(phi) * tangent[p, None]
                + r * np.sin(phi) * bitangent[p, None]
                + np.sqrt(1 - u) * normals[p, None]
            )
            origins = np.repeat(start[p], samples, axis=0)
            hit = mesh.ray.intersects_any(origins, directions.reshape(-1, 3))
            ao[p] = 1.0 - hit.reshape(-1, samples).mean(axis=1)
        return ao

    return bake


if __name__ == "__main__":
    answer(f"trimesh {trimesh.__version__}", SETTINGS, prepare)

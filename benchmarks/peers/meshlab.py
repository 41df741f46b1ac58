"""MeshLab's ambient occlusion by Embree, through pymeshlab."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np
import pymeshlab
from exchange import Request, answer

SETTINGS = {
    "filter": "compute_scalar_ambient_occlusion; rays: all around, the upper half of them counts",
    "normals": "the mesh's own, as for all",
}


def prepare(request: Request):
    vertices, faces, normals = (request.arrays[k] for k in ("vertices", "faces", "normals"))

    def bake(samples: int) -> np.ndarray:
        meshes.compute_scalar_ambient_occlusion(rays=samples)
        return meshes.current_mesh().vertex_scalar_array()

    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces, v_normals_matrix=normals))
    return bake


if __name__ == "__main__":
    answer(f"pymeshlab {version('pymeshlab')}", SETTINGS, prepare)

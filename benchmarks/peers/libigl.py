"""libigl's ambient occlusion: the share of a uniform hemisphere that is hidden, which is another quantity."""

from __future__ import annotations

from importlib.metadata import version

import igl
import igl.embree
import numpy as np
from exchange import Request, answer

SETTINGS = {
    "function": "igl.embree.ambient_occlusion; directions uniform over the hemisphere, not by the cosine",
    "tree": "built within the call, as it comes",
}


def prepare(request: Request):
    vertices, faces, normals = (request.arrays[k] for k in ("vertices", "faces", "normals"))
    faces = np.ascontiguousarray(faces, np.int64)

    def bake(samples: int) -> np.ndarray:
        return 1.0 - igl.embree.ambient_occlusion(vertices, faces, vertices, normals, samples)

    return bake


if __name__ == "__main__":
    answer(f"libigl {version('libigl')}", SETTINGS, prepare)

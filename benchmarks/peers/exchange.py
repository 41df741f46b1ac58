"""What passes between a benchmark and a peer in an environment of its own: files in one folder.

request.json : kind ("vertex" or "texture"), mesh (name of an .npz), samples (a list), threads, seed, size
mesh.npz     : vertices (V, 3), faces (F, 3), normals (V, 3), and for textures uv (F, 3, 2)
answer.json  : version, settings (everything that was set, in words), runs of samples and seconds
N.npy        : the values of run number N: (V,), or (size, size) with row 0 at the top

Needs numpy alone: it runs in every peer's environment.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

__all__ = ["Request", "answer"]


class Request:
    """What a peer is asked for, and its mesh."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name, value in json.loads((folder / "request.json").read_text()).items():
            setattr(self, name, value)
        with np.load(folder / self.mesh) as arrays:
            self.arrays = {name: arrays[name] for name in arrays.files}


def answer(
    version: str,
    settings: Mapping[str, str],
    prepare: Callable[[Request], Callable[[int], np.ndarray]],
) -> None:
    """Run a peer as asked for in the folder that the command line names.

    prepare : takes the request and gives a function of the number of samples, which is what is timed; it
        is called once with few samples before the clock counts
    """
    request = Request(Path(sys.argv[1]))
    bake = prepare(request)
    bake(min([16, *request.samples]))
    runs = []
    for number, samples in enumerate(request.samples):
        start = time.perf_counter()
        values = bake(samples)
        runs.append({"samples": samples, "seconds": time.perf_counter() - start})
        np.save(request.folder / f"{number}.npy", np.asarray(values, np.float64))
        told = {"version": version, "settings": dict(settings), "runs": runs}
        (request.folder / "answer.json").write_text(json.dumps(told))

"""Assets that move: what the tests of animations share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import aobake
from aobake.meshes.scene import Scene
from tests.meshes.formats.gltf.build import (
    Builder,
    square_builder,
)
from tests.scenes import patch


def animate(builder: Builder, name: str | None, *channels: dict[str, Any]) -> None:
    """A clip of these channels: node, path, times, values, how, dtype, more for the accessor of values."""
    samplers, targets = [], []
    for channel in channels:
        values = builder.accessor(
            channel["values"], channel.get("dtype", "f4"), **channel.get("more", {})
        )
        samplers.append(
            {
                "input": builder.accessor(channel["times"]),
                "output": values,
                "interpolation": channel.get("how", "LINEAR"),
            }
        )
        target = {"node": channel["node"], "path": channel["path"]}
        targets.append({"sampler": len(samplers) - 1, "target": target})
    clip = {"samplers": samplers, "channels": targets}
    builder.put("animations", clip if name is None else {"name": name, **clip})


def moving(path: str, times: ArrayLike, values: ArrayLike, **more: Any) -> dict[str, Any]:
    """A channel of node 0."""
    return {"node": 0, "path": path, "times": times, "values": values, **more}


def sliding_square() -> Builder:
    """From x = 0 to 4 in two seconds; the file has it at x = 100."""
    builder = square_builder(translation=[100, 0, 0])
    animate(builder, "slide", moving("translation", [0, 2], [[0, 0, 0], [4, 0, 0]]))
    return builder


def at(builder: Builder, folder: Path, pose: str | None) -> Scene:
    """The asset, written and read in a pose."""
    return aobake.load(builder.glb(folder / "a.glb"), pose=pose)


def places(scene: Scene) -> list[list[float]]:
    """(V, 3) corners of the first instance where they stand."""
    instance, mesh = next(scene.placed())
    placed = mesh.vertices @ instance.transform[:3, :3].T + instance.transform[:3, 3]
    return [list(row) for row in placed]


def lifted(weights: list[float]) -> Builder:
    """A square with a target that lifts it by 1 and one that moves it by 10 along x."""
    builder = Builder()
    targets = [
        {"POSITION": builder.accessor([[0, 0, 1]] * 4)},
        {"POSITION": builder.accessor([[10, 0, 0]] * 4)},
    ]
    mesh = builder.mesh(builder.primitive(targets=targets), name="face", weights=weights)
    return builder.show(builder.node(mesh=mesh))


FLOOR = patch((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), 2, 2)
CENTRE = 4  # of the floor's nine vertices
FLAP = patch((-1, 0, 0), (0, 0, 0), (0, 1, 0), (-1, 1, 0), 2, 2)
UPRIGHT = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # a quarter turn about +y


def hinge() -> Builder:
    """A floor, and a flap beside it that turns upright in 1.5 s and lies over the floor after 3."""
    builder = Builder()
    nodes = []
    for name, part in (("flap", FLAP), ("floor", FLOOR)):
        mesh = builder.mesh(builder.primitive(part.vertices, part.faces.reshape(-1)), name=name)
        nodes.append(builder.node(mesh=mesh))
    animate(
        builder,
        "close",
        moving("rotation", [0, 2], [[0, 0, 0, 1], [0, np.sin(np.pi / 3), 0, np.cos(np.pi / 3)]]),
    )
    return builder.show(*nodes)

"""Pictures of each effect, without and with it, on a scene that calls for it: for docs/effects.md.

python benchmarks/effect_pictures.py [--pictures FOLDER]
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from cutouts import cards_mesh, leaf_texture
from numpy.typing import NDArray

import aobake
from aobake import BakeSettings, Instance, Material, Mesh, Scene
from aobake.images import encode
from aobake.meshes.scene import Image, Texture
from aobake.render_settings import RenderSettings
from aobake.shading.materials import Baked
from aobake.shading.picture import displayed
from aobake.shading.preview import render
from aobake.shading.sheet import sheet

Patch = tuple[NDArray[np.float64], NDArray[np.int64]]

SIZE = "560x236"
CELLS = 60  # of the floor, along each side


@dataclass(frozen=True)
class Pair:
    """Two bakes to look at side by side."""

    scene: Scene
    without: BakeSettings
    with_it: BakeSettings


def grid(
    corner: tuple[float, float, float],
    along: tuple[float, float, float],
    up: tuple[float, float, float],
    cells: tuple[int, int],
) -> Patch:
    """A flat patch that faces along x up."""
    u = np.linspace(0.0, 1.0, cells[0] + 1)[:, None, None]
    v = np.linspace(0.0, 1.0, cells[1] + 1)[None, :, None]
    vertices = np.asarray(corner) + u * np.asarray(along) + v * np.asarray(up)
    k = (np.arange(cells[0])[:, None] * (cells[1] + 1) + np.arange(cells[1])).reshape(-1)
    step = cells[1] + 1
    faces = np.concatenate(
        [np.stack([k, k + step, k + step + 1], 1), np.stack([k, k + step + 1, k + 1], 1)]
    )
    return vertices.reshape(-1, 3), faces


def mesh(name: str, *patches: Patch) -> Mesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in patches)])
    faces = [faces + start for (_, faces), start in zip(patches, starts, strict=False)]
    vertices = np.concatenate([vertices for vertices, _ in patches])
    return Mesh(vertices=vertices, faces=np.concatenate(faces).astype(np.int32), name=name)


def sides(x: float, y: float, z: float, size: float, cells: int = 16) -> list[Patch]:
    """A cube that stands at (x, y, z), the middle of its underside."""
    h = size / 2.0
    s, n = size, (cells, cells)
    return [
        grid((x - h, y, z + h), (s, 0, 0), (0, s, 0), n),
        grid((x + h, y, z - h), (-s, 0, 0), (0, s, 0), n),
        grid((x + h, y, z + h), (0, 0, -s), (0, s, 0), n),
        grid((x - h, y, z - h), (0, 0, s), (0, s, 0), n),
        grid((x - h, y + s, z + h), (s, 0, 0), (0, 0, -s), n),
        grid((x - h, y, z - h), (s, 0, 0), (0, 0, s), n),
    ]


def ball(x: float, y: float, z: float, radius: float, rings: int = 48) -> Mesh:
    """A sphere about a point."""
    theta = np.linspace(0.0, np.pi, rings + 1)[:, None]
    phi = np.linspace(0.0, 2.0 * np.pi, 2 * rings + 1)[None, :]
    around = np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta) + 0.0 * phi, np.sin(theta) * np.cos(phi)], -1
    )
    _, faces = grid((0, 0, 0), (1, 0, 0), (0, 1, 0), (rings, 2 * rings))
    return Mesh(
        vertices=np.array((x, y, z)) + radius * around.reshape(-1, 3),
        faces=faces.astype(np.int32),
        name="ball",
    )


FLOOR = mesh("floor", grid((-2, 0, 2), (4, 0, 0), (0, 0, -4), (CELLS, CELLS)))
WALL = mesh("wall", grid((-2, 0, -1.2), (4, 0, 0), (0, 2, 0), (CELLS, CELLS // 2)))


def still_life() -> Scene:
    """A block and a ball on a floor before a wall."""
    block = mesh("block", *sides(-0.7, 0.0, 0.2, 0.9))
    return Scene.from_meshes([FLOOR, WALL, block, ball(0.7, 0.502, 0.3, 0.5)])


def canopy() -> Scene:
    """A sheet over a floor, that looks up: from below its back is seen."""
    sheet = mesh("sheet", grid((-1, 0.7, 1), (2, 0, 0), (0, 0, -2), (CELLS, CELLS)))
    return Scene.from_meshes([FLOOR, sheet])


def row_of_steps() -> Scene:
    """Steps close together, one mesh in several places."""
    one = mesh("steps", *sides(0.0, 0.0, 0.0, 0.8), *sides(0.1, 0.801, -0.1, 0.4))
    places = []
    for k in range(4):
        matrix = np.eye(4)
        matrix[:3, 3] = (0.9 * k - 1.35, 0.001, 0.1 * k)
        places.append(Instance(mesh=0, transform=matrix, name=f"steps {k + 1}"))
    return Scene(meshes=(one, FLOOR), instances=(*places, Instance(mesh=1, name="floor")))


def thicket() -> Scene:
    """Leaf cards over a floor."""
    image = encode(leaf_texture(), "png", "8")
    leaf = Material(
        name="leaves", alpha_mode="MASK", base_color_texture=Texture(image=0), double_sided=True
    )
    cards = cards_mesh(160, 0)
    upright = cards.vertices @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
    ground = mesh("floor", grid((-1, 0, 1), (2, 0, 0), (0, 0, -2), (2 * CELLS, 2 * CELLS)))
    return Scene(
        meshes=(replace(cards, vertices=upright), replace(ground, name="floor")),
        instances=(Instance(mesh=0), Instance(mesh=1)),
        materials=(leaf,),
        images=(Image(name="leaf.png", data=lambda: image),),
    )


def pairs() -> dict[str, Pair]:
    """Effect -> what shows it."""
    plain = BakeSettings(rays=512)
    life = still_life()
    shown = replace(life, instances=life.instances[2:])
    steps = row_of_steps()
    return {
        "max_distance": Pair(life, plain, replace(plain, max_distance=0.4)),
        "falloff": Pair(
            life,
            replace(plain, max_distance=0.8),
            replace(plain, max_distance=0.8, falloff="linear"),
        ),
        "distribution": Pair(life, plain, replace(plain, distribution="uniform")),
        "spread": Pair(life, plain, replace(plain, spread=90.0)),
        "ground": Pair(shown, plain, replace(plain, ground="+y")),
        "occluders": Pair(steps, plain, replace(plain, occluders=("own",))),
        "exclude": Pair(life, plain, replace(plain, exclude=("ball",))),
        "backfaces": Pair(canopy(), plain, replace(plain, backfaces="ignore")),
        "alpha": Pair(thicket(), replace(plain, effect=("alpha=off",)), plain),
    }


def picture(pair: Pair) -> NDArray[np.float32]:
    """Without and with it, side by side, labelled."""
    settings = RenderSettings(size=SIZE, channel="ao", samples=9, view="25,25")
    cells = sheet(settings, ["off", "on"])
    for number, bake in enumerate((pair.without, pair.with_it)):
        baked = aobake.bake_vertices(pair.scene, bake)
        chosen = replace(settings, size=cells.cell_size)
        shown = render(pair.scene, chosen, Baked(ao=baked.ao))
        cells = cells.filled(number, displayed(shown))
    return cells.pixels


def bent_normals() -> NDArray[np.float32]:
    """Normals, and the mean open directions, side by side."""
    settings = RenderSettings(size=SIZE, samples=9, view="25,25", ao="none")
    cells = sheet(settings, ["normals", "bent normals"])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "bent.glb")
        baked = aobake.bake_vertices(still_life(), BakeSettings(rays=512, bent_normals=True))
        aobake.save(baked, path)
        scene = aobake.load(path)
        for number, channel in enumerate(("normal", "bent-normal")):
            chosen = replace(settings, size=cells.cell_size, channel=channel)
            cells = cells.filled(number, displayed(render(scene, chosen)))
    return cells.pixels


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--pictures", type=Path, help="folder to write them to; else only their sizes"
    )
    folder = parser.parse_args().pictures
    pictures = {name: picture(pair) for name, pair in pairs().items()}
    for name, pixels in {**pictures, "bent_normals": bent_normals()}.items():
        data, file = encode(pixels, "png", "8", srgb=True), f"effect-{name}.png"
        if folder is not None:
            (folder / file).write_bytes(data)
        print(f"{file}: {len(data) / 1024:.0f} KB")


if __name__ == "__main__":
    main()

"""What alpha costs: a field of leaf cards, opaque, with leaves cut out of them, and with the leaves as geometry.

    python benchmarks/cutouts.py [--cards 2000] [--rays 256] [--repeats 3]

All scenes have the same cards in the same places and are asked for at the same points of the ground and of the
cards. Rates are those of processor seconds, compared within one run, in turn, since machines are shared; medians
are quoted. "opaque" has the material set to OPAQUE, "no hole" an opaque texture in a MASK material: both are
traced without a filter.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from tables import Table

import aobake
from aobake.images import encode
from aobake.meshes.alpha import alpha_of
from aobake.meshes.scene import (
    AlphaMode,
    Attribute,
    Image,
    Instance,
    Material,
    Mesh,
    Scene,
    Texture,
)

FloatArray = NDArray[np.float64]

TEXELS = 512
LOBES = 5  # of a leaf


def leaf_radius(angle: FloatArray) -> FloatArray:
    """The outline of a leaf within a card that reaches from -1 to 1."""
    return np.asarray(0.86 + 0.1 * np.cos(LOBES * angle))


def leaf_texture() -> NDArray[np.float32]:
    """(TEXELS, TEXELS, 4) a leaf, with a soft edge one texel wide at alpha 0.5, on nothing."""
    middle = (np.arange(TEXELS) + 0.5) / TEXELS * 2.0 - 1.0
    x, y = np.meshgrid(middle, -middle)
    inside = (leaf_radius(np.arctan2(y, x)) - np.hypot(x, y)) * TEXELS / 2.0
    pixels = np.ones((TEXELS, TEXELS, 4), np.float32)
    pixels[..., 3] = np.clip(0.5 + inside, 0.0, 1.0)
    return pixels


def frames(cards: int, seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """Where cards are, (N, 3), and their two half edges, (N, 2, 3): a thicket over the unit square."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform((-1.0, -1.0, 0.05), (1.0, 1.0, 0.6), (cards, 3))
    across = rng.normal(size=(cards, 3))
    across /= np.linalg.norm(across, axis=1)[:, None]
    along = np.cross(across, rng.normal(size=(cards, 3)))
    along /= np.linalg.norm(along, axis=1)[:, None]
    return middle, 0.06 * np.stack([across, along], axis=1)


def cards_mesh(cards: int, material: int) -> Mesh:
    """Quads with texture coordinates."""
    middle, edges = frames(cards)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float64)
    vertices = middle[:, None] + np.einsum("kc,ncx->nkx", corners, edges)
    first = 4 * np.arange(cards)[:, None, None]
    faces = first + np.array([(0, 1, 2), (0, 2, 3)])
    uv = np.tile((corners * (1, -1) + 1.0) / 2.0, (cards, 1))
    return Mesh(
        vertices=vertices.reshape(-1, 3),
        faces=faces.reshape(-1, 3),
        name="leaves",
        material=material,
        attributes={"TEXCOORD_0": Attribute(values=uv)},
    )


def leaves_mesh(cards: int, segments: int = 100) -> Mesh:
    """The same leaves as fans of triangles."""
    middle, edges = frames(cards)
    angle = np.arange(segments) * 2.0 * np.pi / segments
    outline = leaf_radius(angle)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rim = middle[:, None] + np.einsum("kc,ncx->nkx", outline, edges)
    vertices = np.concatenate([middle[:, None], rim], axis=1)
    k = np.arange(segments)
    fan = np.stack([np.zeros_like(k), 1 + k, 1 + (k + 1) % segments], axis=1)
    faces = (segments + 1) * np.arange(cards)[:, None, None] + fan
    return Mesh(vertices=vertices.reshape(-1, 3), faces=faces.reshape(-1, 3), name="leaves")


def scene_of(mesh: Mesh, mode: AlphaMode, *, nearest: bool = False, holes: bool = True) -> Scene:
    """The mesh in a material with the leaf texture; alpha_mode and lookup as they are asked for."""
    pixels = leaf_texture()
    if not holes:
        pixels[..., 3] = 1.0
    data = encode(pixels, "png")
    material = Material(
        name="leaves",
        alpha_mode=mode,
        double_sided=True,
        base_color_texture=Texture(image=0, nearest=nearest),
    )
    return Scene(
        meshes=(mesh,),
        instances=(Instance(mesh=0),),
        materials=(material,),
        images=(Image(name="leaf", data=lambda: data),),
    )


def points_of(cards: int, count: int = 8_000) -> tuple[FloatArray, FloatArray]:
    """Points beneath the thicket and in the middle of its leaves, with normals."""
    rng = np.random.default_rng(2)
    below = np.column_stack([rng.uniform(-0.8, 0.8, (count // 2, 2)), np.zeros(count // 2)])
    middle, edges = frames(cards)
    chosen = rng.integers(0, cards, count - count // 2)
    facing = np.cross(edges[chosen, 0], edges[chosen, 1])
    positions = np.concatenate([below, middle[chosen]])
    return positions, np.concatenate([np.tile((0.0, 0.0, 1.0), (count // 2, 1)), facing])


def thicket(cards: int, rays: int, repeats: int) -> Table:
    """Rates and agreement of every way to hold the same leaves."""
    mesh = cards_mesh(cards, 0)
    scenes = {
        "opaque": scene_of(mesh, "OPAQUE"),
        "no hole": scene_of(mesh, "MASK", holes=False),
        "MASK, bilinear": scene_of(mesh, "MASK"),
        "MASK, nearest": scene_of(mesh, "MASK", nearest=True),
        "BLEND": scene_of(mesh, "BLEND"),
        "geometry": Scene.from_meshes([leaves_mesh(cards)]),
    }
    positions, normals = points_of(cards)
    settings = aobake.BakeSettings(rays=rays)
    seconds: dict[str, list[float]] = {name: [] for name in scenes}
    values = {}
    for turn in range(repeats + 1):
        for name, scene in scenes.items():
            start = time.process_time()
            values[name] = aobake.visibility(scene, positions, normals, settings).mean
            if turn:  # the first one compiles and decodes
                seconds[name].append(time.process_time() - start)
    total, truth = len(positions) * rays, values["geometry"]
    base = statistics.median(seconds["opaque"])
    rows = []
    for name in scenes:
        took, off = statistics.median(seconds[name]), np.abs(values[name] - truth)
        shift = float(values[name].mean() - truth.mean())
        mean, rms = float(values[name].mean()), float(np.sqrt((off**2).mean()))
        rows.append([name, total / took / 1e6, base / took, mean, shift, rms, float(off.max())])
    columns = ("scene", "Mrays/s a thread", "rate / opaque", "mean AO", "off geometry",
               "rms off geometry", "most off geometry")  # fmt: skip
    reasons = [
        f"{name}: {alpha_of(scenes[name])[0].reason}"
        for name in ("no hole", "MASK, bilinear", "BLEND")
    ]
    facts = {"cards": cards, "points": len(positions), "rays": rays}
    return Table("Leaf cards", columns, rows, facts, "\n\n".join(reasons))


def run(quick: bool) -> Iterator[Table]:
    """A thicket."""
    yield thicket(*((300, 32, 1) if quick else (2000, 256, 3)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cards", type=int, default=2000)
    parser.add_argument("--rays", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    print(thicket(given.cards, given.rays, given.repeats).markdown())


if __name__ == "__main__":
    main()

"""Unwrapping beside plain xatlas: seconds, charts, seams, stretch, and what of an image is filled.

    python benchmarks/unwrap.py [--body scan|ring] [--faces 70000] [--padding 2] [--size 1024]

Both cut the same body in the same run. xatlas takes the size as a hint, so that ours is packed onto
an image of as many texels as xatlas has used. An image is filled by what charts cover, not by padding.
Plain xatlas takes a minute or more.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xatlas
from numpy.typing import NDArray
from scan import scan
from tables import Cell, Table

import aobake
from aobake.atlas.packing import pack
from aobake.atlas.unwrap import unwrap
from aobake.meshes.scene import Mesh

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Unwrapped:
    """positions (V', 3) and uv (V', 2) in [0, 1] of new vertices; faces (F, 3) among them."""

    seconds: float
    charts: int
    width: int
    height: int
    positions: FloatArray
    faces: NDArray[np.int32]
    uv: FloatArray


def ring(faces: int) -> tuple[FloatArray, NDArray[np.int32]]:
    """(V, 3) vertices and (F, 3) faces of a bent ring, lumpy on a large scale and rough on three smaller ones."""
    rows = max(3, round((faces / 6) ** 0.5))
    columns = 3 * rows
    p, q = np.meshgrid(
        2 * np.pi * np.arange(columns) / columns, 2 * np.pi * np.arange(rows) / rows, indexing="ij"
    )
    thick = 0.35 + 0.08 * np.sin(3 * p) + 0.04 * np.sin(7 * p + 2 * q) * np.sin(3 * q)
    thick += 0.012 * np.sin(29 * p) * np.sin(11 * q + 3 * p)
    thick += 0.002 * np.sin(97 * p + 1) * np.sin(41 * q)
    radius = 1 + 0.1 * np.cos(2 * p) + thick * np.cos(q)
    height = thick * np.sin(q) + 0.3 * np.sin(2 * p)
    vertices = np.stack([radius * np.cos(p), radius * np.sin(p), height], axis=-1).reshape(-1, 3)
    i, j = (n.reshape(-1) for n in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    a, b = i * rows + j, i * rows + (j + 1) % rows
    c, d = (i + 1) % columns * rows + j, (i + 1) % columns * rows + (j + 1) % rows
    quads = np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)])
    return vertices, quads.astype(np.int32)


BODIES = {"scan": scan, "ring": ring}


def plain(vertices: FloatArray, faces: NDArray[np.int32], size: int, padding: int) -> Unwrapped:
    """xatlas as it comes, but for size and padding."""
    atlas = xatlas.Atlas()
    options = xatlas.PackOptions()
    options.resolution, options.padding = size, padding
    start = time.perf_counter()
    atlas.add_mesh(vertices.astype(np.float32), faces.astype(np.uint32))
    atlas.generate(xatlas.ChartOptions(), options)
    source, corners, uv = atlas[0]
    seconds = time.perf_counter() - start
    return Unwrapped(
        seconds, atlas.chart_count, atlas.width, atlas.height,
        vertices[source], corners.astype(np.int32), uv.astype(np.float64),
    )  # fmt: skip


def ours(vertices: FloatArray, faces: NDArray[np.int32], size: int, padding: int) -> Unwrapped:
    """Unwrapped and packed by aobake."""
    settings = aobake.BakeSettings(size=size, padding=padding)
    start = time.perf_counter()
    charts = unwrap([Mesh(vertices=vertices, faces=faces)], settings)
    packed = pack([(charts[0], 1.0)], settings)
    seconds = time.perf_counter() - start
    return Unwrapped(
        seconds, int(charts[0].chart.max()) + 1, size, size,
        vertices[charts[0].source], charts[0].faces, packed.uv[0],
    )  # fmt: skip


def stretch(found: Unwrapped) -> float:
    """L2, weighted by area, 1 for an isometry. Source: P. Sander et al., Texture mapping progressive meshes, 2001."""
    p = found.positions[found.faces]
    q = found.uv[found.faces] * (found.width, found.height)
    e1, e2, f1, f2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
    doubled = f1[:, 0] * f2[:, 1] - f1[:, 1] * f2[:, 0]
    along = (e1 * f2[:, 1:] - e2 * f1[:, 1:]) / doubled[:, None]
    across = (e2 * f1[:, :1] - e1 * f2[:, :1]) / doubled[:, None]
    area = 0.5 * np.linalg.norm(np.cross(e1, e2), axis=1)
    squared = 0.5 * ((along**2).sum(axis=1) + (across**2).sum(axis=1))
    density = 0.5 * np.abs(doubled).sum() / area.sum()
    return math.sqrt((area * squared).sum() / area.sum() * density)


def seams(found: Unwrapped) -> float:
    """Length of the cuts, in diagonals of the body's box."""
    edges = np.sort(found.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    once, count = np.unique(edges, axis=0, return_counts=True)
    a, b = found.positions[once[count == 1]].transpose(1, 0, 2)
    box = found.positions.max(axis=0) - found.positions.min(axis=0)
    return float(0.5 * np.linalg.norm(a - b, axis=1).sum() / np.linalg.norm(box))


def filled(found: Unwrapped) -> float:
    """Share of the image that triangles cover."""
    q = found.uv[found.faces]
    u, v = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
    return float(0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum())


def table_of(body: str, faces: int, size: int, padding: int) -> Table:
    """Both on one body."""
    vertices, triangles = BODIES[body](faces)
    ours(*scan(2000), 256, 2)  # compiled now
    theirs = plain(vertices, triangles, size, padding)
    size = round(math.sqrt(theirs.width * theirs.height))
    mine = ours(vertices, triangles, size, padding)
    rows: list[list[Cell]] = [
        ["image", f"{theirs.width} x {theirs.height}", f"{size} x {size}", None],
        ["charts", theirs.charts, mine.charts, None],
    ]
    measures = {
        "seconds": (theirs.seconds, mine.seconds),
        "image filled": (filled(theirs), filled(mine)),
        "seam length": (seams(theirs), seams(mine)),
        "L2 stretch": (stretch(theirs), stretch(mine)),
    }
    rows += [[name, one, other, other / one] for name, (one, other) in measures.items()]
    facts = {"triangles": len(triangles), "texels of padding": padding}
    return Table(f"Unwrapping a {body}", ("what", "xatlas", "aobake", "ratio"), rows, facts)


def run(quick: bool) -> Iterator[Table]:
    """Both bodies."""
    for body in BODIES:
        yield table_of(body, *((2_000, 256, 2) if quick else (70_000, 1024, 2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", choices=BODIES, default="scan")
    parser.add_argument("--faces", type=int, default=70_000)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--padding", type=int, default=2)
    asked = parser.parse_args()
    print(table_of(asked.body, asked.faces, asked.size, asked.padding).markdown())


if __name__ == "__main__":
    main()

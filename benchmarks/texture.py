"""What a lightmap costs: seconds of each stage, and the error that is left, by rays and with the denoiser.

    python benchmarks/texture.py [--faces 6000] [--size 1024] [--reference 2048]

One generated body, unwrapped once and then baked onto its own texture coordinates; the error is against a bake
of many rays without denoising, over covered texels.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np
from scan import scan
from tables import Cell, Table

from aobake import BakedTexture, BakeSettings, Instance, Mesh, Scene, bake_texture
from aobake.meshes.lightmap import Unwrapped
from aobake.meshes.scene import Attribute

BUDGETS = (8, 16, 32, 64, 96, 128, 256)
TRACED = {"trace", "denoise"}
GIVEN = {"unwrap", "compile"}  # of the asset, and of the first bake of a machine


def unwrapped(faces: int, size: int) -> tuple[Scene, float]:
    """A body with texture coordinates of its own, and the seconds that they took."""
    scene = Scene.from_arrays(*scan(faces))
    baked = bake_texture(scene, BakeSettings(size=size, rays=1, denoise="off"))
    placing = baked.lightmap.placings[0]
    if placing is None or not isinstance(placing.layout, Unwrapped):
        raise RuntimeError("the body has texture coordinates already")
    mesh, layout = scene.meshes[0], placing.layout
    attributes = {"TEXCOORD_0": Attribute(values=layout.uv, corners=layout.faces)}
    kept = Mesh(vertices=mesh.vertices, faces=mesh.faces, attributes=attributes)
    return Scene(meshes=(kept,), instances=(Instance(mesh=0),)), baked.seconds["unwrap"]


def spent(baked: BakedTexture) -> tuple[float, float]:
    """Seconds once unwrapped and compiled, and the share of all but tracing and denoising."""
    stages = {stage: s for stage, s in baked.seconds.items() if stage not in GIVEN}
    whole = sum(stages.values())
    return whole, sum(s for stage, s in stages.items() if stage not in TRACED) / whole


def table_of(faces: int, size: int, reference: int, budgets: tuple[int, ...]) -> Table:
    """One row for each budget, without and with the denoiser."""
    scene, unwrap_s = unwrapped(faces, size)
    truth = bake_texture(scene, BakeSettings(size=size, rays=reference, denoise="off", seed=1))
    covered, rows = truth.coverage, []
    for rays in budgets:
        for denoise in ("off", "on"):
            baked = bake_texture(scene, BakeSettings(size=size, rays=rays, denoise=denoise))
            error = np.abs(baked.image - truth.image)[covered].astype(np.float64)
            seconds, other = spent(baked)
            row: list[Cell] = [rays, denoise, float(np.sqrt(np.mean(error**2)))]
            row += [float(np.quantile(error, 0.99)), seconds, baked.seconds["trace"]]
            rows.append([*row, baked.seconds.get("denoise", 0.0), f"{other:.0%}"])
    columns = ("rays", "denoised", "RMSE", "p99", "seconds", "trace", "denoise", "all else")
    facts = {
        "triangles": scene.triangles,
        "size": size,
        "covered": f"{covered.mean():.0%}",
        "unwrapped in": unwrap_s,
    }
    return Table("A lightmap", columns, rows, facts, truth.layout[0])


def run(quick: bool) -> Iterator[Table]:
    """One body."""
    yield table_of(*((2_000, 128, 256, (8, 32)) if quick else (6_000, 1024, 2048, BUDGETS)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faces", type=int, default=6000)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--reference", type=int, default=2048)
    asked = parser.parse_args()
    print(table_of(asked.faces, asked.size, asked.reference, BUDGETS).markdown())


if __name__ == "__main__":
    main()

"""What accuracy costs in a texture, with and without denoising: the tables of docs/accuracy.md.

    python benchmarks/study_textures.py [--size 512] [--only NAME] [--draw FOLDER]

Generated assets, each laid out once; errors are against 2,048 rays a texel, over all texels that surfaces lie on.
Both ways of a level come from the same rays, so that their seconds can be compared.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bodies import bodies
from tables import Cell, Table

import aobake
from aobake.atlas.denoise import available
from aobake.study import Curve, Study, measure_texture, needed, texture_extent
from aobake.study.texture_bench import texture_bench

HERE = Path(__file__).parent
ASSETS = ("demo hall", "scan, 20,000 faces", "soft body", "town of boxes")
ERRORS = (0.02, 0.01, 0.005)
BUDGETS = tuple(2**k for k in range(2, 10))
RATIOS = (16, 64, 256, 512)  # rays
MOVED = (0.002, 0.01, 0.05)
NO_HELP = 0.95  # of the error left is as good as all
TRACED, DENOISED = "traced", "denoised"
BY_RAYS = "RMSE by rays"


def tables(scenes: Mapping[str, aobake.Scene], size: int, quick: bool) -> Iterator[Table]:
    """Errors by rays, what denoising saves, and where it ends."""
    extent = replace(
        texture_extent(quick=quick),
        reference=2048,
        budgets=BUDGETS,
        tolerances=(),
        seeds=1,
        shown=(),
    )
    settings = aobake.BakeSettings(size=size)
    studies = {name: measure_texture(s, settings, extent)[0] for name, s in scenes.items()}
    yield by_rays(studies, size, extent.reference)
    if available():
        yield savings(studies)
        yield ends(studies)
    yield later(scenes, settings, extent.reference)


def by_rays(studies: Mapping[str, Study], size: int, reference: int) -> Table:
    """The error of fixed numbers of rays, in both ways."""
    rays = [level.setting for level in next(iter(studies.values())).fixed.levels]
    rows: list[list[Cell]] = []
    for name, study in studies.items():
        for way, curve in ((TRACED, study.fixed), (DENOISED, study.denoised)):
            if curve is not None:
                rows.append([name, way, *(level.rmse for level in curve.levels), curve.slope])
    facts = {"size": size, "reference": reference}
    return Table(BY_RAYS, ("asset", "way", *rays, "slope"), rows, facts)


def savings(studies: Mapping[str, Study]) -> Table:
    """Rays and seconds for an error, in both ways."""
    rows: list[list[Cell]] = []
    for name, study in studies.items():
        for rmse in ERRORS:
            plain, smooth = needed(study.fixed, rmse), needed(denoised(study), rmse)
            if plain is not None and smooth is not None:
                told = [plain[0], smooth[0], smooth[0] / plain[0]]
                rows.append([name, rmse, *told, plain[1], smooth[1], smooth[1] / plain[1]])
    columns = ("asset", "RMSE", "rays", "denoised", "ratio", "seconds", "denoised", "ratio")
    return Table("What denoising saves", columns, rows)


def ends(studies: Mapping[str, Study]) -> Table:
    """What is left of errors, and up to how many rays a denoiser is worth its seconds, or helps at all."""
    rows = [
        [name, *left(study), worth_up_to(study), helps_up_to(study)]
        for name, study in studies.items()
    ]
    left_of = [f"{what} at {rays:,}" for rays in RATIOS for what in ("RMSE", "99 %")]
    columns = ("asset", *left_of, "saves seconds up to", "helps up to")
    note = "Shares of the error as it was traced; at so many rays."
    return Table("Where denoising ends", columns, rows, note=note)


def later(scenes: Mapping[str, aobake.Scene], settings: aobake.BakeSettings, rays: int) -> Table:
    """What becomes of texels after rays and denoiser, which no rays make smaller."""
    rows: list[list[Cell]] = []
    for name, scene in scenes.items():
        moved = np.abs(texture_bench(scene, settings).moved_later(rays))
        shares = [f"{np.mean(moved > least):.1%}" for least in MOVED]
        rows.append([name, float(np.sqrt(np.mean(moved**2))), *shares])
    columns = ("asset", "RMS of all texels", *(f"by more than {least:g}" for least in MOVED))
    return Table("What rims and seams move", columns, rows, {"rays": rays})


def denoised(study: Study) -> Curve:
    """Its denoised curve, which there has to be."""
    if study.denoised is None:
        raise RuntimeError("there is no denoiser")
    return study.denoised


def left(study: Study) -> Iterator[Cell]:
    """Shares of the root mean square error and of the 99th percentile that are left."""
    smooth = {level.setting: level for level in denoised(study).levels}
    plain = {level.setting: level for level in study.fixed.levels}
    for rays in map(str, RATIOS):
        known = rays in plain
        yield smooth[rays].rmse / plain[rays].rmse if known else None
        yield smooth[rays].p99 / plain[rays].p99 if known else None


def worth_up_to(study: Study) -> Cell:
    """The most rays of a level that more rays without a denoiser do not reach in the same seconds."""
    worth = []
    for smooth in denoised(study).levels:
        same = needed(study.fixed, smooth.rmse)
        if same is not None and smooth.seconds < same[1]:
            worth.append(int(smooth.setting))
    return max(worth, default=None)


def helps_up_to(study: Study) -> Cell:
    """The most rays of a level of which the denoiser takes away a part of the error that counts."""
    pairs = zip(study.fixed.levels, denoised(study).levels, strict=True)
    helped = [int(p.setting) for p, smooth in pairs if smooth.rmse < NO_HELP * p.rmse]
    return max(helped, default=None)


def draw(record: Mapping[str, Any], folder: Path) -> None:
    """The picture of errors by rays."""
    import matplotlib.pyplot as plt
    from figures import STYLE, save

    table = next(t for t in record["tables"] if t["title"] == BY_RAYS)
    rays = [int(column) for column in table["columns"][2:-1]]
    colors = dict(zip(ASSETS, ("#1f5fa8", "#c8553d", "#588157", "#8d6a9f"), strict=True))
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(7.2, 4.4), layout="constrained")
        for name, way, *errors, _ in table["rows"]:
            line, label = ("-", name) if way == TRACED else ("--", None)
            axes.loglog(rays, errors, f"o{line}", ms=3.5, lw=1.4, color=colors[name], label=label)
        axes.plot([], [], "--", color="#3a3a3a", lw=1.4, label=DENOISED)
        axes.set(xlabel="rays a texel", ylabel="root mean square error")
        axes.set_xticks(rays, [f"{n:,}" for n in rays])
        axes.minorticks_off()
        errors_shown = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
        axes.set_yticks(errors_shown, [f"{error:g}" for error in errors_shown])
        axes.legend(frameon=False)
        save(figure, folder / "accuracy-denoising.png")
        plt.close(figure)


def last_whole_run() -> Mapping[str, Any]:
    """The record of the last run that was not quick."""
    lines = (HERE / "results" / "study_textures.jsonl").read_text(encoding="utf-8").splitlines()
    return [record for record in map(json.loads, lines) if not record["quick"]][-1]


def run(quick: bool) -> Iterator[Table]:
    """Four assets, or a soft body alone."""
    chosen = ASSETS[2:3] if quick else ASSETS
    scenes = bodies()
    yield from tables({name: scenes[name] for name in chosen}, 128 if quick else 512, quick)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--only", choices=ASSETS)
    parser.add_argument("--draw", type=Path, metavar="FOLDER", help="the picture of the last run")
    asked = parser.parse_args()
    if asked.draw:
        draw(last_whole_run(), asked.draw)
        return
    chosen = [asked.only] if asked.only else ASSETS
    scenes = {name: scene for name, scene in bodies().items() if name in chosen}
    for table in tables(scenes, asked.size, quick=False):
        print(table.markdown(), flush=True)


if __name__ == "__main__":
    main()

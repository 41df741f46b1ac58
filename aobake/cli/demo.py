"""`aobake demo`: everything once, on a scene that the package makes itself."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from aobake.cli import terminal
from aobake.cli.options import AtlasFlags, CommonOptions, Output, TraceFlags
from aobake.cli.output import check_target
from aobake.config import Configured, configured
from aobake.files import make_folder

__all__ = ["demo"]

COLORS, LIGHTMAP, PICTURE, PAGE, REPORT = (
    "hall.glb", "hall_lightmap.glb", "hall.png", "hall.html", "report.json",
)  # fmt: skip

TEXEL_RAYS = 64  # the denoiser does the rest


def demo(
    *,
    output: Output = Path("aobake-demo"),
    trace: TraceFlags = None,
    atlas: AtlasFlags = None,
    common: CommonOptions = CommonOptions(),  # noqa: B008 - frozen
) -> int:
    """Bake a scene that aobake makes itself, to see what it does.

    Writes into a folder: hall.glb (vertex colours), hall_lightmap.glb (a
    texture), hall.png (without and with ambient occlusion), hall.html (the
    same to turn around, in a browser) and report.json.

    Parameters
    ----------
    output:
        The folder to write into; it is made if needed. [default: aobake-demo]
    """
    report = common.report or output / REPORT
    chosen = configured(None, trace, atlas)
    made = make_folder(output)
    try:
        for name in (COLORS, LIGHTMAP, PICTURE, PAGE):
            check_target(output / name, force=common.force)
        check_target(report, force=common.force)
        _bake(output, chosen, dataclasses.replace(common, report=report))
        _show(output, chosen, quiet=common.quiet)
    except BaseException:
        if made and not any(output.iterdir()):
            output.rmdir()
        raise
    if not common.quiet:
        terminal.say(
            f"Look at {output / PICTURE}, and open {output / PAGE} in a browser:",
            "at the foot of the columns, under the bench, in the niche, the well and the pots.",
        )
    return 0


def _bake(folder: Path, chosen: Configured, common: CommonOptions) -> None:
    """The scene with its occlusion at vertices, and with a lightmap."""
    from aobake.cli.work import bake_in_memory
    from aobake.demo import hall
    from aobake.jobs import Job

    scene = hall()
    few = dataclasses.replace(chosen.bake, rays=min(chosen.bake.rays, TEXEL_RAYS))
    colors = Job(
        command="vertex",
        name="demo",
        input=folder / COLORS,
        output=folder / COLORS,
        chosen=chosen,
        force=common.force,
    )
    lightmap = dataclasses.replace(
        colors,
        command="texture",
        output=folder / LIGHTMAP,
        chosen=dataclasses.replace(chosen, bake=few),
    )
    bake_in_memory(scene, colors, common)
    bake_in_memory(scene, lightmap, dataclasses.replace(common, report=None))


def _show(folder: Path, chosen: Configured, *, quiet: bool) -> None:
    """A picture and a page of what was baked."""
    from aobake import load, previews
    from aobake.cli.leaving import leaving_promptly
    from aobake.files import write_files
    from aobake.render_settings import RenderSettings
    from aobake.shading.picture import encoded_sheet
    from aobake.viewer import packed_glb, page_of

    with leaving_promptly(), terminal.progress_bar(quiet=quiet) as progress:
        scene = load(folder / LIGHTMAP)
        sheet = previews.compare(scene, "ao", RenderSettings(), chosen.bake, progress=progress)
        page = page_of(packed_glb(scene).glb, "The hall", [f"{scene.triangles:,} triangles"])
        write_files(
            {folder / PICTURE: encoded_sheet(sheet.pixels, ".png", None), folder / PAGE: page}
        )

"""`aobake demo`: everything once, on a scene that the package makes itself."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from aobake.cli import terminal
from aobake.cli.config import configured
from aobake.cli.options import BakeFlags, CommonOptions, Output
from aobake.cli.output import check_target, make_folder

__all__ = ["demo"]

ASSET, REPORT = "hall.glb", "report.json"


def demo(
    *,
    output: Output = Path("aobake-demo"),
    bake: BakeFlags = None,
    common: CommonOptions = CommonOptions(),  # noqa: B008 - frozen
) -> int:
    """Bake a scene that aobake makes itself, to see what it does.

    Writes hall.glb and report.json into a folder.

    Parameters
    ----------
    output:
        The folder to write into; it is made if needed. [default: aobake-demo]
    """
    asset, report = output / ASSET, common.report or output / REPORT
    chosen = configured(None, bake)
    made = make_folder(output)
    try:
        for target in (asset, report):
            check_target(target, force=common.force)

        from aobake.cli.work import Work, bake_vertices_to
        from aobake.demo import hall

        settled = dataclasses.replace(common, report=report)
        work = Work(command="demo", output=asset, chosen=chosen, common=settled)
        bake_vertices_to(hall(), work)
    except BaseException:
        if made and not any(output.iterdir()):
            output.rmdir()
        raise
    if not common.quiet:
        terminal.say(
            f"Open {asset} in a viewer of glTF files, such as https://gltf-viewer.donmccurdy.com or Blender:",
            "look at the foot of the columns, under the bench, into the niche, the well and the pots.",
        )
    return 0

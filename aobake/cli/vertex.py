"""`aobake vertex`: bake to vertex colours."""

from __future__ import annotations

import time
from pathlib import Path

from aobake.cli.config import configured
from aobake.cli.leaving import leaving_promptly
from aobake.cli.options import BakeFlags, CommonOptions, Output, SourceOptions, StoreFlags
from aobake.cli.output import check_asset_target, check_target

__all__ = ["vertex"]


def vertex(
    input: Path,
    /,
    *,
    output: Output,
    store: StoreFlags = None,
    bake: BakeFlags = None,
    source: SourceOptions = SourceOptions(),  # noqa: B008 - frozen
    common: CommonOptions = CommonOptions(),  # noqa: B008 - frozen
) -> int:
    """Bake ambient occlusion to vertex colours.

    Reads glTF, GLB, OBJ, PLY, USD, STL, OFF, 3MF and DAE; writes glTF, GLB,
    OBJ, PLY and USD layers. Everything else in the asset stays as it is.

    Defaults can be set in a file aobake.toml beside the input or in a folder
    above it: one setting a line, named as below with underscores, such as
    max_rays = 1024. Flags have the last word.

    Parameters
    ----------
    input:
        The asset to bake.
    output:
        The file to write; its ending chooses the format.
    """
    chosen = configured(input, bake, store)
    check_asset_target(output, force=common.force, inputs=[input])
    if common.report is not None:
        check_target(common.report, force=common.force)

    from aobake import load
    from aobake.cli.work import Work, bake_vertices_to
    from aobake.meshes.formats import check_target as check_format

    started = time.perf_counter()
    with leaving_promptly():
        scene = load(input, root=source.root, scene=source.scene)
    seconds = {"read": time.perf_counter() - started}
    warnings = check_format(scene, output, chosen.store)
    read = scene.source.files if scene.source else ()
    bake_vertices_to(
        scene,
        Work(
            command="vertex",
            output=output,
            chosen=chosen,
            common=common,
            inputs=read,
            seconds=seconds,
            warnings=warnings,
        ),
    )
    return 0

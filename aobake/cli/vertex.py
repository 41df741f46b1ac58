"""`aobake vertex`: bake to vertex colours."""

from __future__ import annotations

from pathlib import Path

from aobake.cli.options import (
    CommonOptions,
    ConfigOptions,
    Output,
    SourceOptions,
    StoreFlags,
    TraceFlags,
    VertexFlags,
)
from aobake.cli.output import check_asset_target, check_target

__all__ = ["vertex"]


def vertex(
    input: Path,
    /,
    *,
    output: Output,
    store: StoreFlags = None,
    vertices: VertexFlags = None,
    trace: TraceFlags = None,
    config: ConfigOptions = ConfigOptions(),  # noqa: B008 - frozen
    source: SourceOptions = SourceOptions(),  # noqa: B008 - frozen
    common: CommonOptions = CommonOptions(),  # noqa: B008 - frozen
) -> int:
    """Bake ambient occlusion to vertex colours.

    Reads glTF, GLB, OBJ, PLY, USD, STL, OFF, 3MF and DAE; writes glTF, GLB,
    OBJ, PLY and USD layers. Everything else in the asset stays as it is.

    Defaults can be set in files aobake.toml beside the input and in folders
    above it: one setting a line, named as below with underscores, such as
    max_rays = 1024. Flags have the last word.

    Parameters
    ----------
    input:
        The asset to bake.
    output:
        The file to write; its ending chooses the format.
    """
    from aobake.meshes.formats import WRITABLE

    chosen = config.configured(input, trace, vertices, store)
    check_asset_target(output, WRITABLE, "ambient occlusion", force=common.force, inputs=[input])
    if common.report is not None:
        check_target(common.report, force=common.force)

    from aobake.cli.work import bake_file

    bake_file("vertex", input, output, chosen=chosen, source=source, common=common)
    return 0

"""`aobake vertex`: bake to vertex colours."""

from __future__ import annotations

from pathlib import Path

from aobake.cli.config import configured
from aobake.cli.options import (
    CommonOptions,
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
    from aobake.meshes.formats import WRITABLE

    chosen = configured(input, trace, vertices, store)
    check_asset_target(output, WRITABLE, "ambient occlusion", force=common.force, inputs=[input])
    if common.report is not None:
        check_target(common.report, force=common.force)

    from aobake.cli.work import Work, bake_vertices_to, opened

    work = Work(command="vertex", output=output, chosen=chosen, common=common)
    bake_vertices_to(opened(input, source, work), work)
    return 0

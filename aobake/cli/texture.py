"""`aobake texture`: bake to a lightmap texture."""

from __future__ import annotations

from pathlib import Path

from aobake.cli.options import (
    AtlasFlags,
    CommonOptions,
    ConfigOptions,
    ImageFlags,
    Output,
    SourceOptions,
    TraceFlags,
)
from aobake.cli.output import check_asset_target, check_target

__all__ = ["texture"]


def texture(
    input: Path,
    /,
    *,
    output: Output,
    image: ImageFlags = None,
    trace: TraceFlags = None,
    atlas: AtlasFlags = None,
    config: ConfigOptions = ConfigOptions(),  # noqa: B008 - frozen
    source: SourceOptions = SourceOptions(),  # noqa: B008 - frozen
    common: CommonOptions = CommonOptions(),  # noqa: B008 - frozen
) -> int:
    """Bake ambient occlusion to a lightmap texture.

    Keeps the asset's texture coordinates where they do not overlap, and unwraps
    it into a set of its own else. Writes glTF and GLB (an occlusionTexture), OBJ
    (map_Ka and map_ao), or the image alone (PNG, EXR, TIFF). Everything else in
    the asset stays as it is.

    Defaults can be set in files aobake.toml beside the input and in folders
    above it: one setting a line, named as below with underscores, such as
    padding = 8. Flags have the last word.

    Parameters
    ----------
    input:
        The asset to bake.
    output:
        The asset or the image to write; its ending chooses the format.
    """
    from aobake.meshes.formats import IMAGES, TEXTURE_WRITABLE

    chosen = config.configured(input, trace, atlas, image)
    check_asset_target(
        output,
        (*TEXTURE_WRITABLE, *IMAGES),
        "a lightmap texture",
        force=common.force,
        inputs=[input],
    )
    if common.report is not None:
        check_target(common.report, force=common.force)

    from aobake.cli.work import bake_file

    bake_file("texture", input, output, chosen=chosen, source=source, common=common)
    return 0

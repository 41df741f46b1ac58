"""`aobake view`: a page that shows the asset with its ambient occlusion, in any browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from aobake.cli import terminal
from aobake.cli.app import Group, Parameter
from aobake.cli.leaving import leaving_promptly
from aobake.cli.options import COMMON, Output, SourceOptions
from aobake.cli.output import check_asset_target

__all__ = ["view"]

WRITING = Group("Writing", sort_key=1)
ENDINGS = (".html", ".htm")


def view(
    input: Path,
    /,
    *,
    output: Output,
    show: Annotated[bool, Parameter(name="--open", group=WRITING)] = False,
    source: SourceOptions = SourceOptions(),  # noqa: B008 - frozen
    force: Annotated[bool, Parameter(group=COMMON)] = False,
    quiet: Annotated[bool, Parameter(group=COMMON)] = False,
    debug: Annotated[bool, Parameter(group=COMMON)] = False,  # noqa: ARG001 - seen by run()
) -> int:
    """Show an asset with its ambient occlusion on, off and alone, in one page.

    The page is a single HTML file with the asset and the viewer in it. It opens
    in any browser, also from a disk without a network, and may be sent around.

    Parameters
    ----------
    input:
        The asset to show, best one that was baked.
    output:
        The page to write: NAME.html.
    show:
        Open the page in the browser when it is written.
    force:
        Replace an output file that exists.
    quiet:
        Say nothing but errors.
    debug:
        Show where in the program an error arose.
    """
    check_asset_target(output, ENDINGS, "a page", force=force, inputs=[input])

    from aobake import load
    from aobake.files import write_files
    from aobake.viewer import packed_glb, page_of

    with leaving_promptly():
        scene = load(input, root=source.root, scene=source.scene, pose=source.pose)
        packed = packed_glb(scene, source.pose)
        facts = f"{scene.triangles:,} triangles", _size(len(packed.glb))
        page = page_of(packed.glb, input.name, facts)
    write_files({output: page})
    if not quiet:
        terminal.say(f"{output}: {facts[0]}, {_size(len(page))}")
        terminal.warn(packed.warnings, "")
    if show:
        import webbrowser

        webbrowser.open(output.resolve().as_uri())
    return 0


def _size(count: int) -> str:
    """A number of bytes as people read it."""
    return f"{count / 1e6:.1f} MB" if count >= 100_000 else f"{count / 1e3:.1f} kB"

"""`aobake render`: preview with a local illumination model and the baked ambient occlusion."""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from aobake.cli import terminal
from aobake.cli.app import Group, Parameter
from aobake.cli.leaving import leaving_promptly
from aobake.cli.options import (
    CommonOptions,
    ConfigOptions,
    Output,
    RenderFlags,
    SourceOptions,
    TraceFlags,
)
from aobake.cli.output import check_target
from aobake.config import rendering
from aobake.errors import InputError, SettingsError, nearest
from aobake.flags import in_flags
from aobake.render_settings import RenderSettings
from aobake.settings import Encoding

if TYPE_CHECKING:
    from aobake import BakeSettings, Scene
    from aobake.previews import Comparison
    from aobake.shading.preview import Preview

__all__ = ["render"]

WRITING = Group("Writing", sort_key=1)


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Wanted:
    """What is to be drawn: one picture, or a comparison.

    settings_files : the aobake.toml files that some of it came from
    """

    picture: RenderSettings
    bake: BakeSettings
    compare: str | None
    encoding: Encoding | None
    settings_files: tuple[Path, ...]


def render(  # noqa: PLR0913 - one for each group of flags
    input: Path,
    /,
    *,
    output: Output,
    encoding: Annotated[Encoding | None, Parameter(group=WRITING)] = None,
    compare: Annotated[str | None, Parameter(group=WRITING)] = None,
    picture: RenderFlags = None,
    trace: TraceFlags = None,
    config: ConfigOptions = ConfigOptions(),  # noqa: B008 - frozen
    source: SourceOptions = SourceOptions(),  # noqa: B008 - frozen
    common: CommonOptions = CommonOptions(),  # noqa: B008 - frozen
) -> int:
    """Preview with a local illumination model and the baked ambient occlusion.

    Ambient occlusion darkens the ambient term alone. Where the asset holds
    none, it is baked at the vertices, for the picture only; the options under
    Baking say how. Nothing is written but the picture.

    Parameters
    ----------
    input:
        The asset to show.
    output:
        The picture to write: PNG, EXR or TIFF, by its ending.
    encoding:
        Numbers in the picture: 8 or 16 bits in PNG, half or float in EXR, all in TIFF.
        [default: 8, half in EXR]
    compare:
        Pictures side by side on one sheet: ao (a constant ambient term beside ambient occlusion), models
        (every local model), or rays=16,64,256 (bakes with so many rays).
    """
    chosen = config.configured(input, trace)
    wanted = _Wanted(
        picture=rendering(None if config.no_config else input, picture),
        bake=chosen.bake,
        compare=compare,
        encoding=encoding,
        settings_files=chosen.files,
    )
    _check(wanted, output)
    check_target(output, force=common.force, inputs=[input])
    if common.report is not None:
        check_target(common.report, force=common.force)

    from aobake import load, report
    from aobake.files import write_files

    started = time.perf_counter()
    with leaving_promptly():
        scene = load(input, root=source.root, scene=source.scene, pose=source.pose)
        read = scene.source.files if scene.source and common.report else ()
        inputs = report.digests(read)
        seconds = {"read": time.perf_counter() - started}
        with terminal.progress_bar(quiet=common.quiet) as progress:
            try:
                drawn, content = _drawn(scene, wanted, output.suffix.lower(), progress)
            except InputError as error:
                raise InputError(_about(input, str(error))) from error
    started = time.perf_counter()
    write_files({output: content})
    seconds |= {**drawn.seconds, "write": time.perf_counter() - started}
    if common.report is not None:
        files = {"inputs": inputs, "outputs": report.digests([output])}
        write_files({common.report: _report(drawn, wanted, files, seconds)})
    if not common.quiet:
        height, width = drawn.pixels.shape[:2]
        terminal.say(f"{output}: {width} x {height} pixels in {sum(seconds.values()):.2f} s")
        terminal.say(*_occlusion(drawn, wanted))
        terminal.warn(drawn.warnings, "; --report FILE keeps them all")
    return 0


def _about(asset: Path, message: str) -> str:
    """The message in the words of the command line, with the file that it is about in front."""
    return message if str(asset) in message else f"{asset}: {in_flags(message, RenderSettings)}"


def _check(wanted: _Wanted, output: Path) -> None:
    """Raise SettingsError now for a picture that could not be drawn, or not be written."""
    from aobake.tracing.compiled import compile_alone

    compile_alone()  # before anything asks for kernels
    from aobake.images import ENCODINGS, KINDS
    from aobake.previews import check_comparison
    from aobake.shading.preview import check

    suffix = output.suffix.lower()
    if suffix not in KINDS:
        raise SettingsError(
            f"{output}: {suffix or 'a name without an ending'} is no format for a picture."
            f"{nearest(suffix, KINDS)}"
        )
    held = ENCODINGS[KINDS[suffix]]
    if wanted.encoding is not None and wanted.encoding not in held:
        raise SettingsError(
            f"{output}: {suffix[1:].upper()} cannot hold {wanted.encoding}; {' or '.join(held)} is needed."
        )
    try:
        if wanted.compare is None:
            check(wanted.picture)
        else:
            check_comparison(wanted.compare, wanted.picture, wanted.bake)
    except SettingsError as error:
        flag = "--" if str(error).startswith("compare ") else ""
        raise SettingsError(flag + in_flags(str(error), RenderSettings)) from error


def _drawn(
    scene: Scene, wanted: _Wanted, suffix: str, progress: terminal.Progress | None
) -> tuple[Preview | Comparison, bytes]:
    """The picture, and the image file that holds it."""
    from aobake import previews
    from aobake.shading.picture import encoded, encoded_sheet

    if wanted.compare is None:
        shown = previews.preview(scene, wanted.picture, wanted.bake, progress=progress)
        return shown, encoded(shown, suffix, wanted.encoding)
    sheet = previews.compare(scene, wanted.compare, wanted.picture, wanted.bake, progress=progress)
    return sheet, encoded_sheet(sheet.pixels, suffix, wanted.encoding)


def _occlusion(drawn: Preview | Comparison, wanted: _Wanted) -> Sequence[str]:
    """Where the ambient occlusion of a picture is from: what is baked and what is colour look alike."""
    shown = drawn.effects.get("ambient_occlusion")
    if (
        shown is None
        or isinstance(shown, Mapping)
        or wanted.picture.channel not in {"beauty", "ao"}
    ):
        return []
    return [f"ambient occlusion: {shown.reason}"]


def _report(
    drawn: Preview | Comparison,
    wanted: _Wanted,
    files: Mapping[str, Sequence[object]],
    seconds: Mapping[str, float],
) -> bytes:
    """What was done, as JSON."""
    from aobake import __version__

    settings = dataclasses.asdict(wanted.bake) | dataclasses.asdict(wanted.picture)
    data = {
        "version": __version__,
        "command": "render",
        **{kind: [vars(record) for record in records] for kind, records in files.items()},
        "settings": settings | {"compare": wanted.compare, "encoding": wanted.encoding},
        "settings_files": [str(file) for file in wanted.settings_files],
        "plan": {"effects": _plain(drawn.effects)},
        "seconds": {stage: round(spent, 6) for stage, spent in seconds.items()},
        "warnings": list(drawn.warnings),
    }
    return (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode(
        "utf-8", "backslashreplace"
    )


def _plain(effects: Mapping[str, object]) -> dict[str, object]:
    """Effects, or effects by label, as what JSON knows."""
    return {
        name: _plain(value) if isinstance(value, Mapping) else vars(value)
        for name, value in effects.items()
    }

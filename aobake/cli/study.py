"""`aobake study`: what accuracy costs in time, measured on an asset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from aobake import SettingsError
from aobake.cli import terminal
from aobake.cli.app import Parameter
from aobake.cli.leaving import leaving_promptly
from aobake.cli.options import COMMON, ConfigOptions, Output, SourceOptions, TraceFlags
from aobake.cli.output import check_target
from aobake.files import make_folder

if TYPE_CHECKING:
    from aobake import BakeSettings, Scene
    from aobake.study import Picture, Study

__all__ = ["study"]

SIZE, QUICK_SIZE = 512, 256  # of a texture, in pixels


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ExtentOptions:
    """How much is measured."""

    texture: bool = False
    """Measure a bake to a texture, with and without denoising, instead of one to vertices."""

    size: int | None = None
    """Width and height of that texture, in pixels. [default: 512, with --quick 256]"""

    quick: bool = False
    """Measure less: half a minute for an asset of 20,000 faces."""

    time_limit: float = 600.0
    """Seconds that it may take; if an estimate says more, it does not start. [default: 600]"""

    def __post_init__(self) -> None:
        if not self.time_limit > 0.0:
            raise SettingsError(f"--time-limit is {self.time_limit:g}; seconds above 0 are needed.")
        if self.size is not None and not self.texture:
            raise SettingsError("--size is that of a texture: give --texture as well.")

    @property
    def image(self) -> dict[str, object]:
        """The size of the texture, as a flag: that of an aobake.toml is for bakes."""
        usual = QUICK_SIZE if self.quick else SIZE
        return {"size": usual if self.size is None else self.size}


@Parameter(name="*", group=COMMON)
@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """What a study can be told as other commands are."""

    force: bool = False
    """Replace the files of an earlier study."""

    quiet: bool = False
    """Say nothing but errors."""

    debug: bool = False
    """Show where in the program an error arose."""


def study(
    input: Path,
    /,
    *,
    output: Output,
    extent: ExtentOptions = ExtentOptions(),
    trace: TraceFlags = None,
    config: ConfigOptions = ConfigOptions(),  # noqa: B008 - frozen
    source: SourceOptions = SourceOptions(),  # noqa: B008 - frozen
    common: StudyOptions = StudyOptions(),
) -> int:
    """Measure what accuracy costs in time on an asset.

    Compares fixed numbers of rays and tolerances with a converged reference,
    which is kept in the folder for the next run: at vertices, with sets of
    directions and methods, or (--texture) in a texture, with and without
    denoising. Writes index.html, a page that explains itself, study.json,
    study.csv and the plots as SVG and PNG.

    Parameters
    ----------
    input:
        The asset to measure.
    output:
        The folder to write into; it is made if needed.
    """
    chosen = config.configured(input, trace, extent.image).bake

    from aobake import load
    from aobake.study import check_plots, outputs, summary, write_study

    check_plots()
    with leaving_promptly():
        scene = load(input, root=source.root, scene=source.scene, pose=source.pose)
    made = make_folder(output)
    try:
        for target in outputs(output):
            check_target(target, force=common.force)
        with leaving_promptly(), terminal.progress_bar(quiet=common.quiet) as progress:
            measured, pictures = _measured(scene, chosen, extent, output, progress)
        write_study(output, measured, pictures)
    except BaseException:
        if made and not any(output.iterdir()):
            output.rmdir()
        raise
    if not common.quiet:
        terminal.say(*summary(measured))
    return 0


def _measured(
    scene: Scene,
    settings: BakeSettings,
    extent: ExtentOptions,
    folder: Path,
    progress: terminal.Progress | None,
) -> tuple[Study, Sequence[Sequence[Picture]]]:
    """The study that was asked for, and its pictures."""
    from aobake.study import (
        kept_reference,
        level_pictures,
        measure,
        measure_texture,
        study_extent,
        texture_extent,
    )

    limit, kept = extent.time_limit, kept_reference(folder)
    if extent.texture:
        much = texture_extent(quick=extent.quick)
        return measure_texture(
            scene, settings, much, time_limit=limit, kept=kept, progress=progress
        )
    measures = study_extent(quick=extent.quick)
    found = measure(scene, settings, measures, time_limit=limit, kept=kept, progress=progress)
    return found, level_pictures(scene, settings, measures)

"""`aobake study`: what accuracy costs in time, measured on an asset."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from aobake import SettingsError
from aobake.cli import terminal
from aobake.cli.app import Parameter
from aobake.cli.leaving import leaving_promptly
from aobake.cli.options import COMMON, ConfigOptions, Output, SourceOptions, TraceFlags
from aobake.cli.output import check_target, make_folder

__all__ = ["study"]

QUICK_PICTURES, PICTURES = (16, 64, 256), (4, 16, 64, 256, 1024)
QUICK_REFERENCE, REFERENCE = 1024, 8192


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ExtentOptions:
    """How much is measured."""

    quick: bool = False
    """Measure less: half a minute for an asset of 20,000 faces."""

    time_limit: float = 600.0
    """Seconds that it may take; if an estimate says more, it does not start. [default: 600]"""

    def __post_init__(self) -> None:
        if not self.time_limit > 0.0:
            raise SettingsError(f"--time-limit is {self.time_limit:g}; seconds above 0 are needed.")


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

    Compares fixed numbers of rays, tolerances, sets of directions and methods
    with a converged reference, which is kept in the folder for the next run.
    Writes index.html, a page that explains itself, study.json, study.csv and
    the plots as SVG and PNG.

    Parameters
    ----------
    input:
        The asset to measure.
    output:
        The folder to write into; it is made if needed.
    """
    chosen = config.configured(input, trace).bake

    from aobake import load
    from aobake.study import (
        check_plots,
        kept_reference,
        level_pictures,
        measure,
        outputs,
        study_extent,
        summary,
        write_study,
    )

    check_plots()
    with leaving_promptly():
        scene = load(input, root=source.root, scene=source.scene, pose=source.pose)
    made = make_folder(output)
    try:
        for target in outputs(output):
            check_target(target, force=common.force)
        measures = study_extent(quick=extent.quick)
        with leaving_promptly(), terminal.progress_bar(quiet=common.quiet) as progress:
            measured = measure(
                scene,
                chosen,
                measures,
                time_limit=extent.time_limit,
                kept=kept_reference(output, scene, chosen, measures),
                progress=progress,
            )
            pictures = level_pictures(
                scene,
                chosen,
                QUICK_PICTURES if extent.quick else PICTURES,
                QUICK_REFERENCE if extent.quick else REFERENCE,
                "320x240" if extent.quick else "480x360",
            )
        write_study(output, measured, pictures)
    except BaseException:
        if made and not any(output.iterdir()):
            output.rmdir()
        raise
    if not common.quiet:
        terminal.say(*summary(measured))
    return 0

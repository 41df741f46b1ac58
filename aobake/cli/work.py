"""One job as people run it: a progress bar, Ctrl-C that is obeyed, the report that was asked for, two lines."""

from __future__ import annotations

from pathlib import Path

from aobake import Scene, jobs, report
from aobake.ahead import compile_ahead
from aobake.cli import terminal
from aobake.cli.leaving import leaving_promptly
from aobake.cli.options import CommonOptions, SourceOptions
from aobake.config import Command, Configured
from aobake.tracing.compiled import compile_alone

__all__ = ["bake_file", "bake_in_memory"]


def bake_file(
    command: Command,
    input: Path,
    output: Path,
    *,
    chosen: Configured,
    source: SourceOptions,
    common: CommonOptions,
) -> None:
    """Bake a file, write the report that was asked for, and say what was done unless told to be quiet."""
    reading = jobs.Reading(scene=source.scene, pose=source.pose, root=source.root)
    job = jobs.Job(
        command=command,
        input=input,
        output=output,
        chosen=chosen,
        reading=reading,
        force=common.force,
    )
    _do(job, common)


def _do(job: jobs.Job, common: CommonOptions) -> None:
    compile_alone()
    compile_ahead(job.command)
    with terminal.progress_bar(quiet=common.quiet) as progress:
        done = jobs.run_job(
            job, digests=common.report is not None, progress=progress, guard=leaving_promptly
        )
    _tell(job, done.report, common)


def bake_in_memory(scene: Scene, job: jobs.Job, common: CommonOptions) -> None:
    """The same for a scene that is in no file."""
    compile_alone()
    compile_ahead(job.command)
    with terminal.progress_bar(quiet=common.quiet) as progress:
        done = jobs.bake_scene(
            scene,
            job,
            (),
            {},
            digests=common.report is not None,
            progress=progress,
            guard=leaving_promptly,
        )
    _tell(job, done.report, common)


def _tell(job: jobs.Job, done: report.Report, common: CommonOptions) -> None:
    if common.report is not None:
        done.write(common.report)
    if not common.quiet:
        terminal.say(*_summary(job.output, done))
        terminal.warn(done.warnings, "; --report FILE keeps them all")


def _summary(output: Path, done: report.Report) -> tuple[str, ...]:
    error = "" if done.error.rms is None else f", standard error {done.error.rms:.4f}"
    mean = "" if done.ao_mean is None else f", mean {done.ao_mean:.2f}"
    rate = "" if done.mrays_per_s is None else f" ({done.mrays_per_s:.1f} Mrays/s)"
    traced_s, total_s = done.seconds.get("trace", 0.0), sum(done.seconds.values())
    instances = "1 mesh" if done.instances == 1 else f"{done.instances:,} meshes"
    what = "texels" if done.layout else "vertices"
    return (
        f"{output}: {done.points:,} {what} of {instances}{mean}{error}",
        *done.layout,
        f"{done.rays / 1e6:.1f} million rays in {traced_s:.2f} s{rate}, {total_s:.2f} s in all",
    )

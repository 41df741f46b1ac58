"""One bake, from a scene in memory to files and two lines for people: what every baking command does."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from aobake import Scene, bake_vertices, report, save
from aobake.cli import terminal
from aobake.cli.config import Configured
from aobake.cli.leaving import leaving_promptly
from aobake.cli.options import CommonOptions
from aobake.tracing.compiled import import_without_blas

__all__ = ["Work", "bake_vertices_to"]


@dataclass(frozen=True, kw_only=True)
class Work:
    """What is to be done: command names it; inputs and seconds are what was read, and how long it took;
    warnings are what there is to say before anything was baked."""

    command: str
    output: Path
    chosen: Configured
    common: CommonOptions
    inputs: Sequence[Path] = ()
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: Sequence[str] = ()


def bake_vertices_to(scene: Scene, work: Work) -> report.Report:
    """Bake a scene, write it and the report that was asked for, and say so unless told to be quiet."""
    wanted = work.common.report is not None
    inputs = report.digests(work.inputs if wanted else ())  # now: the output may replace an input
    import_without_blas()
    with leaving_promptly(), terminal.progress_bar(quiet=work.common.quiet) as progress:
        baked = bake_vertices(scene, work.chosen.bake, progress=progress)
    started = time.perf_counter()
    written = save(baked, work.output, store=work.chosen.store, force=work.common.force)
    work.seconds["write"] = time.perf_counter() - started
    done = report.of_vertices(
        baked,
        command=work.command,
        inputs=inputs,
        outputs=report.digests(written if wanted else ()),
        store=work.chosen.store,
        settings_file=work.chosen.file,
        seconds=work.seconds,
        warnings=work.warnings,
    )
    if work.common.report is not None:
        done.write(work.common.report)
    if not work.common.quiet:
        terminal.say(*_summary(work.output, done))
        terminal.warn(done.warnings, "; --report FILE keeps them all")
    return done


def _summary(output: Path, done: report.Report) -> tuple[str, str]:
    error = "" if done.error.rms is None else f", standard error {done.error.rms:.4f}"
    mean = "" if done.ao_mean is None else f", mean {done.ao_mean:.2f}"
    rate = "" if done.mrays_per_s is None else f" ({done.mrays_per_s:.1f} Mrays/s)"
    traced_s, total_s = done.seconds.get("trace", 0.0), sum(done.seconds.values())
    instances = "1 mesh" if done.instances == 1 else f"{done.instances:,} meshes"
    return (
        f"{output}: {done.points:,} vertices of {instances}{mean}{error}",
        f"{done.rays / 1e6:.1f} million rays in {traced_s:.2f} s{rate}, {total_s:.2f} s in all",
    )

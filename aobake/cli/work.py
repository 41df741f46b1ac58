"""One bake, from a scene in memory to files and two lines for people: what every baking command does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from aobake import (
    BakedTexture,
    BakedVertices,
    BakeSettings,
    ImageSettings,
    Scene,
    StoreSettings,
    bake_vertices,
    load,
    report,
    save,
)
from aobake.cli import terminal
from aobake.cli.config import Configured
from aobake.cli.leaving import leaving_promptly
from aobake.cli.options import CommonOptions, SourceOptions
from aobake.meshes import formats
from aobake.stages import timed
from aobake.tracing.compiled import import_without_blas

__all__ = ["Work", "bake_texture_to", "bake_vertices_to", "opened"]


class Bake(Protocol):
    """bake_vertices or bake_texture."""

    def __call__(
        self, scene: Scene, settings: BakeSettings, *, progress: terminal.Progress | None
    ) -> BakedVertices | BakedTexture: ...


@dataclass(frozen=True, kw_only=True)
class Work:
    """What is to be done: command names it; inputs and seconds are what was read, and how long that took."""

    command: str
    output: Path
    chosen: Configured
    common: CommonOptions
    inputs: list[Path] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)


def opened(input: Path, source: SourceOptions, work: Work) -> Scene:
    """The scene in a file, which is noted as the work's input."""
    with timed(work.seconds, "read"), leaving_promptly():
        scene = load(input, root=source.root, scene=source.scene, pose=source.pose)
    work.inputs.extend(scene.source.files if scene.source else ())
    return scene


def bake_vertices_to(scene: Scene, work: Work) -> report.Report:
    """Bake a scene's vertices, write it and the report that was asked for, and say so unless told to be quiet."""
    store, bent = work.chosen.store, work.chosen.bake.bent_normals
    notes = formats.check_target(scene, work.output, store, bent_normals=bent)
    return _bake_to(scene, work, bake_vertices, store, lambda _: notes)


def bake_texture_to(scene: Scene, work: Work) -> report.Report:
    """Bake a scene to a texture, write it and the report, and say so unless told to be quiet."""
    from aobake import bake_texture  # brings the atlas with it, which vertices need not wait for

    image = work.chosen.image

    def notes(baked: BakedVertices | BakedTexture | None) -> Sequence[str]:
        layout = baked.lightmap if isinstance(baked, BakedTexture) else None
        return formats.check_texture_target(scene, work.output, image, layout)

    notes(
        None
    )  # what will be refused is refused before the bake; the rest is known once there is a layout
    return _bake_to(scene, work, bake_texture, image, notes)


def _bake_to(
    scene: Scene,
    work: Work,
    bake: Bake,
    kept: StoreSettings | ImageSettings,
    notes: Callable[[BakedVertices | BakedTexture], Sequence[str]],
) -> report.Report:
    wanted = work.common.report is not None
    inputs = report.digests(work.inputs if wanted else ())  # now: the output may replace an input
    import_without_blas()
    with leaving_promptly(), terminal.progress_bar(quiet=work.common.quiet) as progress:
        baked = bake(scene, work.chosen.bake, progress=progress)
    chosen, said = work.chosen, notes(baked)
    with timed(work.seconds, "write"):
        written = save(
            baked, work.output, store=chosen.store, image=chosen.image, force=work.common.force
        )
    done = report.of_bake(
        baked,
        command=work.command,
        inputs=inputs,
        outputs=report.digests(written if wanted else ()),
        store=kept,
        settings_file=chosen.file,
        seconds=work.seconds,
        warnings=said,
    )
    if work.common.report is not None:
        done.write(work.common.report)
    if not work.common.quiet:
        terminal.say(*_summary(work.output, done))
        terminal.warn(done.warnings, "; --report FILE keeps them all")
    return done


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

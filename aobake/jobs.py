"""One job: an asset read, baked, and written, with a report of it. What every baking command and every worker does."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

from aobake import report
from aobake.config import Command, Configured
from aobake.stages import timed

if TYPE_CHECKING:
    from aobake.meshes.scene import Scene
    from aobake.results import BakedTexture, BakedVertices
    from aobake.settings import BakeSettings

__all__ = ["Command", "Done", "Job", "Reading", "bake_scene", "opened", "run_job"]

Progress = Callable[[str, int, int], None]
Notes = Callable[["BakedVertices | BakedTexture"], Sequence[str]]
Guard = Callable[[], AbstractContextManager[None]]


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How a file is read: the glTF scene to take, the moment of an animation, and the folder of side files."""

    scene: str | None = None
    pose: str | None = None
    root: Path | None = None


@dataclass(frozen=True, kw_only=True)
class Job:
    """An asset to bake.

    command : what is baked
    input, output : the asset, and the file to write, whose ending chooses the format
    chosen : the settings that apply to it
    name : the command to report, where another one than `command` does this
    force : whether files that exist are replaced
    """

    command: Command
    input: Path
    output: Path
    chosen: Configured
    reading: Reading = field(default_factory=Reading)
    name: str = ""
    force: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Done:
    """A job that was done: the result in memory, and what is said of it."""

    baked: BakedVertices | BakedTexture
    report: report.Report


class Bake(Protocol):
    """bake_vertices or bake_texture."""

    def __call__(
        self, scene: Scene, settings: BakeSettings, *, progress: Progress | None
    ) -> BakedVertices | BakedTexture: ...


def run_job(
    job: Job,
    *,
    digests: bool = True,
    progress: Progress | None = None,
    guard: Guard = nullcontext,
    instead: Bake | None = None,
) -> Done:
    """Read, bake and write one asset.

    digests : whether the report tells the digests of all files that were read and written
    progress : called in the calling thread with (stage, done, total); what it raises stops the work
    guard : entered around all that may be broken off at any moment, which writing may not
    instead : what bakes in place of bake_vertices or bake_texture
    Raises what load, the bake and save do: nothing is half-written then.
    """
    seconds: dict[str, float] = {}
    with guard():
        scene = opened(job, seconds)
    inputs = scene.source.files if scene.source else ()
    return bake_scene(
        scene,
        job,
        inputs,
        seconds,
        digests=digests,
        progress=progress,
        guard=guard,
        instead=instead,
    )


def opened(job: Job, seconds: dict[str, float]) -> Scene:
    """The scene of a job; the time it takes is added to the stage "read". Raises what load does."""
    from aobake.meshes.formats import load

    reading = job.reading
    with timed(seconds, "read"):
        return load(job.input, root=reading.root, scene=reading.scene, pose=reading.pose)


def bake_scene(
    scene: Scene,
    job: Job,
    inputs: Sequence[Path],
    seconds: dict[str, float],
    *,
    digests: bool = True,
    progress: Progress | None = None,
    guard: Guard = nullcontext,
    instead: Bake | None = None,
) -> Done:
    """Bake a scene that is in memory already, and write it, as run_job does.

    inputs : the files that it was read from; seconds : the stages so far, added to
    """
    from aobake.results import save

    bake, notes = _vertices(scene, job) if job.command == "vertex" else _texture(scene, job)
    read = report.digests(inputs if digests else ())  # now: the output may replace an input
    with guard():
        baked = (instead or bake)(scene, job.chosen.bake, progress=progress)
    chosen, said = job.chosen, notes(baked)
    with timed(seconds, "write"):
        written = save(baked, job.output, store=chosen.store, image=chosen.image, force=job.force)
    done = report.of_bake(
        baked,
        command=job.name or job.command,
        inputs=read,
        outputs=report.digests(written if digests else ()),
        store=chosen.store if job.command == "vertex" else chosen.image,
        settings_files=chosen.files,
        reading=dataclasses.asdict(job.reading),
        seconds=seconds,
        warnings=said,
    )
    return Done(baked=baked, report=done)


def _vertices(scene: Scene, job: Job) -> tuple[Bake, Notes]:
    """How vertices are baked, and what is to be said of them. Raises OutputError for what save would refuse."""
    from aobake.bake import bake_vertices
    from aobake.meshes import formats

    chosen = job.chosen
    said = formats.check_target(scene, job.output, chosen.store, chosen.bake.further)
    return bake_vertices, lambda _: said


def _texture(scene: Scene, job: Job) -> tuple[Bake, Notes]:
    """The same of a texture; what is to be said of it is known in full once there is a layout."""
    from aobake.lightmaps import bake_texture
    from aobake.meshes import formats

    def notes(baked: BakedVertices | BakedTexture | None) -> Sequence[str]:
        layout = None if baked is None else cast("BakedTexture", baked).lightmap
        return formats.check_texture_target(scene, job.output, job.chosen.image, layout)

    notes(None)  # what will be refused is refused before the bake
    return bake_texture, notes

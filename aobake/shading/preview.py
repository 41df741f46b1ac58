"""A picture of a scene with one local illumination model and its baked ambient occlusion.

    I = ka Ia A + sum over lights of (kd Rd + ks Rs) (N.L) I_L

A, the baked ambient occlusion, attenuates the ambient term and nothing else. Blocks of pixel rows are
independent of each other: the same bytes for any number of threads.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError, SettingsError
from aobake.meshes.scene import Scene
from aobake.render_settings import RenderSettings, numbers_of, size_of
from aobake.settings import TraceSettings
from aobake.shading.camera import View, axes_from, extent, framing, of_file, sample_places
from aobake.shading.effects import Shown, effects_of
from aobake.shading.ground import ground_of
from aobake.shading.lights import Lamp, balanced, key_light, lamps_of
from aobake.shading.lobes import lobes_of
from aobake.shading.materials import Baked, Look, look_of
from aobake.shading.shot import Shot, shoot
from aobake.shading.stage import Stage, some_points, stage_of
from aobake.shading.surroundings import is_inside
from aobake.stages import timed
from aobake.tracing.conditioning import unit_frame
from aobake.tracing.estimate import processors

__all__ = ["Preview", "check", "render"]

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Progress = Callable[[str, int, int], None]

DEFAULT_VIEW = (30.0, 20.0)
SAMPLES_AT_ONCE = 1 << 16  # arrays of this length stay in the cache of a core
MOST_PIXELS = 1 << 26  # 8192 x 8192; 3 GB with the copies that writing needs
BALANCE_POINTS = 4096


@dataclass(frozen=True, eq=False, kw_only=True)
class Preview:
    """A picture.

    pixels : (H, W, 4) float32, row 0 at the top, linear, without background: red, green and blue are
        multiplied by alpha. For channels other than beauty and albedo they are numbers and no light
    effects : name -> whether it was simulated, and why
    seconds : stage -> seconds
    warnings : what is not shown as it should be, one line each
    """

    pixels: Float32Array
    settings: RenderSettings
    effects: Mapping[str, Shown]
    seconds: Mapping[str, float]
    warnings: tuple[str, ...]


def check(settings: RenderSettings) -> None:
    """Raise SettingsError now for what render would refuse whatever the scene, before any work."""
    lobes_of(settings)
    width, height = size_of(settings)
    if width * height > MOST_PIXELS:
        raise SettingsError(
            f"size is {settings.size!r}, {width * height / 1e6:,.0f} million pixels; "
            f"at most {MOST_PIXELS / 1e6:.0f} million fit into memory with what goes with them."
        )


def render(
    scene: Scene,
    settings: RenderSettings | None = None,
    baked: Baked | None = None,
    *,
    trace: TraceSettings | None = None,
    progress: Progress | None = None,
) -> Preview:
    """A picture of a scene.

    baked : ambient occlusion that is not in the asset; None: what the asset holds
    trace : where the ground is, and how many threads there may be; the rest concerns bakes
    progress : called in the calling thread with ("render", rows done, rows in all); what it raises stops
        the work
    Raises SettingsError for settings that do not go together, InputError for a scene without faces and
    for a channel that the asset has nothing for, EngineError where Embree cannot be used.
    """
    settings, trace = settings or RenderSettings(), trace or TraceSettings()
    check(settings)
    seconds: dict[str, float] = {}
    with timed(seconds, "prepare"):
        shot = _shot_of(scene, settings, baked, trace)
    threads = trace.threads or processors()
    if trace.ground is not None and settings.channel == "beauty":
        with timed(seconds, "ground"):
            tree, frame = shot.stage.tree, shot.stage.frame
            under = ground_of(extent(scene), trace.ground, tree, frame, threads)
            shot = replace(shot, ground=under)
    with timed(seconds, "render"):
        pixels = _pixels(shot, threads, progress)
    warnings = [*scene.warnings, *shot.look.warnings, *shot.look.textures.warnings]
    if is_inside(shot.stage, shot.view):
        warnings.append("the camera is inside of a closed surface, and sees it from within.")
    return Preview(
        pixels=pixels,
        settings=settings,
        effects=effects_of(shot),
        seconds=seconds,
        warnings=tuple(dict.fromkeys(warnings)),
    )


def _shot_of(
    scene: Scene, settings: RenderSettings, baked: Baked | None, trace: TraceSettings
) -> Shot:
    """Everything that the picture is made from, without its ground."""
    clouds = extent(scene)
    if scene.triangles == 0 or not clouds:
        raise InputError("there is no triangle in the scene, so there is nothing to show.")
    look = look_of(scene, baked, max(size_of(settings)))
    _refuse_empty_channel(look, settings)
    view = _view_of(scene, clouds, settings, trace)
    stage = stage_of(scene, unit_frame(clouds))
    return Shot(
        stage=stage,
        look=look,
        lobes=lobes_of(settings),
        lamps=_lamps(scene, stage, view, settings),
        view=view,
        ground=None,
        size=size_of(settings),
        places=sample_places(settings.samples),
        settings=settings,
    )


def _refuse_empty_channel(look: Look, settings: RenderSettings) -> None:
    if settings.channel == "error" and (look.baked is None or look.baked.standard_error is None):
        raise InputError(
            "channel is 'error', but files do not hold the error of a bake. "
            "Leave ao at auto to bake for the picture."
        )
    if settings.channel == "bent-normal" and not look.has_bent_normals:
        raise InputError(
            "channel is 'bent-normal', but the asset has no attribute _BENT_NORMAL. "
            "Bake it with bent normals first."
        )
    if settings.channel == "ao" and all(source == "none" for source in look.occlusion):
        raise InputError(
            "channel is 'ao', but the asset holds no ambient occlusion. "
            "Leave ao at auto to bake for the picture."
        )


def _view_of(
    scene: Scene, clouds: Sequence[FloatArray], settings: RenderSettings, trace: TraceSettings
) -> View:
    if settings.view is None and settings.camera != "frame":
        if settings.camera != "auto":
            return of_file(scene, settings.camera)
        if scene.cameras:
            return of_file(scene, None)
    azimuth, elevation = DEFAULT_VIEW
    if settings.view is not None:
        azimuth, elevation = numbers_of("view", settings.view)
    width, height = size_of(settings)
    axes = axes_from(azimuth, elevation, settings.up or trace.ground or "+y")
    return framing(clouds, axes, math.tan(math.radians(settings.fov) / 2.0), width / height)


def _lamps(scene: Scene, stage: Stage, view: View, settings: RenderSettings) -> tuple[Lamp, ...]:
    """The lights of the picture; those of a file brought to the brightness of the key light."""
    if settings.channel != "beauty" or settings.lights == "none" or settings.key == 0.0:
        return ()
    found = () if settings.lights == "key" else lamps_of(scene.lights)
    if not found:
        return () if settings.lights == "file" else (key_light(view.axes, settings.key),)
    points, normals = some_points(stage, BALANCE_POINTS)
    share = balanced(found, points, normals, stage.frame, settings.key)
    return tuple(replace(lamp, color=lamp.color * share) for lamp in found)


def _pixels(shot: Shot, threads: int, progress: Progress | None) -> Float32Array:
    """(H, W, 4), block by block of rows over threads."""
    width, height = shot.size
    pixels = np.empty((height, width, 4), np.float32)
    step = max(1, SAMPLES_AT_ONCE // (width * len(shot.places)))
    blocks = [range(first, min(first + step, height)) for first in range(0, height, step)]
    stop = threading.Event()

    def work(rows: range) -> int:
        if not stop.is_set():
            pixels[rows.start : rows.stop] = shoot(shot, rows)
        return len(rows)

    done = work(blocks[0])  # compiles in this thread, where it can be interrupted
    with ThreadPoolExecutor(threads, "aobake") as pool:
        try:
            for count in pool.map(work, blocks[1:]):
                done += count
                if progress is not None:
                    progress("render", done, height)
        finally:
            stop.set()
    return pixels

"""A bake to textures: scene and settings in, images with their error out. Touches no file.

It is three steps, which may be taken in different processes: everything is decided (prepare_texture), bands of
texels are traced (trace_bands), and pages are put together from them (put_together).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from aobake.atlas.denoise import check_denoiser
from aobake.atlas.layout import Layout, lay_out
from aobake.atlas.material_texels import MaterialTexels
from aobake.lightmaps.bands import TextureBake, bands_of
from aobake.lightmaps.pages import put_together
from aobake.lightmaps.texels import trace_bands
from aobake.meshes.scene import Scene
from aobake.meshes.surfaces import surfaces_of
from aobake.occlusion import compile_for
from aobake.open_sky import sky_over
from aobake.plan import texture_plan
from aobake.planning.denoising import denoised_where_it_pays
from aobake.points import points_on_faces, vertex_points
from aobake.prepare import Prepared, build, in_scene_units, lowest, refuse
from aobake.results import BakedTexture
from aobake.settings import BakeSettings
from aobake.stages import timed

__all__ = ["bake_texture", "prepare_texture"]

Progress = Callable[[str, int, int], None]


def bake_texture(
    scene: Scene, settings: BakeSettings | None = None, *, progress: Progress | None = None
) -> BakedTexture:
    """Ambient occlusion at the texels of lightmaps; all instances of the scene occlude each other.

    progress : called in the calling thread with (stage, done, total) for the stages "unwrap", "compile" and
        "trace"; whatever it raises stops the bake, as does a KeyboardInterrupt
    Texture coordinates that do not overlap are kept, the others made anew (settings.uv). A scene without
    a triangle that has an area gives no images.
    Raises SettingsError where settings do not fit the scene, or a texture;
    InputError where asked-for texture coordinates are missing or overlap, where an image is too
    small for its charts, and where settings.strict is on and anything was passed over, mended or is in
    doubt; EngineError where Embree, or a denoiser that was asked for, cannot be used.
    """
    bake = prepare_texture(scene, settings, progress=progress)
    return put_together(bake, trace_bands(bake, bands_of(bake), progress))


def prepare_texture(
    scene: Scene,
    settings: BakeSettings | None = None,
    *,
    layout: Layout | None = None,
    progress: Progress | None = None,
) -> TextureBake:
    """Decide everything that a texture bake needs before its first ray: plan, surfaces, layout, world.

    layout : that of the same scene and settings, from another process; None: it is made here
    progress : as for bake_texture, which names what is raised, too
    """
    settings = in_scene_units(scene, settings or BakeSettings())
    seconds: dict[str, float] = {}
    with timed(seconds, "prepare"):
        plan = texture_plan(scene, settings)
        surfaces = surfaces_of(scene, settings)
        found = tuple(finding for surface in surfaces for finding in surface.findings)
        if settings.strict:
            refuse(scene, found)
    with timed(seconds, "build"):
        prepared = build(scene, surfaces, settings)
    with timed(seconds, "unwrap"):
        if layout is None:
            unwrapping = None if progress is None else partial(progress, "unwrap")
            layout = lay_out(scene, prepared, settings, settings.threads, unwrapping)
    plan = denoised_where_it_pays(plan, layout, settings)
    if plan.effects["denoise"].on:
        check_denoiser()
    ground = lowest(scene, prepared, settings)
    with timed(seconds, "build"):
        samples = len(layout.pages) * (settings.size * settings.supersample) ** 2
        sky = sky_over(prepared, vertex_points(scene, prepared), samples, ground, settings)
    with timed(seconds, "compile"):
        if progress is not None:
            progress("compile", 0, 1)
        _compile(scene, prepared, ground, settings)
    return TextureBake(
        scene=scene,
        settings=settings,
        plan=plan,
        prepared=prepared,
        layout=layout,
        materials=MaterialTexels(scene),
        ground=ground,
        sky=sky,
        findings=found,
        seconds=seconds,
    )


def _compile(
    scene: Scene, prepared: Prepared, ground: float | None, settings: BakeSettings
) -> None:
    nothing = np.zeros(0, np.int32)
    points = points_on_faces(
        scene, prepared, nothing, nothing, np.zeros((0, 2)), np.zeros(0, np.int64)
    )
    compile_for(prepared, points, ground, settings)

"""A bake to textures: scene and settings in, images with their error out. Touches no file.

The order is fixed: texels are found on the charts and traced; each chart is denoised by itself; what an
occlusion texture held already is multiplied in; seams are equalised; gutters are filled.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from aobake.atlas.denoise import check_denoiser
from aobake.atlas.layout import Page, lay_out
from aobake.atlas.material_texels import MaterialTexels
from aobake.atlas.post import finished
from aobake.atlas.seams import Seams, find_seams, joined_seams
from aobake.errors import SettingsError
from aobake.meshes.lightmap import Lightmap
from aobake.meshes.scene import Scene
from aobake.meshes.surfaces import surfaces_of
from aobake.occlusion import compile_for
from aobake.open_sky import sky_over
from aobake.plan import texture_plan
from aobake.points import points_on_faces, vertex_points
from aobake.prepare import build, in_scene_units, lowest, placed_nowhere, refuse
from aobake.results import BakedTexture
from aobake.settings import BakeSettings
from aobake.stages import timed
from aobake.texels import TexelJob, trace_page

__all__ = ["bake_texture"]

Progress = Callable[[str, int, int], None]
PARTS = 1000  # of a page, for the progress


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
    settings = in_scene_units(scene, settings or BakeSettings())
    if settings.bent_normals:
        raise SettingsError(
            "bent_normals are kept at vertices alone; bake those, or leave them out."
        )
    seconds: dict[str, float] = {}
    with timed(seconds, "prepare"):
        decided = texture_plan(scene, settings)
        if decided.effects["denoise"].on:
            check_denoiser()
        surfaces = surfaces_of(scene, settings)
        if settings.strict:
            refuse(scene, [finding for surface in surfaces for finding in surface.findings])
    with timed(seconds, "build"):
        prepared = build(scene, surfaces, settings)
    with timed(seconds, "unwrap"):
        unwrapping = None if progress is None else partial(progress, "unwrap")
        layout = lay_out(scene, prepared, settings, settings.threads, unwrapping)
    ground = lowest(scene, prepared, settings)
    with timed(seconds, "build"):
        samples = len(layout.pages) * (settings.size * settings.supersample) ** 2
        sky = sky_over(prepared, vertex_points(scene, prepared), samples, ground, settings)
    job = TexelJob(
        scene=scene,
        prepared=prepared,
        settings=settings,
        materials=MaterialTexels(scene),
        ground=ground,
        sky=sky,
        guides=decided.effects["denoise"].on,
        seconds=seconds,
    )
    with timed(seconds, "compile"):
        _compile(job, progress)
    images, coverages, errors = [], [], []
    for number, page in enumerate(layout.pages):
        traced = trace_page(job, page, number, _share(progress, number, len(layout.pages)))
        with timed(seconds, "finish"):
            seams = _seams(job, page)
        images.append(
            finished(traced, seams, denoise=job.guides, threads=settings.threads, seconds=seconds)
        )
        coverages.append(traced.chart >= 0)
        errors.append(traced.error)
    found = (*(finding for surface in surfaces for finding in surface.findings), *job.findings())
    if settings.strict:
        refuse(scene, found)
    return BakedTexture(
        scene=scene,
        settings=settings,
        plan=decided.with_open_sky(sum(job.under_open_sky), sum(job.samples)),
        lightmap=Lightmap(pages=tuple(images), placings=layout.placings),
        coverages=tuple(coverages),
        standard_errors=tuple(errors),
        layout=tuple(page.origin for page in layout.pages),
        rays=sum(job.rays),
        seconds=seconds,
        findings=found,
        warnings=(
            *scene.warnings,
            *placed_nowhere(scene),
            *prepared.warnings,
            *map(str, found),
            *job.materials.warnings,
        ),
    )


def _compile(job: TexelJob, progress: Progress | None) -> None:
    if progress is not None:
        progress("compile", 0, 1)
    nothing = np.zeros(0, np.int32)
    points = points_on_faces(
        job.scene, job.prepared, nothing, nothing, np.zeros((0, 2)), np.zeros(0, np.int64)
    )
    compile_for(job.prepared, points, job.ground, job.settings)


def _share(progress: Progress | None, number: int, pages: int) -> Callable[[float], None] | None:
    """What one page reports its share to."""
    if progress is None:
        return None
    return lambda done: progress("trace", int((number + done) * PARTS), pages * PARTS)


def _seams(job: TexelJob, page: Page) -> Seams:
    """The seams of all instances on a page; those between instances are none."""
    several = []
    for number, corners, charts in zip(page.instances, page.corners, page.charts, strict=True):
        stands = job.prepared.placed[number]
        if stands is not None:
            mesh, chosen = job.scene.meshes[stands[0].mesh], charts >= 0
            faces = mesh.faces[chosen]
            several.append(
                find_seams(mesh.vertices, faces, corners[chosen], stands[1].normals[faces])
            )
    return joined_seams(several)

"""Previews: pictures of a scene, baked for the picture where the asset holds no ambient occlusion, and sheets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aobake.bake import bake_vertices
from aobake.errors import InputError, SettingsError
from aobake.meshes.scene import Mesh, Scene
from aobake.render_settings import RenderSettings
from aobake.settings import BakeSettings
from aobake.shading.effects import Shown
from aobake.shading.materials import Baked, occlusion_source
from aobake.shading.models import MODELS
from aobake.shading.picture import displayed
from aobake.shading.preview import Preview, check, render
from aobake.shading.sheet import check_room, sheet

__all__ = ["Comparison", "check_comparison", "compare", "preview"]

Progress = Callable[[str, int, int], None]
Variant = tuple[str, RenderSettings, BakeSettings]

MOST_RAY_COUNTS = 12


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """Labelled pictures side by side.

    pixels : (H, W, 3) float32 in [0, 1] as a display takes them; (H, W, 4) on a transparent background
    effects, seconds, warnings : of all the pictures; effects by label
    """

    pixels: NDArray[np.float32]
    effects: Mapping[str, Mapping[str, Shown]]
    seconds: Mapping[str, float]
    warnings: tuple[str, ...]


def preview(
    scene: Scene,
    settings: RenderSettings | None = None,
    bake: BakeSettings | None = None,
    *,
    progress: Progress | None = None,
) -> Preview:
    """A picture of a scene with its ambient occlusion, baked now where settings.ao says so.

    bake : how it is baked, where the ground is, and how many threads there may be
    progress : called in the calling thread with (stage, done, total); what it raises stops the work
    Raises what render and bake_vertices do.
    """
    settings, bake = settings or RenderSettings(), bake or BakeSettings()
    check(settings)
    if not _bakes(scene, settings):
        return render(scene, settings, trace=bake, progress=progress)
    found = bake_vertices(scene, bake, progress=progress)
    baked = Baked(ao=found.ao, standard_error=found.standard_error)
    shown = render(scene, settings, baked, trace=bake, progress=progress)
    return replace(
        shown,
        seconds={"bake": sum(found.seconds.values()), **shown.seconds},
        warnings=tuple(dict.fromkeys((*found.warnings, *shown.warnings))),
    )


def _bakes(scene: Scene, settings: RenderSettings) -> bool:
    if settings.ao != "auto" or scene.triangles == 0:
        return settings.ao == "bake" and scene.triangles > 0
    if settings.channel == "error":
        return True
    meshes = [scene.meshes[number] for number in {i.mesh for i in scene.instances}]
    if any(occlusion_source(scene, mesh, given=False) != "none" for mesh in meshes):
        return False
    if settings.channel == "ao":
        return True
    return settings.channel == "beauty" and not any(map(_has_grey_colors, meshes))


def _has_grey_colors(mesh: Mesh) -> bool:
    """Whether vertex colours look like ambient occlusion: greys, and not all the same.

    Glued over them, a second bake would darken everything twice.
    """
    try:
        colors = mesh.attributes["COLOR_0"].values[:, :3] if "COLOR_0" in mesh.attributes else None
    except InputError:  # the picture will say so
        return False
    if colors is None or len(colors) == 0:
        return False
    grey = np.abs(colors - colors[:, :1]).max() < 1e-6
    return bool(grey and np.ptp(colors) > 1e-3)


def compare(
    scene: Scene,
    what: str,
    settings: RenderSettings | None = None,
    bake: BakeSettings | None = None,
    *,
    progress: Progress | None = None,
) -> Comparison:
    """Pictures side by side, on a sheet of the settings' size.

    what : 'ao': a constant ambient term beside ambient occlusion, by ambient light alone unless lights were
        chosen; 'models': every local model; 'rays=16,64,256': bakes with so many rays
    Raises SettingsError for anything else, and for a model's parameters, which differ between models.
    """
    settings, bake = settings or RenderSettings(), bake or BakeSettings()
    check_comparison(what, settings, bake)
    variants = _variants(what, settings, bake)
    cells = sheet(settings, [label for label, _, _ in variants])
    kept: dict[BakeSettings, Baked] = {}
    effects, seconds, warnings = {}, dict[str, float](), list[str]()
    for number, (label, chosen, how) in enumerate(variants):
        if progress is not None:
            progress("compare", number, len(variants))
        shown = _cell(scene, replace(chosen, size=cells.cell_size), how, kept)
        cells = cells.filled(number, displayed(shown))
        effects[label] = shown.effects
        for stage, spent in shown.seconds.items():
            seconds[stage] = seconds.get(stage, 0.0) + spent
        warnings += shown.warnings
    return Comparison(
        pixels=cells.pixels,
        effects=effects,
        seconds=seconds,
        warnings=tuple(dict.fromkeys(warnings)),
    )


def _cell(
    scene: Scene, settings: RenderSettings, bake: BakeSettings, kept: dict[BakeSettings, Baked]
) -> Preview:
    """One picture; a bake is done once for all pictures that need the same."""
    if not _bakes(scene, settings):
        return render(scene, settings, trace=bake)
    if bake not in kept:
        found = bake_vertices(scene, bake)
        kept[bake] = Baked(ao=found.ao, standard_error=found.standard_error)
    return render(scene, settings, kept[bake], trace=bake)


def check_comparison(what: str, settings: RenderSettings, bake: BakeSettings) -> None:
    """Raise SettingsError now for what compare would refuse whatever the scene, before any work."""
    variants = _variants(what, settings, bake)
    check_room(settings, [label for label, _, _ in variants])
    for _, chosen, _ in variants:
        check(chosen)


def _variants(what: str, settings: RenderSettings, bake: BakeSettings) -> Sequence[Variant]:
    """(label, settings, how to bake) of each picture of a comparison. Raises SettingsError."""
    if what == "ao":
        return _with_and_without(settings, bake)
    if what == "models":
        return [(_titled(name), replace(settings, model=name), bake) for name in MODELS]
    kind, _, counts = what.partition("=")
    if kind == "rays" and counts:
        numbers = _ray_counts(what, counts)
        return [
            (
                "1 ray" if rays == 1 else f"{rays:,} rays",
                replace(settings, ao="bake"),
                replace(bake, rays=rays, tolerance=None),
            )
            for rays in numbers
        ]
    raise SettingsError(f"compare is {what!r}; ao, models or rays=16,64,256 is needed.")


def _with_and_without(settings: RenderSettings, bake: BakeSettings) -> Sequence[Variant]:
    if settings.lights == "auto":
        settings = replace(settings, lights="none", ambient=1.0)
    chosen = "auto" if settings.ao == "none" else settings.ao
    return [
        ("constant ambient term", replace(settings, ao="none"), bake),
        ("ambient occlusion", replace(settings, ao=chosen), bake),
    ]


def _titled(name: str) -> str:
    """A model's name as people write it: cook-torrance -> Cook-Torrance."""
    short = {"fon": "FON", "eon": "EON"}
    return short.get(name, "-".join(word.capitalize() for word in name.split("-")))


def _ray_counts(what: str, text: str) -> list[int]:
    numbers = [int(part) if part.isascii() and part.isdigit() else 0 for part in text.split(",")]
    if min(numbers) < 1 or len(numbers) > MOST_RAY_COUNTS:
        raise SettingsError(
            f"compare is {what!r}; one to {MOST_RAY_COUNTS} whole numbers above 0 are needed, "
            "such as rays=16,64,256."
        )
    return numbers

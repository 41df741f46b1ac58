"""What a picture simulates and what it leaves out, with the reasons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from aobake.render_settings import RenderSettings
from aobake.shading.lobes import Lobes
from aobake.shading.materials import Look
from aobake.shading.shot import Shot

__all__ = ["Shown", "effects_of"]


@dataclass(frozen=True)
class Shown:
    """Whether something is simulated, and one sentence that says why, or why not."""

    on: bool
    reason: str


def effects_of(shot: Shot) -> Mapping[str, Shown]:
    """Name -> what was decided, in the order in which light takes it."""
    look, lobes, settings, lamps = shot.look, shot.lobes, shot.settings, len(shot.lamps)
    lit = settings.channel == "beauty"
    return {
        "lights": _lights(settings, lamps),
        "shadows": _shadows(settings, lamps),
        "ambient_occlusion": _occlusion(look, settings),
        "multi_bounce": _multi_bounce(look, settings),
        "specular": _specular(lobes, settings),
        "fresnel": _fresnel(lobes),
        "specular_occlusion": _specular_occlusion(look, lobes, settings),
        "bent_normals": _bent_normals(look, settings),
        "vertex_colors": _vertex_colors(look),
        "textures": _textures(look),
        "transparency": _transparency(look),
        "ground": _ground(shot.ground is not None, lit),
    }


def _lights(settings: RenderSettings, lamps: int) -> Shown:
    if settings.channel != "beauty":
        return Shown(False, f"channel is {settings.channel}, which no light falls on.")
    if lamps == 0:
        return Shown(False, "There is no light but the ambient one.")
    return Shown(True, "1 light." if lamps == 1 else f"{lamps} lights.")


def _shadows(settings: RenderSettings, lamps: int) -> Shown:
    if lamps == 0:
        return Shown(False, "There is no light that could cast one, so no ray looks for it.")
    if settings.no_shadows:
        return Shown(False, "no_shadows was asked for.")
    return Shown(True, "A ray goes from each point to each light that it faces.")


def _occluded(look: Look) -> int:
    return sum(source != "none" for source in look.occlusion)


def _occlusion(look: Look, settings: RenderSettings) -> Shown:
    if settings.channel not in {"beauty", "ao"}:
        return Shown(False, f"channel is {settings.channel}.")
    if settings.ao == "none":
        return Shown(False, "ao is none.")
    if look.baked is not None:
        return Shown(True, "Baked for this picture; it darkens the ambient term alone.")
    kinds = {source for source in look.occlusion if source != "none"}
    if not kinds:
        colors = any("COLOR_0" in values for values in look.values)
        hint = " It may be in the vertex colours, which darken all light." if colors else ""
        return Shown(False, f"None is baked that could be told from colour.{hint}")
    names = {"attribute": "the attribute _AO", "texture": "occlusion textures", "given": ""}
    where = " and ".join(names[kind] for kind in sorted(kinds))
    share = f"{_occluded(look)} of {len(look.occlusion)} meshes"
    return Shown(True, f"Taken from {where} of {share}; it darkens the ambient term alone.")


def _multi_bounce(look: Look, settings: RenderSettings) -> Shown:
    if not settings.multi_bounce:
        return Shown(False, "multi_bounce was not asked for.")
    if _occluded(look) == 0 or settings.ao == "none":
        return Shown(False, "There is no ambient occlusion that it could brighten.")
    return Shown(True, "Occluded places are brightened by the colour around them.")


def _specular(lobes: Lobes, settings: RenderSettings) -> Shown:
    if lobes.specular is None:
        why = "ks is 0" if settings.ks == 0.0 else f"{lobes.diffuse.name} has no specular lobe"
        return Shown(False, f"{why}.")
    return Shown(True, f"{lobes.specular.name} with ks = {lobes.ks:g}, the rest is Lambertian.")


def _fresnel(lobes: Lobes) -> Shown:
    if lobes.specular is None:
        return Shown(False, "There is no specular lobe.")
    if not lobes.fresnel:
        return Shown(False, f"{lobes.specular.name} reflects as much at all angles.")
    return Shown(True, f"Index of refraction {lobes.values['ior']:g}.")


def _specular_occlusion(look: Look, lobes: Lobes, settings: RenderSettings) -> Shown:
    if lobes.specular is None:
        return Shown(False, "There is no specular lobe.")
    if _occluded(look) == 0 or settings.ao == "none":
        return Shown(False, "There is no ambient occlusion.")
    return Shown(True, "The highlight of the ambient light is occluded too.")


def _bent_normals(look: Look, settings: RenderSettings) -> Shown:
    if not look.has_bent_normals:
        return Shown(False, "None are baked.")
    if settings.channel == "bent-normal":
        return Shown(True, "They are shown.")
    return Shown(False, "The ambient light is the same from all sides, so they change nothing.")


def _vertex_colors(look: Look) -> Shown:
    count = sum("COLOR_0" in values for values in look.values)
    if count == 0:
        return Shown(False, "No mesh has any.")
    meshes = "1 mesh has" if count == 1 else f"{count} meshes have"
    return Shown(True, f"{meshes} COLOR_0, which multiplies the base colour, as glTF says.")


def _textures(look: Look) -> Shown:
    count = sum(material.base_color_texture is not None for material in look.scene.materials)
    if count == 0:
        return Shown(False, "No material has one.")
    return Shown(True, f"{count} materials have a base colour texture.")


def _transparency(look: Look) -> Shown:
    if not look.see_through:
        return Shown(False, "Every surface is opaque, so rays end at the first one.")
    return Shown(True, "Rays go on behind what is cut out or blended, also those to lights.")


def _ground(ground: bool, lit: bool) -> Shown:
    if ground:
        return Shown(True, "It takes from the background what shadow and occlusion take from it.")
    return Shown(False, "None was asked for." if lit else "It is part of the lit picture alone.")

"""How a surface reflects: kd Rd + ks Rs with kd + ks = 1, and the same of ambient light.

Only the lobes that a model calls for are evaluated: no specular one where ks is 0, no Fresnel where the
specular one has none.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.errors import SettingsError
from aobake.render_settings import RenderSettings
from aobake.shading.ambient import multi_bounce, specular_occlusion
from aobake.shading.columns import dot
from aobake.shading.fresnel import fresnel_schlick, normal_reflectance
from aobake.shading.models import MODELS, Model, evaluate, model
from aobake.shading.parameters import KS

__all__ = ["PARAMETERS", "Lobes", "ambient_reflected", "lobes_of", "reflected"]

Float32Array = NDArray[np.float32]

PARAMETERS = ("exponent", "roughness", "ior", "extinction", "sigma", "c", "k")
METAL = 3.0  # extinction; a lobe that reflects a twentieth is hardly seen beside a diffuse one


@dataclass(frozen=True, eq=False, kw_only=True)
class Lobes:
    """diffuse, specular : the models, None where ks is 0; values : of the parameters, those given or not."""

    diffuse: Model
    specular: Model | None
    ks: float
    values: Mapping[str, float]

    @property
    def fresnel(self) -> bool:
        """Whether the specular lobe follows Fresnel's equations."""
        return self.specular is not None and "ior" in self.values


def lobes_of(settings: RenderSettings) -> Lobes:
    """The lobes of the model that the settings name.

    Raises SettingsError for an unknown model, and for parameters that it does not have or out of range.
    """
    chosen = model(settings.model)
    values = {each.name: each.default for each in chosen.parameters if each.name in PARAMETERS}
    given = {name: getattr(settings, name) for name in PARAMETERS}
    values |= {name: float(value) for name, value in given.items() if value is not None}
    if "extinction" in values and settings.ior is None and settings.extinction is None:
        values["extinction"] = METAL
    up = np.array([[0.0, 0.0, 1.0]])
    evaluate(chosen, up, up, up, values)  # raises now what it would raise later
    if chosen.lobe == "diffuse":
        if settings.ks:
            specular = ", ".join(name for name, each in MODELS.items() if each.lobe == "specular")
            raise SettingsError(
                f"ks is {settings.ks!r}, but {chosen.name} has no specular lobe. Those with one: {specular}."
            )
        return Lobes(diffuse=chosen, specular=None, ks=0.0, values=values)
    ks = settings.ks
    if ks is None:
        ks = KS.default
    specular_model = chosen if ks > 0.0 else None
    return Lobes(diffuse=MODELS["lambert"], specular=specular_model, ks=float(ks), values=values)


def reflected(
    lobes: Lobes,
    normal: Float32Array,
    light: Float32Array,
    view: Float32Array,
    albedo: Float32Array,
) -> Float32Array:
    """(3, N) float32 in 1/sr, of unit vectors (3, N) away from the surface; the specular lobe is white."""
    kd = np.float32(1.0 - lobes.ks)
    result = kd * _diffuse(lobes, normal, light, view, albedo)
    if lobes.specular is not None:
        gloss = evaluate(lobes.specular, normal.T, light.T, view.T, lobes.values)
        result += np.float32(lobes.ks) * gloss
    return result


def _diffuse(
    lobes: Lobes,
    normal: Float32Array,
    light: Float32Array,
    view: Float32Array,
    albedo: Float32Array,
) -> Float32Array:
    if lobes.specular is not None or lobes.diffuse.name == "lambert":
        # Light and view are above the horizon here: Lambert's law is one number.
        return np.asarray(albedo * np.float32(1.0 / np.pi))
    values = dict(lobes.values)
    if all(each.name != "albedo" for each in lobes.diffuse.parameters):
        value = evaluate(lobes.diffuse, normal.T, light.T, view.T, values)
        return np.asarray(albedo * value, np.float32)
    columns = [
        evaluate(lobes.diffuse, normal.T, light.T, view.T, {**values, "albedo": channel})
        for channel in albedo
    ]
    return np.stack(columns).astype(np.float32)


def ambient_reflected(
    lobes: Lobes,
    ao: Float32Array,
    normal: Float32Array,
    view: Float32Array,
    albedo: Float32Array,
    *,
    bounces: bool,
) -> Float32Array:
    """(3, N) share of the ambient light that comes back: kd A albedo + ks F of what the highlight sees.

    ao : (N,) ambient occlusion, which attenuates this term and no other
    bounces : whether light between surfaces brightens occluded places
    """
    open_share = multi_bounce(ao, albedo) if bounces else ao
    diffuse = albedo * open_share
    if lobes.specular is None:
        return np.asarray(diffuse)
    cosine = np.clip(dot(normal, view), 0.0, 1.0)
    sky = specular_occlusion(ao, cosine, _perceptual_roughness(lobes))
    if lobes.fresnel:
        f0 = normal_reflectance(lobes.values["ior"], lobes.values["extinction"])
        sky = (sky * fresnel_schlick(cosine, f0)).astype(np.float32)
    ks = np.float32(lobes.ks)
    return np.asarray((1 - ks) * diffuse + ks * sky, np.float32)


def _perceptual_roughness(lobes: Lobes) -> float:
    """The square root of the facets' slope m, which is 1/c, or sqrt(2 / (n + 2)) of a power of the cosine.

    Source: B. Walter et al., Microfacet models for refraction, EGSR 2007, section 5.2.
    """
    values = lobes.values
    if "roughness" in values:
        slope = values["roughness"]
    elif "c" in values:
        slope = 1.0 / max(values["c"], 1.0)
    else:
        slope = math.sqrt(2.0 / (values["exponent"] + 2.0))
    return math.sqrt(min(slope, 1.0))

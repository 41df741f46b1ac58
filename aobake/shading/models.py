"""The models by name, with what they are adjusted by: for the command line, and for pictures of all of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from numpy.typing import ArrayLike

from aobake.errors import SettingsError, nearest
from aobake.shading.blinn_phong import blinn_phong, blinn_phong_normalised
from aobake.shading.cook_torrance import cook_torrance
from aobake.shading.eon import eon, fon
from aobake.shading.lambert import lambert
from aobake.shading.minnaert import minnaert
from aobake.shading.oren_nayar import oren_nayar, oren_nayar_full
from aobake.shading.oren_nayar_fujii import oren_nayar_fujii
from aobake.shading.parameters import (
    ALBEDO,
    EXPONENT,
    EXTINCTION,
    FACET_C,
    IOR,
    MINNAERT_K,
    ROUGHNESS,
    SIGMA,
    UNIT_ROUGHNESS,
    Parameter,
)
from aobake.shading.phong import phong, phong_normalised
from aobake.shading.torrance_sparrow import torrance_sparrow
from aobake.shading.vectors import Floats

__all__ = ["MODELS", "Lobe", "Model", "evaluate", "model"]

Lobe = Literal["diffuse", "specular"]


@dataclass(frozen=True)
class Model:
    """A local model: its function of (normal, light, view) and its parameters, which go by keyword."""

    name: str
    lobe: Lobe
    function: Callable[..., Floats]
    parameters: tuple[Parameter, ...]
    help: str


_ALL = (
    Model("lambert", "diffuse", lambert, (), "As bright from everywhere (1760)."),
    Model("phong", "specular", phong, (EXPONENT,), "A highlight about the mirrored light (1975)."),
    Model("phong-normalised", "specular", phong_normalised, (EXPONENT,), "Phong, with its energy kept."),
    Model("blinn-phong", "specular", blinn_phong, (EXPONENT,), "A highlight about the half vector (1977)."),
    Model("blinn-phong-normalised", "specular", blinn_phong_normalised, (EXPONENT,),
          "Blinn-Phong, with its energy kept."),
    Model("torrance-sparrow", "specular", torrance_sparrow, (FACET_C, IOR, EXTINCTION),
          "Mirror-like facets with Gaussian angles (1967)."),
    Model("cook-torrance", "specular", cook_torrance, (ROUGHNESS, IOR, EXTINCTION),
          "Mirror-like facets with Gaussian slopes, of plastic or metal (1982)."),
    Model("oren-nayar", "diffuse", oren_nayar, (SIGMA,), "Diffuse facets, the short form (1994)."),
    Model("oren-nayar-full", "diffuse", oren_nayar_full, (SIGMA, ALBEDO),
          "Diffuse facets, with light between them (1994)."),
    Model("oren-nayar-fujii", "diffuse", oren_nayar_fujii, (SIGMA, ALBEDO),
          "Diffuse facets, in one smooth term (2013)."),
    Model("fon", "diffuse", fon, (UNIT_ROUGHNESS, ALBEDO), "Diffuse facets that add no light (2025)."),
    Model("eon", "diffuse", eon, (UNIT_ROUGHNESS, ALBEDO),
          "Diffuse facets that neither add nor lose light (2025)."),
    Model("minnaert", "diffuse", minnaert, (MINNAERT_K,), "The moon's bright limb (1941)."),
)  # fmt: skip
MODELS: Mapping[str, Model] = MappingProxyType({each.name: each for each in _ALL})


def model(name: str) -> Model:
    """The model of that name. Raises SettingsError with the nearest name and all of them."""
    if name not in MODELS:
        known = f" Known: {', '.join(sorted(MODELS))}."
        hint = nearest(name, MODELS)
        raise SettingsError(f"model is {name!r}.{hint if hint == known else hint + known}")
    return MODELS[name]


def _who_has(name: str, own: Collection[str]) -> str:
    """Where a parameter belongs that a model does not have, or what the model has instead."""
    others = [m.name for m in MODELS.values() if name in {each.name for each in m.parameters}]
    if others:
        return f" Models with it: {', '.join(others)}."
    return nearest(name, own) if own else " It has none."


def evaluate(
    chosen: Model,
    normal: ArrayLike,
    light: ArrayLike,
    view: ArrayLike,
    values: Mapping[str, ArrayLike] | None = None,
) -> Floats:
    """The model's value with these parameters; those that are not given have their defaults.

    Returns (...,), as the model does.
    Raises SettingsError for a parameter that the model does not have, or out of its range.
    """
    given = {each.name: each.default for each in chosen.parameters} | dict(values or {})
    own = {each.name for each in chosen.parameters}
    for name in given:
        if name not in own:
            raise SettingsError(f"{name} is no parameter of {chosen.name}.{_who_has(name, own)}")
    return chosen.function(normal, light, view, **given)

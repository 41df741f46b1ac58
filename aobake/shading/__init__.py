"""Shading: local illumination models as functions of unit vectors, and the previews made with them.

    import aobake.shading as shading
    value = shading.cook_torrance(normal, light, view, roughness=0.3, ior=1.5)    # (...,) in 1/sr

All models take (normal, light, view), (..., 3) each, which broadcast; all vectors point away from the
surface. Their values are finite, never negative, and 0 where light or view is below the horizon.
"""

from __future__ import annotations

from aobake.shading.blinn_phong import blinn_phong, blinn_phong_normalised
from aobake.shading.cook_torrance import cook_torrance
from aobake.shading.eon import eon, fon
from aobake.shading.facets import beckmann, cosine_power, gaussian_angles, trowbridge_reitz
from aobake.shading.fresnel import fresnel_conductor, fresnel_dielectric, fresnel_schlick
from aobake.shading.lambert import lambert
from aobake.shading.masking import v_cavity_masking
from aobake.shading.minnaert import minnaert
from aobake.shading.mix import mixed
from aobake.shading.models import MODELS, Model, evaluate, model
from aobake.shading.oren_nayar import oren_nayar, oren_nayar_full
from aobake.shading.oren_nayar_fujii import oren_nayar_fujii
from aobake.shading.parameters import Parameter
from aobake.shading.phong import phong, phong_normalised
from aobake.shading.torrance_sparrow import torrance_sparrow

__all__ = [
    "MODELS",
    "Model",
    "Parameter",
    "beckmann",
    "blinn_phong",
    "blinn_phong_normalised",
    "cook_torrance",
    "cosine_power",
    "eon",
    "evaluate",
    "fon",
    "fresnel_conductor",
    "fresnel_dielectric",
    "fresnel_schlick",
    "gaussian_angles",
    "lambert",
    "minnaert",
    "mixed",
    "model",
    "oren_nayar",
    "oren_nayar_fujii",
    "oren_nayar_full",
    "phong",
    "phong_normalised",
    "torrance_sparrow",
    "trowbridge_reitz",
    "v_cavity_masking",
]

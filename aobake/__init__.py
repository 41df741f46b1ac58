"""aobake bakes ambient occlusion into meshes, at Embree's speed, and gives each asset back whole."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from aobake.errors import (
    AobakeError,
    Cancelled,
    EngineError,
    InputError,
    OutputError,
    SettingsError,
)
from aobake.plan import Effect, Plan, plan
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

if TYPE_CHECKING:
    from aobake import shading
    from aobake.bake import bake_vertices, visibility
    from aobake.lightmaps import bake_texture
    from aobake.meshes.formats import load
    from aobake.meshes.scene import Instance, Material, Mesh, Scene
    from aobake.results import BakedTexture, BakedVertices, Estimate, save

__all__ = [
    "AobakeError",
    "BakeSettings",
    "BakedTexture",
    "BakedVertices",
    "Cancelled",
    "Effect",
    "EngineError",
    "Estimate",
    "ImageSettings",
    "InputError",
    "Instance",
    "Material",
    "Mesh",
    "OutputError",
    "Plan",
    "Scene",
    "SettingsError",
    "StoreSettings",
    "bake_texture",
    "bake_vertices",
    "load",
    "plan",
    "save",
    "shading",
    "visibility",
]
__version__ = "0.1.0"

# What needs numpy or the tracer is imported when it is first asked for: `aobake --help` needs neither.
_HOMES = {
    "aobake.bake": ("bake_vertices", "visibility"),
    "aobake.lightmaps": ("bake_texture",),
    "aobake.meshes.formats": ("load",),
    "aobake.meshes.scene": ("Instance", "Material", "Mesh", "Scene"),
    "aobake.results": ("BakedTexture", "BakedVertices", "Estimate", "save"),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    if name == "shading":
        return importlib.import_module("aobake.shading")
    if name not in _HOME_OF:
        raise AttributeError(f"module 'aobake' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])

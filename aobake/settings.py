"""The settings of a bake: frozen, validated once, the one source of flags, TOML keys, defaults and help.

The docstring below each field is its help text, in the API reference and on the command line alike.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal, get_args

from aobake.errors import SettingsError, nearest

__all__ = ["Backfaces", "BakeSettings", "Falloff", "GroundAxis", "Method", "Store", "StoreSettings"]

Falloff = Literal["none", "linear", "smooth"]
Backfaces = Literal["occlude", "ignore"]
GroundAxis = Literal["+y", "+z"]
Method = Literal["point"]
Store = Literal["color", "occlusion", "attribute"]

MOST_RAYS = (
    1 << 20
)  # a direction set of this size takes 12 MiB; the error is below 1e-5 long before


@dataclass(frozen=True, kw_only=True)
class BakeSettings:
    """How ambient occlusion is estimated. Raises SettingsError for a value that has no meaning."""

    rays: int = 256
    """Rays per point. The error falls as rays^-0.75: four times the rays give about a third of it."""

    tolerance: float | None = None
    """Standard error to reach at each point; rays go where they are still needed, up to max_rays.
    None: the fixed number of rays."""

    max_rays: int = 4096
    """Most rays per point when a tolerance is given."""

    seed: int = 0
    """Seed of the sample directions. The same input, settings and seed give the same bytes."""

    threads: int | None = None
    """Threads to trace with. None: one per processor. The result does not depend on it."""

    max_distance: float | None = None
    """Surfaces farther away than this do not occlude, in scene units. None: no limit."""

    falloff: Falloff = "none"
    """How occlusion fades towards max_distance: none (a hard limit), linear (1 - d/D) or smooth."""

    backfaces: Backfaces = "occlude"
    """Whether surfaces that are met from behind occlude."""

    ground: GroundAxis | None = None
    """Puts an endless ground under the lowest point of the scene; the axis that points up."""

    method: Method = "point"
    """How values at vertices are found: point takes the integral at the vertex itself."""

    strict: bool = False
    """Whether anything that had to be passed over, mended or left in doubt is an error."""

    repair: bool = False
    """Mends meshes for the bake: joins vertices at one place, splits what is not manifold, closes holes.
    Needs pymeshlab (aobake[repair]). What is written back is not mended."""

    max_hole: int = 30
    """Edges around the largest hole that repair closes."""

    def __post_init__(self) -> None:
        _whole("rays", self.rays, 1, MOST_RAYS)
        _whole("max_rays", self.max_rays, 1, MOST_RAYS)
        _whole("seed", self.seed, 0, 2**64 - 1)
        if self.threads is not None:
            _whole("threads", self.threads, 1, 4096)
        if self.tolerance is not None:
            _real("tolerance", self.tolerance)
            if not 0.0 < self.tolerance <= 0.5:
                raise SettingsError(
                    f"tolerance is {self.tolerance!r}; a standard error above 0 and up to 0.5 is needed."
                )
        if self.max_distance is not None:
            _real("max_distance", self.max_distance)
            if not self.max_distance > 0.0:
                raise SettingsError(
                    f"max_distance is {self.max_distance!r}; a length above 0 is needed (None: no limit)."
                )
        _choice("falloff", self.falloff, get_args(Falloff))
        _choice("backfaces", self.backfaces, get_args(Backfaces))
        _choice("method", self.method, get_args(Method))
        if self.ground is not None:
            _choice("ground", self.ground, get_args(GroundAxis))
        _whole("max_hole", self.max_hole, 3, 1_000_000)
        for name, value in (("strict", self.strict), ("repair", self.repair)):
            if not isinstance(value, bool):
                raise SettingsError(f"{name} is {value!r}; True or False is needed.")
        if self.falloff != "none" and self.max_distance is None:
            raise SettingsError(
                f"falloff is {self.falloff!r}, but nothing says where it ends: give max_distance as well."
            )


@dataclass(frozen=True, kw_only=True)
class StoreSettings:
    """How ambient occlusion is kept in an asset. Raises SettingsError for a value that has no meaning."""

    store: Store = "color"
    """Where the values go: color (multiplied into the vertex colours), occlusion (glTF: an occlusion
    texture that reads them from a texture coordinate, so that only ambient light is darkened), or
    attribute (an attribute of its own: _AO in glTF, ao in PLY and USD). A format without such a
    place takes the next one that it has, and a warning says so."""

    def __post_init__(self) -> None:
        _choice("store", self.store, get_args(Store))


def _whole(name: str, value: object, least: int, most: int) -> None:
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise SettingsError(f"{name} is {value!r}; a whole number is needed.")
    if not least <= value.__index__() <= most:
        raise SettingsError(
            f"{name} is {value!r}; a whole number from {least} to {most} is needed."
        )


def _real(name: str, value: object) -> None:
    if (
        isinstance(value, bool)
        or not hasattr(value, "__float__")
        or not math.isfinite(float(value))
    ):
        raise SettingsError(f"{name} is {value!r}; a finite number is needed.")


def _choice(name: str, value: object, known: Collection[str]) -> None:
    if value not in known:
        raise SettingsError(f"{name} is {value!r}.{nearest(value, known)}")

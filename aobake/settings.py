"""The settings of a bake: frozen, validated once, the one source of flags, TOML keys, defaults and help.

The docstring below each field is its help text, in the API reference and on the command line alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Literal, get_args

from aobake.checks import (
    check_choice,
    check_flag,
    check_positive,
    check_real,
    check_whole,
    check_words,
    is_number,
)
from aobake.errors import SettingsError, nearest
from aobake.overrides import forced, switched

__all__ = [
    "FIRST_ROUND",
    "QUALITIES",
    "AtlasScope",
    "AtlasSettings",
    "Backfaces",
    "BakeSettings",
    "BentSpace",
    "Blend",
    "Denoise",
    "Distribution",
    "Encoding",
    "Falloff",
    "Further",
    "GroundAxis",
    "ImageSettings",
    "Method",
    "Pack",
    "Quality",
    "Store",
    "StoreSettings",
    "ToleranceOf",
    "TraceSettings",
    "VertexSettings",
]

Falloff = Literal["none", "linear", "smooth"]
Backfaces = Literal["occlude", "ignore"]
GroundAxis = Literal["+y", "+z"]
Distribution = Literal["cosine", "uniform"]
Method = Literal["point", "lsq", "auto"]
ToleranceOf = Literal["each", "rms"]
Quality = Literal["draft", "normal", "final"]
Store = Literal["color", "occlusion", "attribute"]
AtlasScope = Literal["scene", "material", "mesh"]
Denoise = Literal["auto", "on", "off"]
Blend = Literal["replace", "multiply"]
BentSpace = Literal["tangent", "object"]
Further = Literal["bent_normals", "mean_distance"]
Encoding = Literal["8", "16", "half", "float"]
Pack = Literal["separate", "orm"]
UV_CHOICES = ("auto", "keep", "unwrap")
SUPERSAMPLES = (1, 2, 4)

MOST_RAYS = (
    1 << 20
)  # a direction set of this size takes 12 MiB; the error is below 1e-5 long before


FIRST_ROUND = 32  # the least that max_rays may be: fewer rays hardly tell their error
QUALITIES: Mapping[Quality, float] = {"draft": 0.02, "normal": 0.005, "final": 0.002}

MOST_TEXELS_PER_SIDE = 32768


@dataclass(frozen=True, kw_only=True)
class TraceSettings:
    """How ambient occlusion is estimated at a point."""

    rays: int = 256
    """Rays per point. The error falls as rays^-0.75: four times the rays give about a third of it."""

    tolerance: float | None = None
    """Standard error to reach at each point; rays go where they are still needed, up to max_rays.
    rms:E asks for the root mean square E over all points instead. None: the fixed number of rays."""

    tolerance_of: ToleranceOf = "each"
    """What has to reach the tolerance: each point, or the rms of all points; rms:E says both at once."""

    quality: Quality | None = None
    """A tolerance by name: draft (0.02), normal (0.005) or final (0.002), which take 80, 490 and 1,550 rays
    a vertex on the demo scene. A tolerance that is given as well has the last word. None: as rays and
    tolerance say."""

    max_rays: int = 4096
    """Most rays per point when a tolerance is given."""

    seed: int = 0
    """Seed of the sample directions. The same input, settings and seed give the same bytes."""

    threads: int | None = None
    """Threads to trace with. None: one per processor. The result does not depend on it."""

    max_distance: float | None = None
    """Surfaces farther away than this do not occlude, in scene units, or as 5% of the diagonal of the scene.
    None: no limit."""

    falloff: Falloff = "none"
    """How occlusion fades towards max_distance: none (a hard limit), linear (1 - d/D) or smooth."""

    backfaces: Backfaces = "occlude"
    """Whether surfaces that are met from behind occlude."""

    ground: GroundAxis | None = None
    """Puts an endless ground under the lowest point of the scene; the axis that points up."""

    distribution: Distribution = "cosine"
    """How directions count: cosine, by the cosine to the normal, as light does, or uniform, all alike."""

    spread: float = 180.0
    """Full opening angle of the cone of directions around the normal, in degrees; 180 is the hemisphere."""

    occluders: tuple[str, ...] = ("all",)
    """What occludes: all, own (each object itself alone), or names of meshes, nodes or materials, in which *
    stands for any letters; extras:KEY and extras:KEY=VALUE take what has this glTF extra. Once for each."""

    exclude: tuple[str, ...] = ()
    """Names of what does not occlude, as those of occluders; it is baked like the rest. Once for each."""

    bent_normals: bool = False
    """Whether the mean direction that is open is kept as well, at each vertex: _BENT_NORMAL in glTF."""

    mean_distance: bool = False
    """Whether the mean distance to what is around is kept as well, at each vertex: _MEAN_DISTANCE in glTF,
    mean_distance in PLY. Counted up to max_distance, or to the diagonal of the scene."""

    effect: tuple[str, ...] = ()
    """Switches an effect of the plan by hand: NAME=on or NAME=off. Once for each effect."""

    strict: bool = False
    """Whether anything that had to be passed over, mended or left in doubt is an error."""

    repair: bool = False
    """Mends meshes for the bake: joins vertices at one place, splits what is not manifold, closes holes.
    Needs pymeshlab (aobake[repair]). What is written back is not mended."""

    max_hole: int = 30
    """Edges around the largest hole that repair closes."""

    def __post_init__(self) -> None:
        check_whole("rays", self.rays, 1, MOST_RAYS)
        check_whole("max_rays", self.max_rays, 1, MOST_RAYS)
        self._settle_tolerance()
        check_whole("seed", self.seed, 0, 2**64 - 1)
        if self.threads is not None:
            check_whole("threads", self.threads, 1, 4096)
        self._settle_max_distance()
        check_choice("falloff", self.falloff, get_args(Falloff))
        check_choice("backfaces", self.backfaces, get_args(Backfaces))
        if self.ground is not None:
            check_choice("ground", self.ground, get_args(GroundAxis))
        check_choice("distribution", self.distribution, get_args(Distribution))
        if not 0.0 < check_real("spread", self.spread) <= 180.0:
            raise SettingsError(
                f"spread is {self.spread!r}; an angle above 0 and up to 180 is needed."
            )
        for name in ("occluders", "exclude", "effect"):
            object.__setattr__(self, name, check_words(name, getattr(self, name)))
        if not self.occluders:
            raise SettingsError(f"occluders is {self.occluders!r}; all, own or names are needed.")
        forced(self.effect)
        check_whole("max_hole", self.max_hole, 3, 1_000_000)
        for name in ("strict", "repair", "bent_normals", "mean_distance"):
            check_flag(name, getattr(self, name))
        if self.falloff != "none" and self.max_distance is None:
            raise SettingsError(
                f"falloff is {self.falloff!r}, but nothing says where it ends: give max_distance as well."
            )

    @property
    def further(self) -> tuple[Further, ...]:
        """What is kept at vertices besides occlusion."""
        return tuple(name for name in get_args(Further) if getattr(self, name))

    def _settle_max_distance(self) -> None:
        """A length is a number; a share of a diagonal stays in words until there is a scene."""
        given: object = self.max_distance
        if given is None:
            return
        number = given
        if isinstance(given, str):
            number = float(given[:-1]) if given.endswith("%") and is_number(given[:-1]) else given
        if not check_real("max_distance", number) > 0.0:
            raise SettingsError(
                f"max_distance is {given!r}; a length above 0 is needed (None: no limit)."
            )

    def _settle_tolerance(self) -> None:
        """Take 'rms:0.01' apart, and a quality for its tolerance."""
        check_choice("tolerance_of", self.tolerance_of, get_args(ToleranceOf))
        given: object = self.tolerance
        if isinstance(given, str):
            word, _, number = given.partition(":")
            if word != "rms" or not is_number(number):
                raise SettingsError(f"tolerance is {given!r}; a number is needed, or rms:0.01.")
            given = float(number)
            object.__setattr__(self, "tolerance_of", "rms")
        if self.quality is not None:
            check_choice("quality", self.quality, get_args(Quality))
            given = QUALITIES[self.quality] if given is None else given
        if given is not None:
            if not 0.0 < check_real("tolerance", given) <= 0.5:
                raise SettingsError(
                    f"tolerance is {given!r}; a standard error above 0 and up to 0.5 is needed."
                )
            if self.max_rays < FIRST_ROUND:
                raise SettingsError(
                    f"max_rays is {self.max_rays!r}; a tolerance needs room for {FIRST_ROUND} rays at a "
                    "point: give at least that, or rays instead of a tolerance."
                )
        object.__setattr__(self, "tolerance", given)


@dataclass(frozen=True, kw_only=True)
class VertexSettings:
    """What concerns values at vertices alone."""

    method: Method = "point"
    """How values at vertices are found: point takes the integral at the vertex itself; lsq fits them to
    samples inside the triangles, which is closer to the truth where triangles are large; auto chooses."""

    def __post_init__(self) -> None:
        check_choice("method", self.method, get_args(Method))


@dataclass(frozen=True, kw_only=True)
class AtlasSettings:
    """How surfaces are laid out in a texture, and what becomes of its texels."""

    uv: str = "auto"
    """Texture coordinates: auto keeps the first set without overlaps and makes a new one else, keep takes the
    first set or is an error, unwrap always makes a new one; a number takes that set (TEXCOORD_n)."""

    atlas: AtlasScope = "scene"
    """What shares an image: the whole scene, what is of one material, or each mesh alone."""

    size: int = 1024
    """Width and height of each image, in pixels."""

    padding: int | None = None
    """Pixels between charts of a new layout. None: enough for 4 mip levels, as far as there is room."""

    texels_per_unit: float | None = None
    """Texels per scene unit of a new layout. None: as many as fit."""

    unwrap_timeout: float = 300.0
    """Seconds that unwrapping may take before meshes are cut into more and simpler charts."""

    supersample: int = 1
    """Points per texel along each axis: 1, 2 or 4."""

    normal_map: bool = False
    """Whether the materials' normal maps turn the hemisphere that is integrated over."""

    denoise: Denoise = "auto"
    """Whether Open Image Denoise smooths what is left of the noise: auto does it where that is cheaper
    than more rays. Needs pyoidn (aobake[denoise])."""

    blend: Blend = "replace"
    """What becomes of an occlusion texture that is there already: replace leaves it unused, multiply
    takes its values into the new one."""

    bent_space: BentSpace = "tangent"
    """What the bent normals of a texture are relative to: tangent keeps them as normal maps are, object
    in the space of each mesh, as its normals are."""

    def __post_init__(self) -> None:
        if str(self.uv) not in UV_CHOICES and not (
            str(self.uv).isascii() and str(self.uv).isdigit()
        ):
            raise SettingsError(
                f"uv is {self.uv!r}; a number is needed, or a word.{nearest(str(self.uv), UV_CHOICES)}"
            )
        object.__setattr__(self, "uv", str(self.uv))
        check_choice("atlas", self.atlas, get_args(AtlasScope))
        check_whole("size", self.size, 1, MOST_TEXELS_PER_SIDE)
        if self.padding is not None:
            check_whole("padding", self.padding, 0, 1024)
        if self.texels_per_unit is not None:
            check_positive("texels_per_unit", self.texels_per_unit)
        check_positive("unwrap_timeout", self.unwrap_timeout)
        if self.supersample not in SUPERSAMPLES:
            raise SettingsError(f"supersample is {self.supersample!r}; 1, 2 or 4 is needed.")
        check_flag("normal_map", self.normal_map)
        check_choice("denoise", self.denoise, get_args(Denoise))
        check_choice("blend", self.blend, get_args(Blend))
        check_choice("bent_space", self.bent_space, get_args(BentSpace))


@dataclass(frozen=True, kw_only=True)
class BakeSettings(AtlasSettings, VertexSettings, TraceSettings):
    """Everything about a bake. Raises SettingsError for a value that has no meaning."""

    def __post_init__(self) -> None:
        TraceSettings.__post_init__(self)
        VertexSettings.__post_init__(self)
        AtlasSettings.__post_init__(self)
        self._switch()

    def _switch(self) -> None:
        """Take in the effects that are switched by hand."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        defaults = {field.name: field.default for field in fields(self)}
        for name, value in switched(self.effect, values, defaults).items():
            object.__setattr__(self, name, value)
        if self.method == "lsq" and (self.bent_normals or self.mean_distance):
            name = "bent_normals" if self.bent_normals else "mean_distance"
            raise SettingsError(
                f"{name} is found at points, and method is 'lsq', which fits values. Leave one of them out."
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
        check_choice("store", self.store, get_args(Store))


@dataclass(frozen=True, kw_only=True)
class ImageSettings:
    """How a lightmap is kept. Raises SettingsError for a value that has no meaning."""

    encoding: Encoding | None = None
    """Numbers in the image: 8 (dithered) or 16 bits, or half or float, which EXR and TIFF can hold.
    None: half in EXR, 8 in everything else."""

    pack: Pack = "separate"
    """Where the values go in glTF: separate makes an image of its own; orm puts them into the red of a
    copy of the metallic-roughness image, where that is looked up in the same way and has the same size."""

    def __post_init__(self) -> None:
        if self.encoding is not None:
            check_choice("encoding", self.encoding, get_args(Encoding))
        check_choice("pack", self.pack, get_args(Pack))

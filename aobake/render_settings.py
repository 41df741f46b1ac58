"""The settings of a preview: frozen, validated once, the one source of flags, defaults and help.

The docstring below each field is its help text, in the API reference and on the command line alike.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal, get_args

from aobake.checks import check_between, check_choice, check_flag, check_whole
from aobake.errors import SettingsError
from aobake.settings import GroundAxis

__all__ = [
    "Background",
    "Channel",
    "Lights",
    "OcclusionChoice",
    "RenderSettings",
    "Tone",
    "color_of",
    "numbers_of",
    "size_of",
]

Channel = Literal["beauty", "ao", "normal", "albedo", "bent-normal", "error"]
Lights = Literal["auto", "file", "key", "none"]
OcclusionChoice = Literal["auto", "baked", "bake", "none"]
Tone = Literal["plain", "filmic"]
Background = Literal["gradient", "transparent"]

MOST_PIXELS_PER_SIDE = 32768
LARGEST_SAMPLES = 4096
HEX_COLOR = re.compile(r"#[0-9a-fA-F]{6}")


@dataclass(frozen=True, kw_only=True)
class RenderSettings:
    """Everything about a picture. Raises SettingsError for a value that has no meaning."""

    size: str = "1280x720"
    """Width and height of the picture, in pixels."""

    samples: int = 16
    """Rays per pixel, against jagged edges."""

    camera: str = "auto"
    """The camera: auto takes the file's first one where it has one, frame makes one that shows the whole
    asset, anything else is the name or the number of one of the file's."""

    view: str | None = None
    """Where a camera that frames the asset looks from: azimuth and elevation in degrees, such as 30,20;
    0,0 looks at the front. Given, it means camera frame. None: 30,20."""

    fov: float = 30.0
    """Vertical field of view of a camera that frames the asset, in degrees."""

    up: GroundAxis | None = None
    """The axis that points up. None: the one of the ground, else +y."""

    lights: Lights = "auto"
    """The lights: file takes those of the file, key one light over the camera's left shoulder, none leaves
    the ambient light alone; auto takes those of the file where it has some, else key."""

    key: float = 1.8
    """Irradiance from the key light, and what lights of a file are brought to, since files differ by
    powers of ten; pi makes a white surface that faces it as bright as white."""

    ambient: float = 0.4
    """Brightness of the ambient light, the same from all sides; 1 makes what is white and open white."""

    no_shadows: bool = False
    """Whether lights shine through everything."""

    model: str = "lambert"
    """The local illumination model of all surfaces."""

    ks: float | None = None
    """Share of the specular lobe; the diffuse one has the rest. None: 0.2, or 0 where the model has none."""

    roughness: float | None = None
    """Root mean square slope of the facets (cook-torrance). None: the model's own default, here and below."""

    ior: float | None = None
    """Index of refraction (torrance-sparrow, cook-torrance)."""

    exponent: float | None = None
    """Sharpness of the highlight (phong, blinn-phong)."""

    sigma: float | None = None
    """Standard deviation of the facets' slope angle, in radians (oren-nayar)."""

    k: float | None = None
    """Darkening towards the limb (minnaert)."""

    extinction: float | None = None
    """Imaginary part of a metal's index of refraction; 0: not a metal (torrance-sparrow, cook-torrance).
    None: 3, a metal, or 0 where ior is given."""

    c: float | None = None
    """Narrowness of the facets' distribution (torrance-sparrow)."""

    channel: Channel = "beauty"
    """What is shown: the lit picture (beauty), ambient occlusion (ao), shading normals (normal), base
    colours (albedo), bent normals, or the standard error of the bake (error, 0.02 is white)."""

    multi_bounce: bool = False
    """Whether light that bounces between surfaces brightens occluded places, by their colour."""

    ao: OcclusionChoice = "auto"
    """Where ambient occlusion comes from: baked takes what the asset holds (_AO or occlusion textures), bake
    bakes it at the vertices for this picture, none leaves it out; auto takes what the asset holds, else
    bakes."""

    exposure: float = 0.0
    """Stops to brighten the picture by."""

    tone: Tone = "plain"
    """From light to display: plain cuts off what is too bright, filmic compresses it."""

    background: str = "gradient"
    """Behind the asset: gradient, transparent, or a colour such as #ffffff."""

    def __post_init__(self) -> None:
        _check_picture(self)
        _check_light(self)
        check_choice("channel", self.channel, get_args(Channel))
        check_choice("tone", self.tone, get_args(Tone))
        check_choice("ao", self.ao, get_args(OcclusionChoice))
        for name in ("no_shadows", "multi_bounce"):
            check_flag(name, getattr(self, name))
        if self.background not in get_args(Background) and not HEX_COLOR.fullmatch(
            str(self.background)
        ):
            raise SettingsError(
                f"background is {self.background!r}; gradient, transparent or a colour such as #ffffff is needed."
            )


def _check_picture(settings: RenderSettings) -> None:
    size = re.fullmatch(r"(\d{1,9})x(\d{1,9})", str(settings.size))
    if size is None or not all(1 <= int(n) <= MOST_PIXELS_PER_SIDE for n in size.groups()):
        raise SettingsError(
            f"size is {settings.size!r}; width x height in pixels is needed, such as 1280x720, "
            f"each from 1 to {MOST_PIXELS_PER_SIDE}."
        )
    check_whole("samples", settings.samples, 1, LARGEST_SAMPLES)
    if settings.view is not None:
        _, elevation = numbers_of("view", settings.view)
        if not -90.0 <= elevation <= 90.0:
            raise SettingsError(
                f"view is {settings.view!r}; an elevation from -90 to 90 is needed."
            )
    check_between("fov", settings.fov, 1.0, 170.0)
    if settings.up is not None:
        check_choice("up", settings.up, get_args(GroundAxis))
    if not str(settings.camera):
        raise SettingsError("camera is ''; auto, frame, a name or a number is needed.")


def _check_light(settings: RenderSettings) -> None:
    check_choice("lights", settings.lights, get_args(Lights))
    check_between("key", settings.key, 0.0, 1e6)
    check_between("ambient", settings.ambient, 0.0, 1e6)
    check_between("exposure", settings.exposure, -32.0, 32.0)
    if settings.ks is not None:
        check_between("ks", settings.ks, 0.0, 1.0)


def numbers_of(name: str, text: str) -> tuple[float, float]:
    """Two finite numbers from text such as '30,20'. Raises SettingsError, which begins with the name."""
    try:
        first, second = (float(part) for part in str(text).split(","))
    except ValueError:
        first = second = math.nan
    if not (math.isfinite(first) and math.isfinite(second)):
        raise SettingsError(f"{name} is {text!r}; two numbers are needed, such as 30,20.")
    return first, second


def size_of(settings: RenderSettings) -> tuple[int, int]:
    """Width and height in pixels."""
    width, height = (int(number) for number in settings.size.split("x"))
    return width, height


def color_of(text: str) -> tuple[float, float, float]:
    """Red, green and blue in [0, 1], as displays take them, of a colour such as #ff8000."""
    red, green, blue = (int(text[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue

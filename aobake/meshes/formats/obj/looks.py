"""Materials from the statements of material libraries, as far as a preview needs them.

Source: Wavefront, MTL Material Format, appendix B5; Pr, Pm and norm as in the PBR extension of 2014 (Exocortex).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from aobake.meshes.formats.obj.geometry import Geometry
from aobake.meshes.formats.obj.materials import Statement, texture_bytes
from aobake.meshes.scene import FloatArray, Image, Material, Texture

__all__ = ["Looks", "looks_of"]

Definition = dict[str, Statement]
Color = tuple[float, float, float]
WHITE: Color = (1.0, 1.0, 1.0)
BLACK: Color = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Looks:
    """Materials that an OBJ file uses and its libraries define, with their images.

    only : the number of the one that all of its faces use; None where they use several, or none
    """

    materials: tuple[Material, ...]
    images: tuple[Image, ...]
    only: int | None


@dataclass
class _Pictures:
    """Images named so far, each once."""

    path: Path
    root: Path | None
    images: list[Image] = field(default_factory=list)
    known: dict[str, int] = field(default_factory=dict)

    def number(self, name: str) -> int:
        if name not in self.known:
            self.known[name] = len(self.images)
            data = partial(texture_bytes, self.path, name, self.root)
            self.images.append(Image(name=f"{self.path}: texture {name}", data=data))
        return self.known[name]


def looks_of(
    path: Path, root: Path | None, statements: Sequence[Statement], geometry: Geometry
) -> Looks:
    """The materials that the faces of an OBJ file use.

    path, root : the file, and the folder that textures may lie in
    statements : of its material libraries
    Numbers that cannot be read are passed over, as viewers do.
    """
    definitions = _definitions(statements)
    used = _used(geometry)
    names = [name for name in used if name in definitions]
    pictures = _Pictures(path, root)
    materials = tuple(_material(name, definitions[name], pictures) for name in names)
    only = 0 if len(used) == len(names) == 1 else None
    return Looks(materials, tuple(pictures.images), only)


def _used(geometry: Geometry) -> list[str]:
    """Names of the materials of the faces, in the order of the file; '' for those before any usemtl."""
    starts = np.array([place for place, _ in geometry.uses], np.int64)
    held = np.unique(np.searchsorted(starts, geometry.places[geometry.sizes > 2]))
    names = ["", *(_text(name) for _, name in geometry.uses)]
    return list(dict.fromkeys(names[number] for number in held.tolist()))


def _text(name: bytes) -> str:
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("latin-1")


def _definitions(statements: Sequence[Statement]) -> dict[str, Definition]:
    """name -> keyword -> its statement; the last one of a keyword counts."""
    found: dict[str, Definition] = {}
    current: Definition = {}
    for statement in statements:
        if statement.keyword == "newmtl":
            current = found.setdefault(statement.rest, {})
        else:
            current[statement.keyword] = statement
    return found


def _material(name: str, given: Definition, pictures: _Pictures) -> Material:
    color, glow = _texture(given, "map_kd", pictures), _texture(given, "map_ke", pictures)
    # Several exporters write a black Kd beside map_Kd, and mean the map alone.
    diffuse = _color(given, "kd", WHITE)
    red, green, blue = WHITE if color is not None and diffuse == BLACK else diffuse
    opacity = _opacity(given)
    return Material(
        name=name,
        base_color=(red, green, blue, opacity),
        metallic=_number(given, "pm", 0.0),
        roughness=_number(given, "pr", _roughness(_number(given, "ns", 0.0))),
        emissive=_color(given, "ke", BLACK if glow is None else WHITE),
        alpha_mode="BLEND" if opacity < 1.0 else "MASK" if _is_cut_out(given) else "OPAQUE",
        base_color_texture=color,
        emissive_texture=glow,
        normal_texture=_texture(given, "norm", pictures),
        occlusion_texture=_texture(given, "map_ao", pictures),
    )


def _roughness(exponent: float) -> float:
    """That of glTF, the root of Beckmann's, which is (2 / (Ns + 2))^(1/2): Walter et al. 2007, section 5.2."""
    return float((2.0 / (max(exponent, 0.0) + 2.0)) ** 0.25)


def _opacity(given: Definition) -> float:
    """d, else 1 - Tr; a Tr of 1 alone is what some exporters write for opaque."""
    transparency = _number(given, "tr", 0.0)
    other = 1.0 - transparency if 0.0 < transparency < 1.0 else 1.0
    return min(max(_number(given, "d", other), 0.0), 1.0)


def _is_cut_out(given: Definition) -> bool:
    """Whether the alpha of map_Kd cuts the surface: it is its map_d as well."""
    color, mask = given.get("map_kd"), given.get("map_d")
    return color is not None and mask is not None and color.rest == mask.rest


def _texture(given: Definition, keyword: str, pictures: _Pictures) -> Texture | None:
    statement = given.get(keyword)
    if statement is None or not statement.rest:
        return None
    options = dict(statement.options)
    clamped = [word.lower() for word in options.get(b"-clamp", ())] == [b"on"]
    return Texture(
        image=pictures.number(statement.rest),
        transform=_transform(options),
        wrap=("clamp", "clamp") if clamped else ("repeat", "repeat"),
    )


def _transform(options: Mapping[bytes, tuple[bytes, ...]]) -> FloatArray | None:
    """(2, 3) of -s and -o, which are for a v that runs up; None where they change nothing."""
    across, up = _pair(options.get(b"-s", ()), 1.0)
    x, y = _pair(options.get(b"-o", ()), 0.0)
    if (across, up, x, y) == (1.0, 1.0, 0.0, 0.0):
        return None
    return np.array([[across, 0.0, x], [0.0, up, 1.0 - up - y]])


def _pair(words: Sequence[bytes], default: float) -> tuple[float, float]:
    values = [*map(float, words), default, default]
    if not all(map(math.isfinite, values)):
        return default, default
    return values[0], values[1]


def _color(given: Definition, keyword: str, default: Color) -> Color:
    values = _numbers(given, keyword)
    if not values:
        return default
    red, green, blue = values[:3] if len(values) >= 3 else values[:1] * 3
    return red, green, blue


def _number(given: Definition, keyword: str, default: float) -> float:
    return next(iter(_numbers(given, keyword)), default)


def _numbers(given: Definition, keyword: str) -> list[float]:
    """The finite numbers that a statement begins with; none where it is missing."""
    found = []
    for word in given[keyword].rest.split() if keyword in given else []:
        try:
            value = float(word)
        except ValueError:
            break
        if not math.isfinite(value):
            break
        found.append(value)
    return found

"""What alpha makes of a scene's faces: which are whole, which have holes, which are not there at all.

Only materials with the mode MASK or BLEND are looked at, and of these only what their faces cover of the
texture, at its own resolution: a mask without a hole costs nothing.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aobake.errors import InputError
from aobake.meshes.scene import AlphaMode, FloatArray, Material, Mesh, Scene, Texture, Wrap
from aobake.meshes.texel_counts import marked_share, pixels_around
from aobake.tracing.cutouts import CUTOFF_SLACK, CutOut

__all__ = [
    "GONE",
    "HOLED",
    "NO_ALPHA",
    "WHOLE",
    "AlphaUse",
    "MeshAlpha",
    "SceneAlpha",
    "alpha_of",
    "scene_alpha",
]

Bytes = NDArray[np.uint8]
T = TypeVar("T")

WHOLE, HOLED, GONE = 0, 1, 2  # kinds of faces
FULL = 0.998  # shares of light this close to all and to nothing are that: half a step of 8 bits
SLACK_PX = 1 / 64  # what rounding may move a place in a texture by
OPAQUE: Bytes = np.full((1, 1), 255, np.uint8)


@dataclass(frozen=True)
class AlphaUse:
    """What the alpha of one material comes to.

    material : index into the scene's materials
    on : whether any ray has to be let through
    share_transparent : of the light that falls on its faces, by the texels that they cover, is let through
    reason : one sentence that names the material
    """

    material: int
    mode: AlphaMode
    on: bool
    share_transparent: float
    reason: str


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshAlpha:
    """The alpha of one mesh.

    kinds : (F,) uint8, WHOLE, HOLED or GONE
    places : (F, 3, 2) float64, for each corner of each face the column and the row of its place in the image,
        in pixels from its left and its top edge
    factors : (F, 3) float64, what alpha is multiplied by at the corners
    alpha : (H, W) uint8, the image's
    texture : how it is looked up; None: there is none, and `alpha` is a single opaque pixel
    cutoff : alpha below which nothing is there; None: it is a share
    """

    kinds: NDArray[np.uint8]
    places: FloatArray
    factors: FloatArray
    alpha: Bytes
    texture: Texture | None
    cutoff: float | None

    def cutout(
        self, faces: NDArray[np.int64], order: NDArray[np.int64], *, one_sided: bool
    ) -> CutOut:
        """What a ray that hits some of the faces needs to know.

        faces : (N,) which; order : (N, 3) which corner of the mesh's face is which of theirs
        """
        rows = faces[:, None]
        corners = np.empty((len(faces), 3, 3), np.float32)
        corners[..., :2] = self.places[rows, order] - 0.5
        corners[..., 2] = self.factors[rows, order]
        return CutOut(
            corners=corners,
            alpha=self.alpha,
            edges=_wrap(self.texture),
            nearest=self.texture is not None and self.texture.nearest,
            cutoff=self.cutoff,
            one_sided=one_sided,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneAlpha:
    """uses : of each material with alpha; meshes : by number, those with a face that is not whole."""

    uses: tuple[AlphaUse, ...]
    meshes: Mapping[int, MeshAlpha]
    warnings: tuple[str, ...]


NO_ALPHA = SceneAlpha(uses=(), meshes={}, warnings=())


def alpha_of(scene: Scene) -> tuple[AlphaUse, ...]:
    """What the alpha of each material that is not opaque comes to, in the order of materials."""
    return scene_alpha(scene).uses


def scene_alpha(scene: Scene) -> SceneAlpha:
    """Look at the alpha of all materials; never fails.

    What is missing or broken counts as opaque, and `warnings` says so. A scene is looked at once.
    """
    if scene not in _KNOWN:
        _KNOWN[scene] = _looked_at(scene)
    return _KNOWN[scene]


# A plan and a bake both ask, and decoding images takes longer than all the rest.
_KNOWN: weakref.WeakKeyDictionary[Scene, SceneAlpha] = weakref.WeakKeyDictionary()


def _looked_at(scene: Scene) -> SceneAlpha:
    uses, meshes, warnings = [], dict[int, MeshAlpha](), list[str]()
    channel = cache(partial(_alpha_channel, scene))  # an atlas may be that of many materials
    for number, material in enumerate(scene.materials):
        if material.alpha_mode == "OPAQUE":
            continue
        noted = _Noted(f"material {material.name or number!r}", warnings)
        image = noted(partial(_alpha_image, channel, material))
        found = [
            (k, _mesh_alpha(mesh, material, image, noted))
            for k, mesh in enumerate(scene.meshes)
            if mesh.material == number and len(mesh.faces)
        ]
        uses.append(_use(number, material, [looked for _, looked in found], noted))
        meshes.update((k, looked.alpha) for k, looked in found if looked.alpha.kinds.any())
    return SceneAlpha(uses=tuple(uses), meshes=meshes, warnings=tuple(warnings))


class _Noted:
    """Reads what may be broken: then None comes of it, and a warning that names the material."""

    def __init__(self, who: str, warnings: list[str]) -> None:
        self.who, self.broken = who, False
        self._warnings = warnings

    def __call__(self, read: Callable[[], T]) -> T | None:
        try:
            return read()
        except InputError as error:
            self.broken = True
            line = f"{self.who}: a part of its alpha counts as opaque: {error}"
            if line not in self._warnings:
                self._warnings.append(line)
            return None


@dataclass(frozen=True, eq=False)
class _Looked:
    """The alpha of a mesh, and (F,) the share of light that each face lets through."""

    alpha: MeshAlpha
    through: FloatArray


def _alpha_image(channel: Callable[[int], Bytes | None], material: Material) -> Bytes | None:
    """(H, W) the alpha of a material's texture; None where that has none. Raises InputError."""
    texture = material.base_color_texture
    return None if texture is None else channel(texture.image)


def _alpha_channel(scene: Scene, number: int) -> Bytes | None:
    """(H, W) the alpha of an image; None where it has none. Raises InputError."""
    if not 0 <= number < len(scene.images):
        raise InputError(f"image {number} is not there; there are {len(scene.images)}.")
    from aobake.images import decode  # loads OpenImageIO

    image = scene.images[number]
    pixels = decode(image.data(), image.name)
    if pixels.shape[2] not in {2, 4}:
        return None
    return np.ascontiguousarray(np.round(np.clip(pixels[..., -1], 0.0, 1.0) * 255.0), np.uint8)


def _mesh_alpha(mesh: Mesh, material: Material, image: Bytes | None, noted: _Noted) -> _Looked:
    texture = None if image is None else material.base_color_texture
    uv = None if texture is None else noted(partial(_coordinates, mesh, texture))
    if image is None or texture is None or uv is None:
        image, texture, places = OPAQUE, None, np.full((len(mesh.faces), 3, 2), 0.5)
    else:
        places = _places(uv, image, texture)
    colors = noted(partial(mesh.at_corners, "COLOR_0"))
    factors = np.full((len(mesh.faces), 3), float(material.base_color[3]))
    if colors is not None and colors.shape[2] == 4:
        factors *= np.nan_to_num(colors[..., 3], nan=1.0)
    alpha = MeshAlpha(
        kinds=np.zeros(len(mesh.faces), np.uint8),
        places=places,
        factors=factors,
        alpha=image,
        texture=texture,
        cutoff=material.alpha_cutoff if material.alpha_mode == "MASK" else None,
    )
    return _Looked(alpha, _tell_kinds(alpha))


def _coordinates(mesh: Mesh, texture: Texture) -> FloatArray:
    """(F, 3, 2) where a texture is looked up, in units of the image. Raises InputError where that is not said."""
    name = f"TEXCOORD_{texture.uv_set}"
    uv = mesh.at_corners(name)
    if uv is None or uv.shape[2] < 2:
        raise InputError(f"mesh {mesh.name!r} has no {name}, which it is looked up with.")
    uv = np.where(np.isfinite(uv[..., :2]), uv[..., :2], 0.0)
    if texture.transform is not None:
        uv = uv @ texture.transform[:, :2].T + texture.transform[:, 2]
    return uv


def _places(uv: FloatArray, image: Bytes, texture: Texture) -> FloatArray:
    """(F, 3, 2) in pixels, each face moved by whole periods to where float32 is fine."""
    for axis, wrap in enumerate(texture.wrap):
        if wrap != "clamp":
            period = 1.0 if wrap == "repeat" else 2.0
            least = uv[..., axis].min(axis=1, initial=np.inf, keepdims=True)
            uv[..., axis] -= period * np.floor(least / period)
    height, width = image.shape
    return uv * (width, height)


def _tell_kinds(found: MeshAlpha) -> FloatArray:
    """Fill in the kinds of faces; (F,) the share of light that each lets through.

    Where factors differ over the mesh, its faces are judged by the extremes: more of them than need be
    are then called holed, and none is called whole that is not.
    """
    least, most = float(found.factors.min()), float(found.factors.max())
    value = np.arange(256) / 255.0
    if found.cutoff is None:
        stops, passes = value * least >= FULL, value * most <= 1.0 - FULL
    else:
        cutoff = found.cutoff - CUTOFF_SLACK
        stops, passes = value * least >= cutoff, value * most < cutoff
    nearest = found.texture is not None and found.texture.nearest
    boxes = pixels_around(found.places, SLACK_PX, nearest=nearest)
    wrap = _wrap(found.texture)
    passed = marked_share(passes[found.alpha], boxes, wrap)
    stopped = marked_share(stops[found.alpha], boxes, wrap)
    found.kinds[stopped < 1.0] = HOLED
    found.kinds[passed == 1.0] = GONE
    if found.cutoff is not None:
        return passed
    mean = float(found.alpha.mean()) / 255.0
    return np.where(
        found.kinds == HOLED, 1.0 - np.clip(mean * found.factors.mean(axis=1), 0.0, 1.0), passed
    )


def _use(number: int, material: Material, found: Sequence[_Looked], noted: _Noted) -> AlphaUse:
    """What the alpha of a material comes to, from that of its meshes."""
    through = np.concatenate([looked.through for looked in found]) if found else np.zeros(0)
    on = any(looked.alpha.kinds.any() for looked in found)
    share = float(through.mean()) if len(through) else 0.0
    mode = material.alpha_mode
    what = f"{noted.who} is {mode}"
    if not len(through):
        reason = f"{what}, but no face is made of it."
    elif on and mode == "MASK":
        reason = f"{what} with {_percent(share)} transparent texels."
    elif on:
        reason = f"{what} and lets {_percent(share)} of the light through."
    elif noted.broken:
        reason = f"{what}, but its alpha texture cannot be used, so it is opaque."
    elif mode == "MASK":
        reason = (
            f"{what}, but none of its faces has a texel below the cutoff {material.alpha_cutoff:g}."
        )
    else:
        reason = f"{what}, but nothing of it is transparent."
    return AlphaUse(material=number, mode=mode, on=on, share_transparent=share, reason=reason)


def _percent(share: float) -> str:
    return "less than 1%" if share < 0.005 else f"{share:.0%}"


def _wrap(texture: Texture | None) -> tuple[Wrap, Wrap]:
    return ("repeat", "repeat") if texture is None else texture.wrap

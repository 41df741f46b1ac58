"""What surfaces are made of: materials, their textures, and the images that these look up."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from aobake.meshes.arrays import FloatArray

__all__ = ["AlphaMode", "Image", "Material", "Texture", "Wrap"]

AlphaMode = Literal["OPAQUE", "MASK", "BLEND"]
Wrap = Literal["repeat", "mirror", "clamp"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Image:
    """An image of an asset, still encoded as PNG, JPEG, ...

    name : what a user would call it, for messages
    data : gives its bytes; raises InputError where they are missing, broken or elsewhere
    """

    name: str
    data: Callable[[], bytes]


@dataclass(frozen=True, eq=False, kw_only=True)
class Texture:
    """An image as a material looks it up.

    image : index into the scene's images; an image may be stored in a way that nothing here can decode
    uv_set : the n of TEXCOORD_n
    transform : (2, 3) float64 that maps (u, v, 1) to where the image is looked up; None: there itself
    wrap : what lies outside of the unit square, along u and along v
    nearest : whether texels are looked up unfiltered
    """

    image: int
    uv_set: int = 0
    transform: FloatArray | None = None
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    nearest: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Material:
    """What a mesh is made of, as far as occlusion and a preview need it.

    base_color, emissive : linear; base_color_texture and emissive_texture are stored as sRGB and multiply
        them, and metallic_roughness_texture (roughness in G, metalness in B) multiplies its two
    normal_scale, occlusion_strength : as glTF defines them
    extras : what applications have noted there, by their keys
    """

    name: str = ""
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    metallic: float = 0.0
    roughness: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    double_sided: bool = False
    alpha_mode: AlphaMode = "OPAQUE"
    alpha_cutoff: float = 0.5
    base_color_texture: Texture | None = None
    metallic_roughness_texture: Texture | None = None
    emissive_texture: Texture | None = None
    normal_texture: Texture | None = None
    normal_scale: float = 1.0
    occlusion_texture: Texture | None = None
    occlusion_strength: float = 1.0
    extras: Mapping[str, object] = field(default_factory=dict)

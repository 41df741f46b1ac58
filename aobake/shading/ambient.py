"""What ambient occlusion does to the ambient term."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["multi_bounce", "specular_occlusion"]

Float32Array = NDArray[np.float32]


def multi_bounce(ao: Float32Array, albedo: Float32Array) -> Float32Array:
    """Ambient occlusion brightened by the light that the surfaces around reflect, each colour by itself.

    ao : (N,) float32 in [0, 1]; albedo : (3, N) float32 in [0, 1], also of what is around
    Returns (3, N) float32 in [ao, 1]; 1 where ao is 1.
    Source: J. Jimenez, X. Wu, A. Pesce, A. Jarabo, Practical real-time strategies for accurate indirect
    occlusion, SIGGRAPH 2016, equation 9 (a cubic in the visibility, fitted to path tracing).
    """
    a = np.float32(2.0404) * albedo - np.float32(0.3324)
    b = np.float32(-4.7951) * albedo + np.float32(0.6417)
    c = np.float32(2.7552) * albedo + np.float32(0.6903)
    return np.asarray(np.clip(((ao * a + b) * ao + c) * ao, ao, np.float32(1.0)))


def specular_occlusion(ao: Float32Array, cos_view: Float32Array, roughness: float) -> Float32Array:
    """Share of the ambient light that the specular lobe gets, from ambient occlusion.

    ao, cos_view : (N,) float32 in [0, 1]; roughness : in [0, 1], glTF's perceptual one
    Returns (N,) float32 in [0, 1]; 1 where ao is 1.
    Source: S. Lagarde, C. de Rousiers, Moving Frostbite to PBR, SIGGRAPH 2014, listing 26.
    """
    sharpness = np.exp2(np.float32(-16.0) * np.float32(roughness) - np.float32(1.0))
    share = (cos_view + ao) ** sharpness - np.float32(1.0) + ao
    return np.asarray(np.clip(share, 0.0, 1.0))

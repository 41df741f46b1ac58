"""How much light a smooth boundary reflects: Fresnel's equations, and Schlick's short form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.shading.parameters import EXTINCTION, F0, IOR
from aobake.shading.vectors import Floats, as_floats

__all__ = [
    "fresnel",
    "fresnel_conductor",
    "fresnel_dielectric",
    "fresnel_schlick",
    "normal_reflectance",
]

LEAST_NORM = 1e-18  # |c + g|^2 is at least |ior^2 - 1|, 2e-16 where that is not 0


def fresnel_dielectric(cos_theta: ArrayLike, ior: ArrayLike) -> Floats:
    """F of unpolarised light, exact; 1 under total internal reflection.

    cos_theta : (...,) cosine between the light and the normal of the boundary, taken within [0, 1]
    ior : index of refraction of the far side over the near one, 0.001 to 100, one number or (...,)
    Returns (...,) in [0, 1], float32 for a float32 array, else float64. Raises SettingsError for another ior.
    Source: A. Fresnel, 1823; R. L. Cook, K. E. Torrance, ACM TOG 1(1), 1982 (the form with g and c).

    With g^2 = ior^2 - 1 + c^2 the amplitudes (c - g)/(c + g) and (ior^2 c - g)/(ior^2 c + g) are written
    without their differences, which keeps all digits near ior = 1:

        s = -(ior^2 - 1)/(c + g)^2    p = (ior^2 - 1)((ior^2 + 1) c^2 - 1)/(ior^2 c + g)^2
    """
    cosine = _cosine(cos_theta)
    exact = IOR.checked(ior, cosine.shape)
    contrast = ((exact - 1.0) * (exact + 1.0)).astype(cosine.dtype)
    square = (exact * exact).astype(cosine.dtype)
    c2 = cosine * cosine
    g2 = contrast + c2
    passes = g2 > 0.0
    g = np.sqrt(np.where(passes, g2, cosine.dtype.type(1.0)))
    s = contrast / np.square(cosine + g)
    p = contrast * ((square + 1.0) * c2 - 1.0) / np.square(square * cosine + g)
    reflected = np.minimum(0.5 * (s * s + p * p), 1.0)
    total = np.where(contrast == 0.0, cosine.dtype.type(0.0), cosine.dtype.type(1.0))
    return np.where(passes, reflected, total)


def fresnel_conductor(cos_theta: ArrayLike, ior: ArrayLike, extinction: ArrayLike) -> Floats:
    """F of unpolarised light at a metal of the complex index ior + i extinction, exact.

    cos_theta : (...,) cosine between the light and the normal of the boundary, taken within [0, 1]
    ior : 0.001 to 100; extinction: 0 to 100; one number each or (...,)
    Returns (...,) in [0, 1], float32 for a float32 array, else float64.
    Raises SettingsError for an index out of range.
    Source: M. Born, E. Wolf, Principles of Optics, 14.2: the dielectric's amplitudes with a complex index.
    """
    cosine = _cosine(cos_theta)
    k = EXTINCTION.checked(extinction, cosine.shape)
    index = IOR.checked(ior, cosine.shape) + 1j * k
    contrast, square = (index - 1.0) * (index + 1.0), index * index
    strength = np.square(np.abs(contrast)).astype(cosine.dtype)
    square_real, square_imag = square.real.astype(cosine.dtype), square.imag.astype(cosine.dtype)
    c2 = cosine * cosine
    g_real, g_imag = _root(contrast.real.astype(cosine.dtype) + c2, square_imag)
    s = _norm(cosine + g_real, g_imag)
    p = _norm(square_real * cosine + g_real, square_imag * cosine + g_imag)
    brewster = _norm((square_real + 1.0) * c2 - 1.0, square_imag * c2)
    # equal media: nothing over nothing, which is nothing
    s, p = np.maximum(s, LEAST_NORM), np.maximum(p, LEAST_NORM)
    return np.minimum(0.5 * strength * (1.0 / (s * s) + brewster / (p * p)), 1.0)


def fresnel_schlick(cos_theta: ArrayLike, f0: ArrayLike) -> Floats:
    """F = f0 + (1 - f0)(1 - cos theta)^5, close to the exact form at a third of its cost.

    cos_theta : (...,) cosine between light (or view) and the facet's normal h, not n; taken within [0, 1]
    f0 : reflectance at a right angle, 0 to 1, one number or (...,)
    Returns (...,) in [0, 1], float32 for a float32 array, else float64. Raises SettingsError for another f0.
    Source: C. Schlick, An inexpensive BRDF model for physically-based rendering, 1994, equation 15.
    """
    cosine = _cosine(cos_theta)
    base = F0.checked(f0, cosine.shape)
    rest = 1.0 - cosine
    rest2 = rest * rest
    reflected: Floats = base.astype(cosine.dtype) + (1.0 - base).astype(cosine.dtype) * (
        rest2 * rest2 * rest
    )
    return reflected


def normal_reflectance(ior: ArrayLike, extinction: ArrayLike = 0.0) -> NDArray[np.float64]:
    """F at a right angle, ((ior - 1)^2 + k^2)/((ior + 1)^2 + k^2): the f0 of Schlick's form.

    Returns float64 of the arguments' shape. Raises SettingsError for an index out of range.
    """
    eta, k = IOR.checked(ior), EXTINCTION.checked(extinction)
    return np.asarray(((eta - 1.0) ** 2 + k * k) / ((eta + 1.0) ** 2 + k * k))


def fresnel(cos_theta: Floats, ior: ArrayLike, extinction: ArrayLike = 0.0) -> Floats:
    """The exact F of a dielectric, or of a metal where any extinction is above 0."""
    if EXTINCTION.checked(extinction, cos_theta.shape).any():
        return fresnel_conductor(cos_theta, ior, extinction)
    return fresnel_dielectric(cos_theta, ior)


def _root(real: Floats, imag: Floats) -> tuple[Floats, Floats]:
    """The square root of real + i imag, imag >= 0. With complex arrays, all took 3.5 times as long."""
    larger = np.sqrt(0.5 * (np.hypot(real, imag) + np.abs(real)))
    smaller = 0.5 * imag / np.maximum(larger, np.finfo(larger.dtype).tiny)
    forward = real > 0.0
    return np.where(forward, larger, smaller), np.where(forward, smaller, larger)


def _norm(real: Floats, imag: Floats) -> Floats:
    """|real + i imag|^2."""
    return real * real + imag * imag


def _cosine(value: ArrayLike) -> Floats:
    (cosine,) = as_floats("a cosine", value)
    return np.clip(cosine, 0.0, 1.0)

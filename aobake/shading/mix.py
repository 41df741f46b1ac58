"""A diffuse and a specular lobe in shares that add up to 1."""

from __future__ import annotations

from numpy.typing import ArrayLike

from aobake.shading.parameters import KS
from aobake.shading.vectors import Floats, as_floats

__all__ = ["mixed"]


def mixed(diffuse: ArrayLike, specular: ArrayLike, ks: ArrayLike) -> Floats:
    """kd diffuse + ks specular with kd = 1 - ks, so that two lobes that add no light add none together.

    diffuse, specular : values of two models, which broadcast
    ks : share of the specular one, 0 to 1, one number or an array that broadcasts
    Returns their mean, float32 for float32 arrays, else float64. Raises SettingsError for another ks.
    """
    d, s = as_floats("a reflectance", diffuse, specular)
    share = KS.checked(ks)
    return (1.0 - share).astype(d.dtype) * d + share.astype(d.dtype) * s

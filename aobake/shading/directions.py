"""Normal, light and view at a point, and the angles between them that models ask for.

Vectors are taken as they come: none is made unit length, since a division would round what was exact.
Cosines are held within (0, 1], so that a normal that rounding made a little too long does no harm, and
the angle between normal and half vector is found in a way that does not depend on their lengths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.errors import InputError
from aobake.shading.vectors import Floats, Vector, as_floats, as_vector, cross, dot, plus

__all__ = ["Directions", "Halfway", "directions", "halfway", "where_seen"]

STEEPEST = (
    1e14  # largest tan^2 of a facet; a float32 can hold its square, and no lobe reaches there
)


@dataclass(frozen=True)
class Directions:
    """Unit vectors; the cosines n.l and n.v; where both are above the horizon; all (...,)."""

    normal: Vector
    light: Vector
    view: Vector
    nl: Floats
    nv: Floats
    seen: NDArray[np.bool_]

    @property
    def low(self) -> Floats:
        """The smaller of the two cosines."""
        return np.minimum(self.nl, self.nv)

    @property
    def high(self) -> Floats:
        """The larger of the two cosines."""
        return np.maximum(self.nl, self.nv)

    def cast(self, constant: NDArray[np.float64]) -> Floats:
        """A constant that was computed in float64, in the type of the directions."""
        return constant.astype(self.nl.dtype)


@dataclass(frozen=True)
class Halfway:
    """The half vector h = (l + v) / |l + v|, as a facet sees it; all (...,).

    length2 : |l + v|^2, not less than rounding leaves of it
    tan2 : tan^2 of the angle between n and h, up to 1/eps^2: a smaller cosine is rounding
    seen : where the point is seen and lit, and h is defined
    """

    length2: Floats
    tan2: Floats
    seen: NDArray[np.bool_]

    @property
    def vh(self) -> Floats:
        """v.h = l.h = |l + v| / 2, up to 1: twice as many digits as the product has near v = -l."""
        return np.minimum(0.5 * np.sqrt(self.length2), 1.0)


def directions(normal: ArrayLike, light: ArrayLike, view: ArrayLike) -> Directions:
    """Check three (..., 3) arrays of unit vectors that broadcast against each other.

    float32 arrays stay float32, everything else becomes float64.
    Raises InputError for other shapes, and for what is not real numbers.
    """
    arrays = as_floats("a direction", normal, light, view)
    names = ("normal", "light", "view")
    n, wi, wo = (as_vector(name, array) for name, array in zip(names, arrays, strict=True))
    try:
        np.broadcast_shapes(*(array.shape for array in arrays))
    except ValueError:
        found = zip(names, arrays, strict=True)
        shapes = ", ".join(f"{name} {array.shape}" for name, array in found)
        raise InputError(f"The shapes do not fit together: {shapes}.") from None
    nl, nv = dot(n, wi), dot(n, wo)
    tiny = np.finfo(arrays[0].dtype).tiny
    seen = np.asarray((nl > 0.0) & (nv > 0.0))
    return Directions(n, wi, wo, np.clip(nl, tiny, 1.0), np.clip(nv, tiny, 1.0), seen)


def halfway(at: Directions) -> Halfway:
    """The half vector's angles, with the digits that 1 - n.h would have lost: tan = |n x s| / n.s.

    Where v = -l to within rounding there is no half vector, and the point counts as not seen.
    """
    s = plus(at.light, at.view)
    along, across = dot(at.normal, s), cross(at.normal, s)
    length2 = dot(s, s)
    eps2 = float(np.finfo(length2.dtype).eps) ** 2
    known = np.maximum(length2, 16.0 * eps2)
    tan2 = dot(across, across) / np.maximum(along * along, known * eps2)
    return Halfway(known, np.minimum(tan2, 1.0 / eps2), at.seen & (length2 >= 16.0 * eps2))


def where_seen(seen: NDArray[np.bool_], value: Floats) -> Floats:
    """The value where light and view are above the horizon, and 0 elsewhere."""
    return np.where(seen, value, value.dtype.type(0.0))

"""What the models are adjusted by: names, ranges, defaults and help, in one place for code and command line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aobake.errors import SettingsError

__all__ = [
    "ALBEDO",
    "EXPONENT",
    "EXTINCTION",
    "F0",
    "FACET_C",
    "IOR",
    "KS",
    "MINNAERT_K",
    "ROUGHNESS",
    "SIGMA",
    "UNIT_ROUGHNESS",
    "Parameter",
]


@dataclass(frozen=True)
class Parameter:
    """A number that a model asks for, from `least` to `most`."""

    name: str
    default: float
    least: float
    most: float
    help: str

    def checked(self, value: ArrayLike, shape: tuple[int, ...] = ()) -> NDArray[np.float64]:
        """The value in float64: one number, or an array that broadcasts against `shape`.

        Raises SettingsError for what is not a number, out of range, or does not fit.
        """
        given = np.asarray(value)
        if given.dtype.kind not in "iuf":
            raise SettingsError(f"{self.name} is {value!r}; a number {self._range} is needed.")
        numbers = given.astype(np.float64)
        wrong = ~((numbers >= self.least) & (numbers <= self.most))  # NaN is wrong as well
        if wrong.any():
            found = float(numbers[wrong].flat[0])
            raise SettingsError(f"{self.name} is {found!r}; a number {self._range} is needed.")
        try:
            np.broadcast_shapes(shape, numbers.shape)
        except ValueError:
            raise SettingsError(
                f"{self.name} has the shape {numbers.shape}, the directions have {shape}; "
                "one number, or one for each is needed."
            ) from None
        return numbers

    @property
    def _range(self) -> str:
        return f"from {self.least:g} to {self.most:g}"


ALBEDO = Parameter("albedo", 1.0, 0.0, 1.0, "Share of the light that a facet gives back.")
EXPONENT = Parameter("exponent", 32.0, 0.0, 1e6, "Power of the cosine: the larger, the sharper.")
EXTINCTION = Parameter(
    "extinction",
    0.0,
    0.0,
    100.0,
    "Imaginary part k of a metal's index of refraction; 0: not a metal.",
)
F0 = Parameter("f0", 0.04, 0.0, 1.0, "Reflectance of light that falls in at a right angle.")
FACET_C = Parameter(
    "c",
    3.0,
    0.0,
    1e4,
    "Narrowness of the facet law exp(-(c angle)^2), in 1/radian: the larger, the smoother.",
)
IOR = Parameter(
    "ior", 1.5, 0.001, 100.0, "Index of refraction, of the inside over that of the outside."
)
KS = Parameter("ks", 0.2, 0.0, 1.0, "Share of the specular lobe; the diffuse one has the rest.")
MINNAERT_K = Parameter(
    "k",
    0.7,
    0.0,
    10.0,
    "Darkening of the limb: 1 is Lambert, 0.5 the full moon, above 1 the rim darkens.",
)
ROUGHNESS = Parameter(
    "roughness",
    0.3,
    0.0,
    10.0,
    "Root mean square slope m of the facets; below 1e-4 it counts as 1e-4.",
)
SIGMA = Parameter(  # up to pi/2, also where a float32 has rounded it up
    "sigma", 0.5, 0.0, 1.5708, "Standard deviation of the facets' slope angle, in radians."
)
UNIT_ROUGHNESS = Parameter("roughness", 0.5, 0.0, 1.0, "From 0, Lambert, to 1, the roughest.")

"""A sphere under one light for each model, at a few values of its parameter: two pictures of docs/models.md."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from figures import STYLE, save
from numpy.typing import NDArray

from aobake import shading
from aobake.shading import evaluate, model

FloatArray = NDArray[np.float64]
SIDE = 104  # pixels of a sphere
SAMPLES = 4  # per pixel along each axis
LIGHT = np.array([-0.55, 0.6, 0.58]) / np.linalg.norm([-0.55, 0.6, 0.58])
VIEW = np.array([0.0, 0.0, 1.0])
PAINT = np.array([0.03, 0.08, 0.18])  # under a clear lobe
CLAY = np.array([0.62, 0.60, 0.57])
PAINT_LIGHT, CLAY_LIGHT, METAL_LIGHT = 9.0, 3.4, 1.3  # so that each kind uses the range of a screen
# eta and k at 630, 532 and 465 nm: P. B. Johnson, R. W. Christy, 1972 (copper, silver, gold), 1974 (iron)
METALS = {
    "silver": ((0.06, 4.20), (0.05, 3.35), (0.05, 2.68)),
    "gold": ((0.17, 3.15), (0.53, 2.23), (1.36, 1.88)),
    "copper": ((0.24, 3.46), (1.12, 2.59), (1.17, 2.46)),
    "iron": ((2.87, 3.36), (2.95, 2.93), (2.62, 2.70)),
}
Shader = Callable[
    [FloatArray], FloatArray
]  # normals (N, 3) to reflected colour (N, 3), before the cosine


@dataclass(frozen=True)
class Row:
    """A model, and its spheres from left to right with what is written under them."""

    title: str
    spheres: tuple[tuple[str, Shader], ...]


def painted(name: str, ks: float, **values: float) -> Shader:
    """A specular lobe of the model over diffuse paint, kd + ks = 1."""

    def shade(normals: FloatArray) -> FloatArray:
        lobe = evaluate(model(name), normals, LIGHT, VIEW, values)[:, None]
        return np.asarray(PAINT_LIGHT * shading.mixed(PAINT / np.pi, lobe, ks))

    return shade


def clay(name: str, **values: float) -> Shader:
    """A diffuse model in the colour of clay."""
    return lambda normals: (
        CLAY_LIGHT * evaluate(model(name), normals, LIGHT, VIEW, values)[:, None] * CLAY
    )


def metal(name: str) -> Shader:
    """Cook and Torrance's model with the metal's complex index for red, green and blue."""
    eta, k = np.array(METALS[name]).T
    return lambda normals: np.asarray(
        METAL_LIGHT
        * shading.cook_torrance(normals[:, None, :], LIGHT, VIEW, 0.45, eta, extinction=k)
    )


def row(
    title: str, symbol: str, values: tuple[float, ...], shader: Callable[[float], Shader]
) -> Row:
    """Spheres of one model at several values of its parameter."""
    return Row(title, tuple((f"{symbol} = {value:g}", shader(value)) for value in values))


SIGMA = "\N{GREEK SMALL LETTER SIGMA}"
POWERS, WIDTHS, SLOPES = (4, 16, 64, 256), (2, 4, 8, 16), (0.6, 0.4, 0.2, 0.1)
ANGLES, KS, ROUGHNESSES = (0, 0.3, 0.6, 1.2), (0.5, 0.75, 1, 1.5), (0, 0.3, 0.6, 1)
SPECULAR = (
    row("Phong", "n", POWERS, lambda n: painted("phong", 0.08, exponent=n)),
    row("Blinn-Phong", "n", POWERS, lambda n: painted("blinn-phong", 0.08, exponent=n)),
    row("Torrance-Sparrow", "c", WIDTHS, lambda c: painted("torrance-sparrow", 0.5, c=c)),
    row("Cook-Torrance", "m", SLOPES, lambda m: painted("cook-torrance", 0.5, roughness=m)),
    Row("Cook-Torrance, metals", tuple((name, metal(name)) for name in METALS)),
)
DIFFUSE = (
    row("Oren-Nayar", SIGMA, ANGLES, lambda s: clay("oren-nayar", sigma=s)),
    row("Oren-Nayar, full", SIGMA, ANGLES, lambda s: clay("oren-nayar-full", sigma=s)),
    row("Oren-Nayar by Fujii", SIGMA, ANGLES, lambda s: clay("oren-nayar-fujii", sigma=s)),
    row("EON", "r", ROUGHNESSES, lambda r: clay("eon", roughness=r)),
    row("Minnaert", "k", KS, lambda k: clay("minnaert", k=k)),
)


def sphere(shade: Shader) -> FloatArray:
    """(SIDE, SIDE, 4) sRGB and coverage of an orthographic sphere."""
    at = (np.arange(SIDE * SAMPLES) + 0.5) * (2.04 / (SIDE * SAMPLES)) - 1.02
    x, y = np.meshgrid(at, -at)
    inside = x * x + y * y < 1.0
    normals = np.stack(
        [x[inside], y[inside], np.sqrt(1.0 - x[inside] ** 2 - y[inside] ** 2)], axis=-1
    )
    linear = np.zeros((*inside.shape, 4))
    linear[inside, :3] = shade(normals) * np.maximum(normals @ LIGHT, 0.0)[:, None]
    linear[..., :3] = np.minimum(linear[..., :3], 1.0)
    linear[inside, 3] = 1.0
    pixels = linear.reshape(SIDE, SAMPLES, SIDE, SAMPLES, 4).mean(axis=(1, 3))
    colour = pixels[..., :3] / np.maximum(pixels[..., 3:], 1e-9)
    encoded = np.where(colour < 0.0031308, 12.92 * colour, 1.055 * colour ** (1 / 2.4) - 0.055)
    return np.concatenate([encoded, pixels[..., 3:]], axis=-1)


def draw(path: Path, rows: tuple[Row, ...]) -> None:
    """Write a picture of some rows."""
    import matplotlib.pyplot as plt

    dots, gap, under, over = 110, 6, 17, 23
    high = SIDE + under + over
    size = (4 * (SIDE + gap), len(rows) * high)
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(size[0] / dots, size[1] / dots))
        for line, shown in enumerate(rows):
            top = size[1] - line * high
            figure.text(
                gap / 2 / size[0], (top - 5) / size[1], shown.title, va="top", weight="bold", size=9
            )
            for column, (label, shade) in enumerate(shown.spheres):
                x, y = gap / 2 + column * (SIDE + gap), top - over - SIDE
                figure.figimage(sphere(shade), x, y, origin="upper")
                middle = (x + SIDE / 2) / size[0], (y - 3) / size[1]
                figure.text(*middle, label, va="top", ha="center", size=7.5)
        save(figure, path, dots)
        plt.close(figure)

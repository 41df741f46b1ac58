"""The nine formulas that the lecture misprints, as printed and as they are: a picture of docs/models.md."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from figures import STYLE, save
from models import hemisphere
from numpy.typing import NDArray

from aobake import shading

FloatArray = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])
DEGREES = np.linspace(0.0, 89.9, 300)
COSINE, SINE = np.cos(np.radians(DEGREES)), np.sin(np.radians(DEGREES))
RIGHT, PRINTED = "#1f5fa8", "#d1495b"


@dataclass(frozen=True)
class Panel:
    """One misprint: both curves over the angle, and what is drawn."""

    title: str
    note: str
    printed: FloatArray
    right: FloatArray
    top: float


def toward(side: float = 1.0) -> FloatArray:
    """(300, 3) unit vectors at DEGREES from +z, towards +x or -x."""
    return np.stack([side * SINE, np.zeros_like(SINE), COSINE], axis=-1)


def distribution() -> Panel:
    m = 0.3
    tan2 = (SINE / COSINE) ** 2
    printed = np.exp(-tan2 / m**2) / (m**2 * COSINE**2)
    right = shading.beckmann(COSINE, m)
    return Panel(
        "1  Distribution",
        "D cos, m = 0.3; the area is 2.90, not 1",
        printed * COSINE,
        right * COSINE,
        12.0,
    )


def furnace() -> Panel:
    around, weights = hemisphere(200, 300)
    angles = np.linspace(0.0, 89.0, 24)
    given = []
    for angle in np.radians(angles):
        light = np.array([np.sin(angle), 0.0, np.cos(angle)])
        mirrors = shading.cook_torrance(UP, light, around, 0.3, 0.001, extinction=100.0)  # F = 1
        given.append(float((mirrors * weights).sum()))
    right = np.interp(DEGREES, angles, given)
    return Panel(
        "2  No factor 1/4", "light given back by mirrors, m = 0.3", 4.0 * right, right, 4.4
    )


def shadowing() -> Panel:
    view = np.array([-np.sin(np.radians(20.0)), 0.0, np.cos(np.radians(20.0))])
    light = toward()
    h = light + view
    h /= np.linalg.norm(h, axis=1)[:, None]
    nh, vh = h[:, 2], h @ view
    printed = np.minimum(1.0, np.minimum(2.0 * nh * view[2] / vh, nh * COSINE / vh))
    return Panel(
        "3  Shadowing halved",
        "G, view at 20° opposite",
        printed,
        shading.v_cavity_masking(UP, light, view),
        1.1,
    )


def fresnel(square: float, sign: float) -> FloatArray:
    """Fresnel's equation for 1.5 with the sign of 1 in g^2 and of g in the denominator's g - c."""
    g = np.sqrt(1.5**2 + COSINE**2 + square)
    ratio = (COSINE * (g + COSINE) - 1.0) / (COSINE * (g + sign * COSINE) + 1.0)
    return np.asarray(0.5 * ((g - COSINE) / (g + COSINE)) ** 2 * (1.0 + ratio**2))


def fresnel_denominator() -> Panel:
    right = shading.fresnel_dielectric(COSINE, 1.5)
    return Panel("4  Fresnel, denominator", "F, index 1.5", fresnel(-1.0, 1.0), right, 0.25)


def fresnel_g() -> Panel:
    right = shading.fresnel_dielectric(COSINE, 1.5)
    return Panel("5  Fresnel, g² with + 1", "F, index 1.5", fresnel(1.0, -1.0), right, 0.25)


def schlick() -> Panel:
    right = np.full_like(COSINE, shading.fresnel_schlick(1.0, 0.04))
    return Panel(
        "6  Schlick with N·L",
        "F, lit from the eye",
        shading.fresnel_schlick(COSINE, 0.04),
        right,
        1.1,
    )


def half_vector() -> Panel:
    light, view = toward(), toward(-1.0)
    right = shading.blinn_phong(UP, light, view, 10.0)
    return Panel(
        "7  H = (V + L)/2",
        "(N·H)¹⁰ at the mirror angle",
        ((light + view) / 2.0)[:, 2] ** 10,
        right,
        1.1,
    )


def azimuth() -> Panel:
    s2 = 0.25
    a, b = 1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    printed = a + b * SINE**2 * SINE * SINE / COSINE
    right = np.pi * shading.oren_nayar(UP, toward(), toward(), 0.5)
    return Panel(
        "8  Azimuth not normalised", "π f of Oren-Nayar, lit from the eye", printed, right, 3.0
    )


def minnaert() -> Panel:
    brdf = np.pi * shading.minnaert(UP, toward(), toward(), 0.5)
    return Panel(
        "9  Minnaert without a cosine", "radiance of the full moon, k = ½", brdf, brdf * COSINE, 6.0
    )


PANELS: tuple[Callable[[], Panel], ...] = (
    distribution, furnace, shadowing, fresnel_denominator, fresnel_g, schlick, half_vector, azimuth, minnaert,
)  # fmt: skip


def draw(path: Path) -> None:
    """Write the picture."""
    import matplotlib.pyplot as plt

    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(3, 3, figsize=(9.0, 7.2), layout="constrained")
        for axis, make in zip(axes.flat, PANELS, strict=True):
            panel = make()
            axis.plot(DEGREES, panel.right, color=RIGHT, lw=2.0)
            axis.plot(DEGREES, panel.printed, color=PRINTED, lw=1.6, ls=(0, (4, 2)))
            axis.set(xlim=(0, 90), ylim=(0, panel.top), xticks=(0, 30, 60, 90))
            axis.xaxis.set_major_formatter("{x:.0f}°")
            axis.set_title(panel.title + "\n", loc="left", fontweight="bold")
            axis.text(0.0, 1.03, panel.note, transform=axis.transAxes, fontsize=8.0)
        lines = axes[0, 0].lines
        figure.legend(
            lines, ["correct", "as printed"], loc="outside upper right", ncols=2, frameon=False
        )
        save(figure, path)
        plt.close(figure)

"""What the local models give back and what they take, and the pictures of docs/models.md.

    python benchmarks/models.py [--repeats 15] [--pictures FOLDER]

The energy table is the directional albedo of a white surface: the integral of f cos over the hemisphere
for light from one angle. The speed table is nanoseconds per value for blocks of float32 directions, in
turn within one run, beside those of Lambert. With --pictures, needs matplotlib (aobake[plot]).
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tables import Table, in_turn

from aobake.shading import (
    MODELS,
    Model,
    evaluate,
    fresnel_conductor,
    fresnel_dielectric,
    fresnel_schlick,
    model,
)

FloatArray = NDArray[np.float64]
ANGLES = (0, 30, 60, 80, 89)
BLOCK = 1 << 14  # directions at a time: what a processor's cache holds
SHOWN: tuple[tuple[str, dict[str, float]], ...] = (
    ("lambert", {}),
    ("phong", {"exponent": 32.0}),
    ("phong-normalised", {"exponent": 32.0}),
    ("blinn-phong", {"exponent": 32.0}),
    ("blinn-phong-normalised", {"exponent": 32.0}),
    ("torrance-sparrow", {"c": 3.0, "ior": 1.5}),
    ("torrance-sparrow", {"c": 3.0, "ior": 0.2, "extinction": 3.9}),
    ("cook-torrance", {"roughness": 0.3, "ior": 1.5}),
    ("cook-torrance", {"roughness": 0.3, "ior": 0.2, "extinction": 3.9}),
    ("cook-torrance", {"roughness": 0.8, "ior": 0.2, "extinction": 3.9}),
    ("oren-nayar", {"sigma": 0.3}),
    ("oren-nayar", {"sigma": 1.0}),
    ("oren-nayar-full", {"sigma": 0.3}),
    ("oren-nayar-full", {"sigma": 1.0}),
    ("oren-nayar-fujii", {"sigma": 0.3}),
    ("oren-nayar-fujii", {"sigma": 1.0}),
    ("fon", {"roughness": 1.0}),
    ("eon", {"roughness": 1.0}),
    ("minnaert", {"k": 0.5}),
    ("minnaert", {"k": 1.5}),
)


def hemisphere(rings: int = 300, sectors: int = 500) -> tuple[FloatArray, FloatArray]:
    """Directions (N, 3), and weights (N,) whose sum with f is the integral of f cos."""
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    theta, phi = np.pi / 4 * (nodes + 1.0), (np.arange(sectors) + 0.5) * (2.0 * np.pi / sectors)
    ring = np.pi / 4 * weights * np.sin(theta) * np.cos(theta) * (2.0 * np.pi / sectors)
    x, y = np.outer(np.sin(theta), np.cos(phi)), np.outer(np.sin(theta), np.sin(phi))
    z = np.broadcast_to(np.cos(theta)[:, None], x.shape)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), np.repeat(ring, sectors)


def albedos(chosen: Model, values: dict[str, float]) -> list[float]:
    """The directional albedo at each of ANGLES."""
    around, weights = hemisphere()
    found = []
    for angle in np.radians(ANGLES):
        light = np.array([np.sin(angle), 0.0, np.cos(angle)])
        value = evaluate(chosen, np.array([0.0, 0.0, 1.0]), light, around, values)
        found.append(float((value * weights).sum()))
    return found


def energy() -> Table:
    """The share of the light that comes back, by angle."""
    rows = [[_said(name, values), *albedos(model(name), values)] for name, values in SHOWN]
    return Table("Energy", ("model", *(f"{angle}°" for angle in ANGLES)), rows)


def _said(name: str, values: Mapping[str, object]) -> str:
    """A model and its values in words."""
    return ", ".join([name, *(f"{key} {value}" for key, value in values.items())])


def called(
    chosen: Model, values: Mapping[str, object], directions: Sequence[NDArray[np.float32]]
) -> Callable[[], object]:
    """The model's call with these values, and its defaults for the rest."""
    given = {each.name: each.default for each in chosen.parameters} | values
    return lambda: chosen.function(*directions, **given)


def speed(repeats: int) -> Table:
    """What a value takes, in nanoseconds and beside Lambert's."""
    rng = np.random.default_rng(0)
    n, light, view = (rng.standard_normal((BLOCK, 3)) for _ in range(3))
    n, light, view = (d / np.linalg.norm(d, axis=1)[:, None] for d in (n, light + n, view + n))
    single = [d.astype(np.float32) for d in (n, light, view)]
    metal = ("cook-torrance", {"ior": 0.2, "extinction": 3.9})
    cheap = ("cook-torrance", {"fresnel_form": "schlick"})
    shown = [(name, {}) for name in MODELS] + [metal, cheap]
    works = {_said(name, values): called(MODELS[name], values, single) for name, values in shown}
    ns = {
        name: statistics.median(seconds) / BLOCK * 1e9
        for name, seconds in in_turn(works, repeats).items()
    }
    first = next(iter(ns.values()))
    rows = [[name, value, value / first] for name, value in ns.items()]
    return Table("Speed", ("model", "ns per value", "times Lambert"), rows)


def fresnel(repeats: int) -> Table:
    """What the forms of Fresnel's term take beside the exact dielectric."""
    cosine = np.linspace(0.0, 1.0, BLOCK, dtype=np.float32)
    works: dict[str, Callable[[], object]] = {
        "exact dielectric": lambda: fresnel_dielectric(cosine, 1.5),
        "Schlick": lambda: fresnel_schlick(cosine, 0.04),
        "metal": lambda: fresnel_conductor(cosine, 0.2, 3.9),
    }
    taken = {name: statistics.median(s) for name, s in in_turn(works, repeats).items()}
    rows = [[name, s / taken["exact dielectric"]] for name, s in taken.items()]
    return Table("Fresnel alone", ("form", "times exact"), rows)


def run(quick: bool) -> Iterator[Table]:
    """Energy and speed."""
    yield energy()
    yield speed(3 if quick else 15)
    yield fresnel(3 if quick else 15)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    for table in (energy(), speed(arguments.repeats), fresnel(arguments.repeats)):
        print(table.markdown())
    if arguments.pictures:
        import misprints
        import spheres

        arguments.pictures.mkdir(parents=True, exist_ok=True)
        misprints.draw(arguments.pictures / "misprints.png")
        spheres.draw(arguments.pictures / "specular.png", spheres.SPECULAR)
        spheres.draw(arguments.pictures / "diffuse.png", spheres.DIFFUSE)


if __name__ == "__main__":
    main()

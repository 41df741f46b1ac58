"""What the local models give back and what they take, and the pictures of docs/models.md.

    python benchmarks/models.py [--repeats 15] [--pictures FOLDER]

The energy table is the directional albedo of a white surface: the integral of f cos over the hemisphere
for light from one angle. The speed table is nanoseconds per value for blocks of float32 directions, in
turn within one run, beside those of Lambert. With --pictures, needs matplotlib (aobake[plot]).
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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


def energy() -> None:
    """Print the share of the light that comes back, by angle."""
    print("| model | " + " | ".join(f"{angle}°" for angle in ANGLES) + " |")
    print("| --- " * (len(ANGLES) + 1) + "|")
    for name, values in SHOWN:
        said = ", ".join(f"{key} {value:g}" for key, value in values.items())
        row = " | ".join(f"{albedo:.3f}" for albedo in albedos(model(name), values))
        print(f"| {name}{', ' + said if said else ''} | {row} |")


def called(
    chosen: Model, values: Mapping[str, object], directions: Sequence[NDArray[np.float32]]
) -> Callable[[], object]:
    """The model's call with these values, and its defaults for the rest."""
    given = {each.name: each.default for each in chosen.parameters} | values
    return lambda: chosen.function(*directions, **given)


def speed(repeats: int) -> None:
    """Print what a value takes, in nanoseconds and beside Lambert's."""
    rng = np.random.default_rng(0)
    n, light, view = (rng.standard_normal((BLOCK, 3)) for _ in range(3))
    n, light, view = (d / np.linalg.norm(d, axis=1)[:, None] for d in (n, light + n, view + n))
    single = [d.astype(np.float32) for d in (n, light, view)]
    metal = ("cook-torrance", {"ior": 0.2, "extinction": 3.9})
    cheap = ("cook-torrance", {"fresnel_form": "schlick"})
    rows = [(name, {}) for name in MODELS] + [metal, cheap]
    calls = [called(MODELS[name], values, single) for name, values in rows]
    median = [statistics.median(seconds) / BLOCK * 1e9 for seconds in timed(calls, repeats)]
    print("\n| model | ns per value | times Lambert |")
    print("| --- | --- | --- |")
    for (name, values), ns in zip(rows, median, strict=True):
        said = ", ".join(f"{key} {value}" for key, value in values.items())
        print(f"| {name}{', ' + said if said else ''} | {ns:.0f} | {ns / median[0]:.1f} |")


def fresnel(repeats: int) -> None:
    """Print what Schlick's form takes beside the exact one."""
    cosine = np.linspace(0.0, 1.0, BLOCK, dtype=np.float32)
    calls: tuple[Callable[[], object], ...] = (
        lambda: fresnel_dielectric(cosine, 1.5),
        lambda: fresnel_schlick(cosine, 0.04),
        lambda: fresnel_conductor(cosine, 0.2, 3.9),
    )
    exact, schlick, metal = (statistics.median(column) for column in timed(calls, repeats))
    print(
        f"\nFresnel alone, beside the exact dielectric: Schlick {schlick / exact:.2f}, metal {metal / exact:.1f}."
    )


def timed(calls: Sequence[Callable[[], object]], repeats: int) -> list[list[float]]:
    """Seconds of each call, made in turn."""
    taken: list[list[float]] = [[] for _ in calls]
    for _ in range(repeats):
        for call, seconds in zip(calls, taken, strict=True):
            start = time.perf_counter()
            call()
            seconds.append(time.perf_counter() - start)
    return taken


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    energy()
    speed(arguments.repeats)
    fresnel(arguments.repeats)
    if arguments.pictures:
        import misprints
        import spheres

        arguments.pictures.mkdir(parents=True, exist_ok=True)
        misprints.draw(arguments.pictures / "misprints.png")
        spheres.draw(arguments.pictures / "specular.png", spheres.SPECULAR)
        spheres.draw(arguments.pictures / "diffuse.png", spheres.DIFFUSE)


if __name__ == "__main__":
    main()

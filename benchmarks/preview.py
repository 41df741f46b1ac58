"""What a picture takes, how much of that is rays, and what shading models add.

    python benchmarks/preview.py [--faces 70000] [--size 1280x720] [--samples 4] [--repeats 3]

A scan-like mesh with baked ambient occlusion, one shadowed light. Rays are the time inside Embree and in
what makes rays and finds where they land; shading is everything else: colours, occlusion, the lighting
model, averaging. The parts are measured in one thread, in processor time, since machines are shared; the
picture itself in all threads, by the clock. Medians are quoted.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

from scan import scan
from tables import Spread, Table

import aobake
from aobake.render_settings import RenderSettings
from aobake.shading import MODELS, preview, shot
from aobake.shading.materials import Baked
from aobake.shading.preview import render

RAYS = ("rays", "nearest_hits", "seen", "reach")  # as shot.py calls them


class Clock:
    """Processor time spent within some functions of a module."""

    def __init__(self) -> None:
        self.spent_s = 0.0

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, with its time added up."""

        def timed(*arguments: Any, **named: Any) -> Any:
            start = time.thread_time()
            try:
                return function(*arguments, **named)
            finally:
                self.spent_s += time.thread_time() - start

        return timed


def parts(scene: aobake.Scene, settings: RenderSettings, baked: Baked) -> tuple[float, float]:
    """(processor seconds of rays, and of shading) of a picture in one thread."""
    clock, originals = Clock(), {name: getattr(shot, name) for name in RAYS}
    whole = shot.shoot
    shading = Clock()
    try:
        for name, function in originals.items():
            setattr(shot, name, clock.around(function))
        preview.shoot = shading.around(whole)
        render(scene, settings, baked, trace=aobake.BakeSettings(threads=1))
        preview.shoot = whole
    finally:
        for name, function in originals.items():
            setattr(shot, name, function)
    return clock.spent_s, shading.spent_s - clock.spent_s


def tables(faces: int, size: str, samples: int, repeats: int) -> Iterator[Table]:
    """The whole picture, then its parts for each model."""
    scene = aobake.Scene.from_arrays(*scan(faces))
    baked = Baked(ao=aobake.bake_vertices(scene, aobake.BakeSettings(rays=64)).ao)
    settings = RenderSettings(size=size, samples=samples)
    render(scene, settings, baked)  # compiles
    whole = []
    for _ in range(repeats):
        start = time.perf_counter()
        render(scene, settings, baked)
        whole.append(time.perf_counter() - start)
    facts = {"triangles": scene.triangles, "size": size, "samples": samples}
    rows = [["all threads, by the clock", Spread.of(whole)]]
    yield Table("A picture with one shadowed light", ("what", "seconds"), rows, facts)
    rows = []
    for name in MODELS:
        each = dataclasses.replace(settings, model=name)
        measured = [parts(scene, each, baked) for _ in range(repeats)]
        rays_s = statistics.median(rays for rays, _ in measured)
        shading_s = statistics.median(shading for _, shading in measured)
        rows.append([name, rays_s, shading_s, shading_s / rays_s])
    yield Table("One thread", ("model", "rays, s", "shading, s", "shading / rays"), rows, facts)


def run(quick: bool) -> Iterator[Table]:
    """One picture."""
    yield from tables(*((4_000, "160x90", 1, 1) if quick else (70_000, "1280x720", 4, 3)))


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--faces", type=int, default=70_000)
    arguments.add_argument("--size", default="1280x720")
    arguments.add_argument("--samples", type=int, default=4)
    arguments.add_argument("--repeats", type=int, default=3)
    chosen = arguments.parse_args()
    for table in tables(chosen.faces, chosen.size, chosen.samples, chosen.repeats):
        print(table.markdown(), flush=True)


if __name__ == "__main__":
    main()

"""Ambient occlusion in textures beside Blender Cycles, with and without denoising: time to an error.

    python benchmarks texture_peers [--quick]

One scan-like mesh, unwrapped once, and the same texture coordinates for both: unwrapping is in nobody's
clock. Both bake in a process that is warm, in as many threads; what is timed is the whole bake, its tree
included. Errors are taken over texels whose eight neighbours are covered as well. Cycles takes the mean of
a texel and aobake the value at its middle, so there are two references, and each bake is held to the one
that it is closer to. Texels that Cycles leaves empty are not held against it. It denoises no bake of
ambient occlusion: "denoised" is its image after Open Image Denoise, chart by chart, as aobake does it but
without guides, and that takes its seconds. The native program is the one of vertex_peers.py.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from bare import Bare
from numpy.typing import NDArray
from rivals import FloatArray, Level, Peer, ask, in_short, levels_table, rms, time_table, time_to
from scipy.ndimage import label
from tables import Skipped, Spread, Table
from texture import unwrapped
from vertex_peers import NATIVE, settings_table

import aobake
from aobake.atlas.denoise import denoised
from aobake.meshes.surfaces import surfaces_of
from aobake.study.bench import bench_of
from aobake.study.directions import compared_sets
from aobake.tracing.estimate import processors

FIXED, DENOISED, AUTO = "aobake, fixed rays", "aobake, denoised", "aobake, as it decides itself"
RAYS, QUICK_RAYS = (16, 32, 64, 128, 256), (16, 64)
GUIDED, QUICK_GUIDED = (4, 8, 16, 32, 64, 128), (16, 64)
ERRORS = (0.02, 0.01, 0.005)
IN_SHORT = 0.005
PEERS = (
    Peer("Blender Cycles", "blender", (16, 64, 256, 1024), (4, 16)),
    Peer("Blender Cycles, its defaults", "blender", (4096,), (), asked={"adaptive": True}),
)


@dataclass(frozen=True)
class Lit:
    """A mesh with texture coordinates as everyone gets it, both references, and the texels that count."""

    scene: aobake.Scene
    size: int
    arrays: dict[str, FloatArray]
    middles: FloatArray
    means: FloatArray
    used: NDArray[np.bool_]

    def error(self, image: FloatArray) -> float:
        """Against the closer one of the references."""
        used = self.used & (image > 0.0)
        return min(rms((image - truth)[used]) for truth in (self.middles, self.means))


def lit(faces: int, size: int, rays: int) -> Lit:
    """Unwrap a scan, and bake its references: so many rays at the middles, as many in all for the means."""
    scene, _ = unwrapped(faces, size)
    mesh = scene.meshes[0]
    layer = mesh.attributes["TEXCOORD_0"]
    uv = np.array(layer.values)[np.array(layer.corners)]
    uv[..., 1] = 1.0 - uv[..., 1]  # glTF counts rows from the top, Blender from below
    surface = surfaces_of(scene, aobake.BakeSettings())[0]
    arrays = {
        "vertices": mesh.vertices,
        "faces": surface.faces,
        "normals": surface.normals,
        "uv": uv,
    }
    middles, means = (
        aobake.bake_texture(
            scene,
            aobake.BakeSettings(
                size=size, rays=rays // per**2, supersample=per, denoise="off", seed=0x5EED
            ),
        )
        for per in (1, 2)
    )
    used = middles.coverage.copy()
    for axis in (0, 1):
        used &= np.roll(used, 1, axis) & np.roll(used, -1, axis)
    return Lit(
        scene, size, arrays, middles.image.astype(np.float64), means.image.astype(np.float64), used
    )


def our_levels(of: Lit, repeats: int, quick: bool) -> list[Level]:
    """Without and with the denoiser, and with what `auto` makes of tolerances."""
    asked: list[tuple[str, str, dict[str, object]]] = [
        (FIXED, f"{n} rays", {"rays": n, "denoise": "off"}) for n in (QUICK_RAYS if quick else RAYS)
    ]
    asked += [
        (DENOISED, f"{n} rays", {"rays": n, "denoise": "on"})
        for n in (QUICK_GUIDED if quick else GUIDED)
    ]
    asked += [(AUTO, f"rms:{e:g}", {"tolerance": f"rms:{e}"}) for e in (0.02, 0.01, 0.005)]
    levels = []
    for baker, setting, settings in asked:
        seconds = []
        for _ in range(repeats):
            start = time.perf_counter()
            baked = aobake.bake_texture(of.scene, aobake.BakeSettings(size=of.size, **settings))
            seconds.append(time.perf_counter() - start)
        error = of.error(baked.image.astype(np.float64))
        levels.append(Level(baker, setting, Spread.of(seconds), baked.rays, error))
    return levels


def peer_levels(of: Lit, peer: Peer, quick: bool) -> tuple[list[Level], str, list]:
    """(levels, why there are none, its answers)."""
    samples = peer.quick if quick else peer.samples
    if not samples:
        return [], "", []
    try:
        told = ask(peer, of.arrays, samples, kind="texture", threads=processors(), size=of.size)
    except Skipped as reason:
        return [], str(reason), []
    texels, levels = int(of.used.sum()), []
    for n, seconds, image in zip(told.samples, told.seconds, told.values, strict=True):
        asked, spent = f"{n} samples", Spread.of([seconds])
        levels.append(Level(peer.name, asked, spent, n * texels, of.error(image)))
        if len(peer.samples) > 1:
            start = time.perf_counter()
            smooth = smoothed(image)
            spent = Spread.of([seconds + time.perf_counter() - start])
            error = of.error(smooth)
            levels.append(Level(f"{peer.name}, denoised", asked, spent, n * texels, error))
    return levels, "", [told]


def smoothed(image: FloatArray) -> FloatArray:
    """What Open Image Denoise makes of an image in which charts do not touch."""
    charts = label(image > 0.0, np.ones((3, 3)))[0].astype(np.int32) - 1
    anything = np.full(image.shape, 1.0, np.float32)
    found = denoised(image.astype(np.float32), anything, charts, None)
    return np.where(image > 0.0, found, 0.0).astype(np.float64)


def native_levels(of: Lit, rays: Sequence[int], texels: int) -> list[Level]:
    """Fixed Hammersley sets at the rate of bare packets, for as many points as there are texels."""
    scene = aobake.Scene.from_arrays(of.arrays["vertices"], of.arrays["faces"])
    bare = Bare(scene, 256, most_rays=1 << 23)
    rate = Spread.of(bare.rate() for _ in range(5))
    bench = bench_of(scene, aobake.BakeSettings(), 4000)
    truth = bench.reference(1 << 14)
    levels = []
    for count in rays:
        found = [
            rms(bench.run_sets(compared_sets(kind, count), count, 1)[0] - truth)
            for kind in ("Hammersley", "Hammersley, polar")
        ]
        total = count * texels
        seconds = Spread(total / rate.median, total / rate.most, total / rate.least, rate.runs)
        levels.append(Level(NATIVE, f"{count} rays", seconds, total, min(found)))
    return levels


def tables_of(
    faces: int, size: int, reference: int, repeats: int, *, quick: bool, defaults: bool
) -> Iterator[Table]:
    """Everyone on one texture; Cycles with its defaults takes many minutes, and no part in the comparison."""
    of = lit(faces, size, reference)
    bake = aobake.BakeSettings(size=min(size, 256), rays=1)
    aobake.bake_texture(of.scene, bake)  # compiled now
    levels, absent, answers = [], [], []
    for peer in PEERS if defaults else PEERS[:1]:
        found, reason, told = peer_levels(of, peer, quick)
        levels += found
        answers += told
        absent += [reason] if reason else []
    rays = QUICK_RAYS if quick else RAYS
    levels.sort(key=lambda level: level.baker)
    levels = our_levels(of, repeats, quick) + native_levels(of, rays, int(of.used.sum())) + levels
    facts = {
        "triangles": of.scene.triangles,
        "covered texels": int(of.used.sum()),
        "threads": processors(),
        "RMS between the references": rms((of.middles - of.means)[of.used]),
    }
    yield levels_table(f"{size} x {size}: every setting", levels, facts)
    best = min(
        (FIXED, DENOISED),
        key=lambda b: (time_to([x for x in levels if x.baker == b], 0.01) or [1e9])[0],
    )
    yield time_table(f"{size} x {size}: time to an error", levels, ERRORS, best, "; ".join(absent))
    yield in_short(f"{size} x {size}: in short", levels, IN_SHORT, (FIXED, DENOISED, AUTO))
    yield settings_table(answers[:1])


def run(quick: bool) -> Iterator[Table]:
    """Textures of 512 and 1024."""
    if quick:
        yield from tables_of(2_000, 128, 512, 1, quick=True, defaults=False)
        return
    for size in (512, 1024):
        yield from tables_of(20_000, size, 2048, 3, quick=False, defaults=size == 512)

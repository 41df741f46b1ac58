"""The asset on the bench: its points, their true values, and every way of spending rays on them."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.leastsquares import fitted_vertices
from aobake.leastsquares.samples import places_in_triangles, shares
from aobake.leastsquares.triangles import FittedTriangles, fitted_triangles
from aobake.meshes.scene import Scene
from aobake.meshes.surfaces import surfaces_of
from aobake.occlusion import occlusion_at
from aobake.points import SurfacePoints, points_on_faces, vertex_points
from aobake.prepare import Prepared, build, in_scene_units, lowest
from aobake.settings import BakeSettings
from aobake.study.curves import Run
from aobake.study.ways import fixed
from aobake.tracing.estimate import Estimates, Request, estimate

__all__ = ["REFERENCE_SEED", "Bench", "Surface", "bench_of", "surface_of_bench"]

FloatArray = NDArray[np.float64]

REFERENCE_SEED = 0x5EED
APART = 1 << 40  # numbers of points whose directions nothing else has


@dataclass(frozen=True, eq=False, kw_only=True)
class Bench:
    """An asset made ready to be measured.

    points : some of its vertices; whole : of how many
    """

    scene: Scene
    settings: BakeSettings
    prepared: Prepared
    ground: float | None
    points: SurfacePoints
    whole: int

    def estimates(self, settings: BakeSettings) -> Estimates:
        """At the points, whatever the settings ask for."""
        return occlusion_at(self.prepared, self.points, self.ground, settings)

    def run(self, settings: BakeSettings) -> Run:
        """(values, standard errors, rays a point, seconds for the whole asset)."""
        start = time.perf_counter()
        found = self.estimates(settings)
        return self._run(found, time.perf_counter() - start)

    def run_sets(self, sets: NDArray[np.float32], rays: int, seed: int) -> Run:
        """The same with directions of one's own."""
        request = Request(
            positions=self.points.positions,
            normals=self.points.normals,
            geometric=None,
            numbers=self.points.numbers,
            ground=self.ground,
            sets=sets,
        )
        settings = self.fixed(rays, seed)
        start = time.perf_counter()
        found = estimate(self.prepared.world, request, settings)
        return self._run(found, time.perf_counter() - start)

    def _run(self, found: Estimates, seconds: float) -> Run:
        return (
            found.mean.astype(np.float64),
            found.standard_error.astype(np.float64),
            float(found.rays.mean()),
            seconds * self.whole / len(self.points),
        )

    def fixed(self, rays: int, seed: int) -> BakeSettings:
        """The asset's settings with a fixed number of rays."""
        return fixed(self.settings, rays, seed)

    def reference(self, rays: int) -> FloatArray:
        """The true values, as nearly as so many rays tell."""
        return self.run(self.fixed(rays, REFERENCE_SEED))[0]


def bench_of(scene: Scene, settings: BakeSettings, most: int) -> Bench:
    """An asset with at most so many of its vertices, spread evenly over their numbers."""
    settings = in_scene_units(scene, settings)
    prepared = build(scene, surfaces_of(scene, settings), settings)
    points = vertex_points(scene, prepared)
    step = max(1, -(-len(points) // most))
    return Bench(
        scene=scene,
        settings=settings,
        prepared=prepared,
        ground=lowest(scene, prepared, settings),
        points=points.only(np.arange(0, len(points), step)),
        whole=len(points),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Surface:
    """Points all over the surface, and the corners whose values are interpolated there.

    corners : (S, 3) unknowns; basis : (S, 3) their weights; truth : (S,) the true values
    """

    bench: Bench
    corners: NDArray[np.int64]
    basis: FloatArray
    truth: FloatArray

    def run(self, settings: BakeSettings, *, fitted: bool) -> Run:
        """What vertices interpolate to; rays and seconds are those of one vertex, and of all."""
        bench = self.bench
        start = time.perf_counter()
        if fitted:
            found = fitted_vertices(bench.scene, bench.prepared, bench.ground, settings)
        else:
            every = vertex_points(bench.scene, bench.prepared)
            found = occlusion_at(bench.prepared, every, bench.ground, settings)
        seconds = time.perf_counter() - start
        values, errors = found.mean.astype(np.float64), found.standard_error.astype(np.float64)
        return (
            np.einsum("ij,ij->i", self.basis, values[self.corners]),
            np.sqrt(np.einsum("ij,ij->i", self.basis**2, errors[self.corners] ** 2)),
            float(found.rays.mean()),
            seconds,
        )


def surface_of_bench(bench: Bench, samples: int, rays: int) -> Surface | None:
    """A dense bake to compare with, at points dealt out by area; None where nothing has an area."""
    triangles = fitted_triangles(bench.scene, bench.prepared)
    if len(triangles) == 0:
        return None
    chosen = np.repeat(np.arange(len(triangles)), shares(triangles.areas, samples))
    weights = places_in_triangles(chosen, APART // 1024 + np.arange(len(chosen)))
    points = _points(bench, triangles, chosen, weights)
    settings = bench.fixed(rays, REFERENCE_SEED)
    truth = occlusion_at(bench.prepared, points, bench.ground, settings).mean
    return Surface(
        bench=bench,
        corners=triangles.corners[chosen],
        basis=np.column_stack([1.0 - weights.sum(axis=1), weights]),
        truth=truth.astype(np.float64),
    )


def _points(
    bench: Bench, triangles: FittedTriangles, chosen: NDArray[np.int64], weights: FloatArray
) -> SurfacePoints:
    return points_on_faces(
        bench.scene,
        bench.prepared,
        triangles.instances[chosen],
        triangles.faces[chosen],
        weights,
        APART + np.arange(len(chosen)),
    )

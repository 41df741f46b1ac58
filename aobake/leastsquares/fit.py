"""Least-squares vertex baking: samples inside triangles, more of them where the fit is bad, one solve.

Half of the samples are dealt out by area, and some to every triangle; the other half by what the first
fit leaves over, so that they go where occlusion bends. See system.py for what is minimised.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aobake.leastsquares.samples import more_samples, places_in_triangles, shares
from aobake.leastsquares.system import Matrix, jump_matrix, mass_matrix, right_side, solver
from aobake.leastsquares.triangles import FittedTriangles, fitted_triangles
from aobake.meshes.scene import FloatArray, Scene
from aobake.occlusion import occlusion_at
from aobake.open_sky import sky_over
from aobake.points import SurfacePoints, points_on_faces, vertex_points
from aobake.prepare import Prepared
from aobake.settings import FIRST_ROUND, TraceSettings
from aobake.tracing.estimate import Estimates

__all__ = ["fitted_vertices"]

IntArray = NDArray[np.int64]
Progress = Callable[[int, int], None]

EVERY = 3  # samples in every triangle: as many as it has corners
BY_AREA, BY_ERROR = 3, 6  # more of them, a triangle in the mean
SHARE = (
    4  # a vertex is fitted to more samples than this, so that each may have that many fewer rays
)
TRIALS = 32  # of the noise, to see what becomes of it: the standard error is good to an eighth


@dataclass(frozen=True, eq=False, kw_only=True)
class Samples:
    """What was found inside triangles.

    triangles : (S,) int64; basis : (S, 3) float64, weights of their corners; found : their estimates
    """

    triangles: IntArray
    basis: FloatArray
    found: Estimates


def fitted_vertices(
    scene: Scene,
    prepared: Prepared,
    ground: float | None,
    settings: TraceSettings,
    progress: Progress | None = None,
) -> Estimates:
    """Values at the vertices that are traced from whose interpolation is closest to the true occlusion.

    Returns estimates in the order of points.vertex_points. The rays, and the state, of a vertex are those
    of the samples that are nearer to it than to their other corners; the standard error is what the
    errors of the samples come to in the fit.
    Source: L. Kavan, A. Bargteil, P.-P. Sloan, Least squares vertex baking, EGSR 2011.
    """
    triangles = fitted_triangles(scene, prepared)
    if len(triangles) == 0:
        return Estimates.blank(triangles.unknowns)
    fewer = sample_settings(settings)
    total = (EVERY + BY_AREA + BY_ERROR) * len(triangles)
    sky = sky_over(prepared, vertex_points(scene, prepared), total, ground, fewer)

    def look(before: IntArray, added: IntArray) -> Samples:
        def report(done: int, _: int) -> None:
            if progress is not None:
                progress(int(before.sum()) + done, total)

        def trace(points: SurfacePoints) -> Estimates:
            return occlusion_at(prepared, points, ground, fewer, report, sky)

        return _sampled(scene, prepared, triangles, before, added, trace)

    jumps = jump_matrix(triangles)
    before = np.zeros(len(triangles), np.int64)
    added = EVERY + shares(triangles.areas, BY_AREA * len(triangles))
    first = look(before, added)
    wrong = _left_over(triangles, first, _fit(triangles, jumps, [first]).values())
    second = look(added, shares(triangles.areas * wrong, BY_ERROR * len(triangles)))
    return _estimates(_fit(triangles, jumps, [first, second]), triangles, [first, second])


def sample_settings(settings: TraceSettings) -> TraceSettings:
    """How a sample is traced so that the vertices are as exact as asked for."""
    if settings.tolerance is not None:
        return replace(settings, tolerance=min(0.5, settings.tolerance * SHARE**0.5), quality=None)
    return replace(settings, rays=max(min(settings.rays, FIRST_ROUND), settings.rays // SHARE))


def _sampled(
    scene: Scene,
    prepared: Prepared,
    triangles: FittedTriangles,
    before: IntArray,
    added: IntArray,
    trace: Callable[[SurfacePoints], Estimates],
) -> Samples:
    """Trace from new samples of each triangle's sequence."""
    chosen, numbers = more_samples(before, added)
    weights = places_in_triangles(chosen, numbers)
    # A sample keeps its directions whatever the number of others.
    own = chosen * (1 << 20) + numbers
    points = points_on_faces(
        scene, prepared, triangles.instances[chosen], triangles.faces[chosen], weights, own
    )
    found = trace(points)
    basis = np.column_stack([1.0 - weights.sum(axis=1), weights])
    return Samples(triangles=chosen, basis=basis, found=found)


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit:
    """All samples together, each with its share of the area, and what solves for the vertices."""

    corners: IntArray
    basis: FloatArray
    weights: FloatArray
    means: FloatArray
    errors: FloatArray
    unknowns: int
    solve: Callable[[FloatArray], FloatArray]

    def values(self) -> FloatArray:
        """(U,) the values that fit best; 1, open, where nothing is known."""
        return 1.0 - self.solve(self._right_side(1.0 - self.means))

    def standard_errors(self) -> FloatArray:
        """(U,) what noise of the samples' errors comes to, by trial."""
        noise = np.random.default_rng(0)
        trials = [
            self._right_side(self.errors * noise.standard_normal(len(self.means)))
            for _ in range(TRIALS)
        ]
        return np.asarray(np.sqrt(np.mean(np.square(self.solve(np.stack(trials, axis=1))), axis=1)))

    def _right_side(self, values: FloatArray) -> FloatArray:
        return right_side(self.corners, self.basis, self.weights * values, self.unknowns)


def _fit(triangles: FittedTriangles, jumps: Matrix, parts: list[Samples]) -> Fit:
    """Put the system together, and factor it."""
    chosen = np.concatenate([part.triangles for part in parts])
    basis = np.concatenate([part.basis for part in parts])
    number = np.bincount(chosen, minlength=len(triangles))
    weights = (triangles.areas / np.maximum(number, 1))[chosen]
    corners = triangles.corners[chosen]
    return Fit(
        corners=corners,
        basis=basis,
        weights=weights,
        means=np.concatenate([part.found.mean for part in parts]).astype(np.float64),
        errors=np.concatenate([part.found.standard_error for part in parts]).astype(np.float64),
        unknowns=triangles.unknowns,
        solve=solver(mass_matrix(corners, basis, weights, triangles.unknowns), jumps),
    )


def _left_over(triangles: FittedTriangles, samples: Samples, values: FloatArray) -> FloatArray:
    """(T,) the root mean square of what the fit leaves over in each triangle."""
    fitted = np.einsum("ij,ij->i", samples.basis, values[triangles.corners[samples.triangles]])
    squared = np.square(fitted - samples.found.mean)
    number = np.bincount(samples.triangles, minlength=len(triangles))
    sums = np.bincount(samples.triangles, squared, minlength=len(triangles))
    return np.sqrt(sums / np.maximum(number, 1))


def _estimates(fit: Fit, triangles: FittedTriangles, parts: list[Samples]) -> Estimates:
    """The fit as estimates at vertices."""
    result = Estimates.blank(triangles.unknowns)
    result.mean[:] = np.clip(fit.values(), 0.0, 1.0)
    result.standard_error[:] = fit.standard_errors()
    for part in parts:
        owner = triangles.corners[part.triangles, part.basis.argmax(axis=1)]
        np.add.at(result.rays, owner, part.found.rays)
        np.maximum.at(result.states, owner, part.found.states)
    return result

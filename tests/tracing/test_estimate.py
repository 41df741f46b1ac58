"""The same bytes whatever the threads, blocks and progress; rounds towards a tolerance; stopping."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aobake import BakedVertices, BakeSettings, Scene, bake_vertices, visibility
from aobake.tracing import blocks
from aobake.tracing.rounds import equal_fixed_rays
from tests.known import known_scenes
from tests.scenes import TURNED, UP, Triangles, box, floor, icosphere, joined, moved
from tests.support import ROOT, heeds_interrupts


def still_life() -> Scene:
    """A sphere and a box on a floor of many squares: about 1,800 vertices with every degree of openness."""
    mesh = joined(
        floor(3.0, 0.0, 30),
        icosphere(3, 0.8, (-1.0, 0.2, 0.8)),
        moved(box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), TURNED, (0.5, 0.5, 0.6)),
    )
    return Scene.from_arrays(*mesh)


def content(baked: BakedVertices) -> bytes:
    return b"".join(
        a.tobytes() + e.tobytes() for a, e in zip(baked.ao, baked.standard_error, strict=True)
    )


def nothing(stage: str, done: int, total: int) -> None:
    """Progress that nobody looks at."""


@pytest.mark.parametrize("tolerance", [None, 0.01, "rms:0.01"])
@pytest.mark.parametrize("block_rays", [1 << 10, 12_345, 1 << 18, 1 << 24])
def test_threads_and_blocks_do_not_change_a_byte(
    tolerance: float | str | None, block_rays: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = still_life()
    asked: dict[str, Any] = {"tolerance": tolerance}

    def settings(threads: int) -> BakeSettings:
        return BakeSettings(rays=48, threads=threads, max_rays=512, **asked)

    reference = content(bake_vertices(scene, settings(1)))
    monkeypatch.setattr(blocks, "BLOCK_RAYS", block_rays)
    for threads in (1, 2, 5):
        assert content(bake_vertices(scene, settings(threads))) == reference


def test_progress_does_not_change_a_byte_and_ends_at_the_whole(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(blocks, "BLOCK_RAYS", 1 << 12)
    scene, settings = still_life(), BakeSettings(rays=64, threads=2)
    seen: list[tuple[str, int, int]] = []
    watched = bake_vertices(scene, settings, progress=lambda *state: seen.append(state))
    assert content(watched) == content(bake_vertices(scene, settings))
    traced = [(done, total) for stage, done, total in seen if stage == "trace"]
    assert traced == sorted(traced)
    assert len(traced) > 1  # of two dozen blocks; a busy machine tells of several at once
    assert traced[-1][0] == traced[-1][1] > 1000


def test_another_seed_gives_other_samples_of_the_same_thing() -> None:
    scene = still_life()
    one, other = (bake_vertices(scene, BakeSettings(rays=256, seed=seed)) for seed in (0, 1))
    difference = np.abs(one.ao[0] - other.ao[0])
    allowed = 4.0 * np.hypot(one.standard_error[0], other.standard_error[0])
    assert (difference > 0.0).mean() > 0.3
    assert (difference <= allowed + 1e-6).mean() > 0.99


def test_the_largest_seed_is_a_seed() -> None:
    scene = Scene.from_arrays(*floor(1.0, -1.0))
    values = [
        visibility(
            scene,
            [(0.0, 0.0, 0.0)],
            [(1.0, 0.0, -1.0)],
            BakeSettings(rays=64, seed=seed, tolerance=0.01),
        )
        for seed in (2**64 - 1, 2**64 - 2, 0)
    ]
    assert len({value.mean.tobytes() for value in values}) > 1


# -- tolerance ------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [0.02, 0.005])
def test_a_tolerance_is_reached_with_no_more_rays_than_needed(tolerance: float) -> None:
    scene = still_life()
    baked = bake_vertices(scene, BakeSettings(tolerance=tolerance, max_rays=8192))
    assert float(baked.standard_error[0].max()) <= tolerance
    assert baked.rays < 0.5 * 8192 * scene.vertices
    exact = bake_vertices(scene, BakeSettings(rays=8192, seed=9))
    error = baked.ao[0].astype(np.float64) - exact.ao[0]
    assert float(np.sqrt((error**2).mean())) <= tolerance


def test_open_points_are_done_before_others() -> None:
    """Where all rays agree the first round does; at an edge of shade it takes more."""
    points = np.array([(0.0, 0.0, 5.0), (0.0, 0.0, 0.2)])
    scene = Scene.from_arrays(*moved(floor(1.0, 0.0), 1.0, (1.5, 0.0, 0.5)))
    estimate = visibility(scene, points, [UP, UP], BakeSettings(tolerance=0.01, max_rays=4096))
    assert estimate.rays[0] < estimate.rays[1] <= 4096


@pytest.mark.parametrize("most", [32, 63, 100, 4096])
def test_no_point_gets_more_rays_than_the_most(most: int) -> None:
    scene = still_life()
    baked = bake_vertices(scene, BakeSettings(tolerance=1e-5, max_rays=most))
    assert baked.rays <= most * scene.vertices
    assert np.isfinite(baked.ao[0]).all()
    points = np.tile((0.3, 0.3, 0.01), (50, 1))
    estimate = visibility(
        scene, points, np.tile(UP, (50, 1)), BakeSettings(tolerance=1e-5, max_rays=most)
    )
    assert int(estimate.rays.max()) <= most
    assert int(estimate.rays.min()) > 0.8 * most  # sets have whole packets


def test_rounds_are_unbiased() -> None:
    """How large sets are depends on values, but not how they count."""
    known = 0.5  # a wall that hides one half of the sky
    wall = Triangles(
        np.array([(0.0, -1e4, 0.0), (0.0, 1e4, 0.0), (0.0, 0.0, 1e5)]),
        np.array([(0, 1, 2)], np.int32),
    )
    points = np.tile((1e-3, 0.0, 0.0), (512, 1))
    settings = BakeSettings(tolerance=0.004, max_rays=8192)
    estimate = visibility(Scene.from_arrays(*wall), points, np.tile(UP, (512, 1)), settings)
    mean = float(estimate.mean.mean(dtype=np.float64))
    assert abs(mean - known) < 4.0 * float(estimate.standard_error.max()) / np.sqrt(512) + 1e-4


def test_a_tolerance_for_all_is_reached_by_all_together_with_fewer_rays() -> None:
    scene = still_life()
    together: dict[str, Any] = {"tolerance": "rms:0.01"}
    baked = bake_vertices(scene, BakeSettings(**together))
    each = bake_vertices(scene, BakeSettings(tolerance=0.01))
    exact = bake_vertices(scene, BakeSettings(rays=8192, seed=9))
    reported = float(np.sqrt(np.mean(np.square(baked.standard_error[0], dtype=np.float64))))
    error = baked.ao[0].astype(np.float64) - exact.ao[0]
    assert reported <= 0.01
    assert float(np.sqrt((error**2).mean())) <= 0.011
    assert baked.rays < 0.85 * each.rays
    assert float(baked.standard_error[0].max()) > 0.01  # some points pay for others


def test_points_under_one_sky_share_the_rays_of_a_common_tolerance() -> None:
    """Where a ray takes away the same everywhere, everyone gets about the same."""
    wall = Triangles(
        np.array([(0.0, -1e4, 0.0), (0.0, 1e4, 0.0), (0.0, 0.0, 1e5)]),
        np.array([(0, 1, 2)], np.int32),
    )
    points = np.tile((1e-3, 0.0, 0.0), (256, 1))
    asked: dict[str, Any] = {"tolerance": "rms:0.006", "max_rays": 8192}
    found = visibility(
        Scene.from_arrays(*wall), points, np.tile(UP, (256, 1)), BakeSettings(**asked)
    )
    assert int(found.rays.max()) <= 4 * int(found.rays.min())
    assert float(np.sqrt(np.mean(np.square(found.standard_error)))) <= 0.006


def test_where_all_rays_agree_the_error_is_not_zero() -> None:
    scene = Scene.from_arrays(*floor(1.0, -1.0))
    found = visibility(scene, [(0.0, 0.0, 0.0)], [UP], BakeSettings(tolerance=0.005))
    assert float(found.mean[0]) == 1.0
    assert 0.0 < float(found.standard_error[0]) <= 0.005


@pytest.mark.parametrize("how", [{"rays": 100}, {"tolerance": 0.005}])
def test_error_bars_are_honest_where_the_truth_is_known(how: dict[str, Any]) -> None:
    """Closed forms, at 64 points that differ in nothing but their directions, and a scene of a few bodies."""
    errors, bars = [], []
    for known in known_scenes():
        if len(known.mesh.faces) > 2000 or known.openness in {0.0, 1.0}:
            continue
        settings = BakeSettings(
            max_distance=known.max_distance, falloff=known.falloff, max_rays=1 << 14, **how
        )
        many = np.ones((64, 1))
        found = visibility(
            Scene.from_arrays(*known.mesh), many * known.point, many * known.normal, settings
        )
        size = np.abs(found.mean.astype(np.float64) - known.openness)
        errors.append(np.maximum(size - known.facets, 0.0))
        bars.append(found.standard_error.astype(np.float64))
    at = still_life().meshes[0].vertices[::4]
    up = np.tile(UP, (len(at), 1))
    rough, exact = (
        visibility(still_life(), at, up, BakeSettings(max_rays=1 << 14, seed=seed, **asked))
        for seed, asked in ((0, how), (1, {"rays": 1 << 14}))
    )
    errors.append(np.abs(rough.mean.astype(np.float64) - exact.mean))
    bars.append(rough.standard_error.astype(np.float64))
    error, bar = np.concatenate(errors), np.concatenate(bars)
    assert len(error) > 1000
    assert (error <= 2.0 * bar).mean() >= 0.93
    assert (error <= 4.0 * bar).mean() >= 0.99
    assert np.sqrt((bar**2).mean()) <= 1.5 * np.sqrt((error**2).mean())


def leaves(count: int) -> Triangles:
    """Small squares that lie anyhow in a ball: all edges and no surface."""
    rng = np.random.default_rng(2)
    middle = rng.standard_normal((count, 1, 3))
    middle *= rng.random((count, 1, 1)) ** (1 / 3) / np.linalg.norm(middle, axis=2, keepdims=True)
    u, v, _ = 0.05 * np.linalg.qr(rng.standard_normal((count, 3, 3))).Q.transpose(2, 0, 1)
    around = np.stack([-u - v, u - v, u + v, v - u], axis=1)
    first = 4 * np.arange(count)[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return Triangles((middle + around).reshape(-1, 3), faces.astype(np.int32))


def test_error_bars_are_honest_among_leaves() -> None:
    """Where edges are everywhere rays err nearly independently, which bars for lines do not see."""
    scene = Scene.from_arrays(*leaves(3000))
    rng = np.random.default_rng(3)
    at, around = rng.uniform(-0.5, 0.5, (500, 3)), rng.standard_normal((500, 3))
    rough, exact = (
        visibility(scene, at, around, BakeSettings(rays=rays, seed=rays)) for rays in (256, 4096)
    )
    error, bar = np.abs(rough.mean.astype(np.float64) - exact.mean), rough.standard_error
    assert (error <= 2.0 * bar).mean() >= 0.91
    assert (error <= 4.0 * bar).mean() >= 0.985
    assert 0.9 <= float(np.sqrt((bar**2).mean() / (error**2).mean())) <= 1.5


def test_rays_saved_are_counted_against_the_same_error() -> None:
    """Sets that grow are a little worse, so equal points save less than nothing; unequal ones save."""
    error, rays = np.full(8, 0.01, np.float32), np.full(8, 200, np.int32)
    equal = equal_fixed_rays(error, rays)
    assert equal is not None
    assert 170.0 < equal < 200.0
    unequal = equal_fixed_rays(np.array([0.0087, 0.01], np.float32), np.array([64, 1024], np.int32))
    assert unequal is not None
    assert unequal > 1.05 * (64 + 1024) / 2
    assert equal_fixed_rays(np.zeros(3, np.float32), np.zeros(3, np.int32)) is None


# -- stopping -------------------------------------------------------------------------------------


class Stopped(Exception):
    """Somebody asked for it."""


def test_what_progress_raises_stops_the_work_at_once() -> None:
    """About a minute of tracing is asked for."""
    scene = Scene.from_arrays(*icosphere(6))

    def stop(stage: str, done: int, total: int) -> None:
        raise Stopped

    bake_vertices(
        Scene.from_arrays(*icosphere(0)), BakeSettings(rays=8)
    )  # compiled before the clock
    settings, start = BakeSettings(rays=65_536, threads=2), time.perf_counter()
    with pytest.raises(Stopped):
        bake_vertices(scene, settings, progress=stop)
    assert time.perf_counter() - start < 10.0


LONG_BAKE = """
import sys
from aobake import BakeSettings, Scene, bake_vertices
from tests.scenes import icosphere

def progress(stage, done, total):
    print("tracing", flush=True)

bake_vertices(Scene.from_arrays(*icosphere(6)), BakeSettings(rays=65536, threads=2), progress=progress)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGINT for another process")
def test_an_interrupt_ends_a_bake_within_a_second_or_so() -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-c", LONG_BAKE],
        cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=heeds_interrupts,  # noqa: PLW1509 - no threads yet
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == "tracing\n"
        start = time.perf_counter()
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=30.0)
        finally:
            process.kill()
        seconds = time.perf_counter() - start
        assert "KeyboardInterrupt" in process.stderr.read()
    assert process.returncode != 0
    assert seconds < 10.0  # below one on an idle machine; minutes where nobody looks


@pytest.mark.parametrize("progress", [None, nothing])
def test_no_thread_outlives_a_bake(progress: Callable[[str, int, int], None] | None) -> None:
    import threading

    before = threading.active_count()
    bake_vertices(still_life(), BakeSettings(rays=8, threads=3), progress=progress)
    assert threading.active_count() == before

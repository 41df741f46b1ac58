"""Unwrapping: every usable face in one place, no chart over itself, the mesh reproduced exactly."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from aobake.atlas import partition
from aobake.atlas.charts import mended
from aobake.atlas.dual import dual_of
from aobake.atlas.unwrap import Charts, unwrap
from aobake.meshes.scene import FloatArray
from aobake.settings import AtlasSettings
from tests.scenes import (
    Triangles,
    box,
    disc,
    flipped,
    icosphere,
    joined,
    mesh_of,
    moved,
    patch,
    subdivided,
    tube,
    unwelded,
)


def unwrapped(shape: Triangles, *, threads: int = 2, timeout: float = 300.0) -> Charts:
    return unwrap([mesh_of(shape)], AtlasSettings(unwrap_timeout=timeout), threads=threads)[0]


def signed_areas(corners: FloatArray) -> FloatArray:
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))


def surface_areas(shape: Triangles) -> FloatArray:
    p = shape.vertices[shape.faces]
    return np.asarray(0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1))


def overlap(one: FloatArray, other: FloatArray, least: float) -> bool:
    """Whether two triangles that turn left share more than a strip of width `least`, by separating lines."""
    for a, b in ((one, other), (other, one)):
        for k in range(3):
            along = a[(k + 1) % 3] - a[k]
            inward = np.array([-along[1], along[0]]) / math.hypot(*along)
            if max((b - a[k]) @ inward) <= least:
                return False
    return True


def laps(charts: Charts) -> int:
    """Pairs of triangles of one chart that overlap, found one by one."""
    count = 0
    for chart in range(int(charts.chart.max(initial=-1)) + 1):
        corners = charts.uv[charts.faces[charts.chart == chart]]
        least = 1e-5 * float(np.ptp(corners.reshape(-1, 2), axis=0).max())
        for n in range(len(corners)):
            low, high = corners[n].min(axis=0), corners[n].max(axis=0)
            near = (corners[:n].min(axis=1) < high).all(axis=1)
            near &= (corners[:n].max(axis=1) > low).all(axis=1)
            count += sum(overlap(corners[n], corners[m], least) for m in np.flatnonzero(near))
    return count


def moebius(segments: int = 60) -> Triangles:
    """A band with one twist, and so one side."""
    t = 2.0 * np.pi * np.arange(segments) / segments
    points = [
        ((1 + s * math.cos(a / 2)) * math.cos(a), (1 + s * math.cos(a / 2)) * math.sin(a), s * math.sin(a / 2))
        for a in t
        for s in (-0.3, 0.3)
    ]  # fmt: skip
    i = 2 * np.arange(segments)
    c, d = (i + 2) % (2 * segments), (i + 3) % (2 * segments)
    c[-1], d[-1] = 1, 0
    faces = np.concatenate([np.stack([i, c, i + 1], axis=1), np.stack([i + 1, c, d], axis=1)])
    return Triangles(np.array(points), faces.astype(np.int32))


def torus(columns: int = 48, rows: int = 24) -> Triangles:
    p, q = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    a, b = 2 * np.pi * p / columns, 2 * np.pi * q / rows
    r = 1.0 + 0.4 * np.cos(b)
    points = np.stack([r * np.cos(a), r * np.sin(a), 0.4 * np.sin(b)], axis=-1).reshape(-1, 3)
    i, j, k, m = (
        (x % columns * rows + y % rows).reshape(-1)
        for x, y in ((p, q), (p + 1, q), (p + 1, q + 1), (p, q + 1))
    )
    faces = np.concatenate([np.stack([i, j, k], axis=1), np.stack([i, k, m], axis=1)])
    return Triangles(points, faces.astype(np.int32))


def fins() -> Triangles:
    """Five triangles on one edge."""
    t = 2.0 * np.pi * np.arange(5) / 5
    rim = np.stack([np.cos(t), np.sin(t), np.full(5, 0.5)], axis=1)
    faces = np.stack([np.zeros(5), np.ones(5), 2 + np.arange(5)], axis=1).astype(np.int32)
    return Triangles(np.concatenate([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], rim]), faces)


def helix(turns: int = 3, segments: int = 40) -> Triangles:
    """A spiral ramp, which lies over itself when it is seen from above."""
    t = 2.0 * np.pi * np.arange(turns * segments + 1) / segments
    rows = [np.stack([r * np.cos(t), r * np.sin(t), 0.05 * t], axis=1) for r in (0.5, 1.0)]
    i, n = np.arange(len(t) - 1), len(t)
    faces = np.concatenate([np.stack([i, i + n, i + n + 1], 1), np.stack([i, i + n + 1, i + 1], 1)])
    return Triangles(np.concatenate(rows), faces.astype(np.int32))


def random_faces() -> Triangles:
    """Faces between random vertices: almost every edge is wrong in some way."""
    rng = np.random.default_rng(1)
    return Triangles(rng.random((40, 3)), rng.integers(0, 40, (150, 3)).astype(np.int32))


def card() -> Triangles:
    front = patch((0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 2, 0))
    return Triangles(front.vertices, np.concatenate([front.faces, flipped(front).faces]))


SHAPES = {
    "box": box(),
    "unwelded box": unwelded(box()),
    "open box": box(without=("+z",)),
    "sphere": icosphere(3),
    "torus": torus(),
    "moebius": moebius(),
    "fins": fins(),
    "the same box twice": joined(box(), box()),
    "two-sided card": card(),
    "disc": disc(1.0, 0.0, 100),
    "helix": helix(),
    "random faces": random_faces(),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("timeout", [300.0, 1e-9])
def test_every_face_with_an_area_has_one_sound_place(name: str, timeout: float) -> None:
    shape = SHAPES[name]
    charts = unwrapped(shape, timeout=timeout)
    area = surface_areas(shape)
    placed = charts.chart >= 0
    assert charts.hurried == (timeout < 1.0)
    assert (placed == (area > 0.0)).all()
    assert (charts.source[charts.faces] == shape.faces).all()
    assert (signed_areas(charts.uv[charts.faces])[placed] > 0.0).all()
    assert signed_areas(charts.uv[charts.faces]).sum() == pytest.approx(area.sum(), rel=0.01)
    assert laps(charts) == 0


def test_new_vertices_are_no_more_than_charts_need() -> None:
    charts = unwrapped(icosphere(3))
    rows = np.concatenate([charts.source[:, None], charts.uv], axis=1)
    assert len(np.unique(rows, axis=0)) == len(rows)
    assert sorted(set(charts.faces.reshape(-1).tolist())) == list(range(len(rows)))
    of = np.full(len(rows), -1)
    of[charts.faces] = charts.chart[:, None]
    assert (of[charts.faces] == charts.chart[:, None]).all()


def test_a_box_has_a_chart_for_each_side_whether_it_is_welded_or_not() -> None:
    for shape in (box(), unwelded(box())):
        charts = unwrapped(shape)
        assert charts.chart.max() + 1 <= 6
    assert unwrapped(unwelded(icosphere(3))).chart.max() == unwrapped(icosphere(3)).chart.max()


@pytest.mark.parametrize("shape", [tube(1.0, 0.0, 3.0, 64), moebius(), disc(2.0, 0.0, 50)])
def test_what_unrolls_is_laid_flat_in_one_piece_without_stretch(shape: Triangles) -> None:
    """A cylinder, a disc, and a band one triangle wide can be unrolled: every edge keeps its length."""
    charts = unwrapped(shape)
    p, q = shape.vertices[shape.faces], charts.uv[charts.faces]
    lengths = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2)
    flat = np.linalg.norm(np.roll(q, -1, axis=1) - q, axis=2)
    assert charts.chart.max() == 0
    assert np.abs(flat / lengths - 1.0).max() < 1e-3


def test_stretch_of_a_sphere_in_parts_is_low() -> None:
    """L2 stretch (Sander et al., 2001): 1 for an isometry; each chart was allowed 1.05."""
    shape = icosphere(5)
    charts = unwrapped(shape)
    p, q = shape.vertices[shape.faces], charts.uv[charts.faces]
    e1, e2, f1, f2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
    doubled = 2.0 * signed_areas(q)[:, None]
    along, across = (
        (e1 * f2[:, 1:] - e2 * f1[:, 1:]) / doubled,
        (e2 * f1[:, :1] - e1 * f2[:, :1]) / doubled,
    )
    squared = 0.5 * ((along**2).sum(axis=1) + (across**2).sum(axis=1))
    area = surface_areas(shape)
    assert math.sqrt((squared * area).sum() / area.sum()) < 1.01
    assert charts.chart.max() + 1 < 40


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_size_does_not_change_the_charts(size: float) -> None:
    shape = subdivided(torus())
    small, large = unwrapped(shape), unwrapped(moved(shape, size))
    assert (small.chart == large.chart).all()
    np.testing.assert_allclose(
        large.uv[large.faces], size * small.uv[small.faces], atol=1e-4 * size
    )


def test_the_layout_does_not_depend_on_threads() -> None:
    shape = joined(icosphere(4), moved(torus(), 1.0, (3.0, 0.0, 0.0)))
    one, four = unwrapped(shape, threads=1), unwrapped(shape, threads=4)
    for field in dataclasses.fields(Charts):
        if field.name != "hurried":
            assert getattr(one, field.name).tobytes() == getattr(four, field.name).tobytes()


def test_faces_that_cannot_be_used_have_no_place() -> None:
    vertices = np.concatenate([box().vertices, [[np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]]])
    faces = np.concatenate([box().faces, [[0, 1, 8], [9, 2, 3], [0, 0, 1], [4, 5, 5]]])
    charts = unwrapped(Triangles(vertices, faces.astype(np.int32)))
    assert (charts.chart[:12] >= 0).all()
    assert (charts.chart[12:] == -1).all()
    assert (charts.uv[charts.faces[12:]] == 0.0).all()
    assert (charts.source[charts.faces] == faces).all()


def test_nothing_to_unwrap_gives_nothing() -> None:
    empty = Triangles(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    speck = Triangles(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))
    assert unwrap([], AtlasSettings()) == []
    assert unwrapped(empty).faces.shape == (0, 3)
    assert unwrapped(speck).chart.tolist() == [-1]


def test_progress_counts_every_face_once_and_may_stop_the_work() -> None:
    seen: list[tuple[int, int]] = []
    shapes = [mesh_of(box()), mesh_of(icosphere(4)), mesh_of(torus())]
    unwrap(shapes, AtlasSettings(), progress=lambda done, total: seen.append((done, total)))
    total = sum(len(m.faces) for m in shapes)
    assert seen[-1] == (total, total)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)

    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        unwrap(shapes, AtlasSettings(), progress=stop)


def test_a_chart_that_is_folded_over_is_cut_and_a_flipped_face_leaves_it() -> None:
    """Two ways to lay four squares of a strip: the last two back over the first, or one corner pulled across."""
    strip = patch((0, 0, 0), (4, 0, 0), (4, 1, 0), (0, 1, 0), 4, 1)
    dual = dual_of(strip.vertices, strip.faces)
    folded = np.where(
        strip.vertices[:, :1] > 2.0, 4.0 - strip.vertices[:, :1], strip.vertices[:, :1]
    )
    for flat in (folded, strip.vertices[:, :1] + 3.0 * (strip.vertices[:, :1] == 0.0)):
        uv = np.concatenate([flat, strip.vertices[:, 1:2]], axis=1)[strip.faces]
        charts = mended(dual, uv, np.zeros(8, np.int32))
        assert len(charts) > 1
        assert (signed_areas(uv) > 0.0).all()
        number = np.arange(24, dtype=np.int32).reshape(8, 3)
        found = Charts(
            source=number.reshape(-1),
            faces=number,
            uv=uv.reshape(-1, 2),
            chart=charts.of,
            hurried=False,
        )
        assert laps(found) == 0


def test_parts_are_cut_without_metis_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = icosphere(4)
    monkeypatch.setattr(partition, "_by_metis", lambda *_: None)
    charts = unwrapped(shape)
    assert (charts.chart >= 0).all()
    assert laps(charts) == 0
    part = partition.parts_of(
        dual_of(shape.vertices, shape.faces), np.arange(5120, dtype=np.int32), 7
    )
    assert np.bincount(part).min() > 0.9 * 5120 / 7

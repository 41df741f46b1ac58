"""What holds for every mesh: invariance, monotony, bounds; on meshes that hypothesis makes up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aobake import BakedVertices, BakeSettings, Scene, bake_vertices, visibility
from tests.scenes import (
    FloatArray,
    Triangles,
    box,
    floor,
    icosphere,
    joined,
    moved,
    rotation,
    subdivided,
)

bounded = settings(
    max_examples=20,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)

SEEDS = st.integers(0, 2**31)
ANGLES = st.floats(0.0, 6.0)
AXES = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda a: sum(x * x for x in a) > 0.01)


def still_life(seed: int) -> Triangles:
    """A few convex bodies that touch nothing, over a floor of squares: no contact is decided by an ulp."""
    rng = np.random.default_rng(seed)
    parts = [floor(2.0, 0.0, 6)]
    for place in rng.permutation(9)[:4]:
        at = np.array([place // 3 - 1.0, place % 3 - 1.0, 0.45]) + rng.uniform(-0.05, 0.05, 3)
        turn = rotation(rng.standard_normal(3), 3.0 * rng.random())
        body = icosphere(1, 0.4) if rng.random() < 0.5 else moved(box(), 0.45)
        parts.append(moved(body, turn, at))
    return joined(*parts)


def bake(mesh: Triangles, **more: float | None) -> BakedVertices:
    return bake_vertices(
        Scene.from_arrays(*mesh), BakeSettings(rays=256, max_distance=more.get("max_distance"))
    )


def same(one: BakedVertices, other: BakedVertices, chosen: NDArray[np.int64] | None = None) -> bool:
    """Whether two bakes agree: 98 % of the vertices within four standard errors, none beyond eight."""
    index = slice(None) if chosen is None else chosen
    count = len(one.ao[0])
    ao, error = other.ao[0][index][:count], other.standard_error[0][index][:count]
    ratio = np.abs(one.ao[0] - ao) / (np.hypot(one.standard_error[0], error) + 1e-6)
    return bool((ratio <= 4.0).mean() >= 0.98 and ratio.max() <= 8.0)


@bounded
@given(SEEDS, AXES, ANGLES)
def test_a_rotation_changes_nothing(
    seed: int, axis: tuple[float, float, float], angle: float
) -> None:
    mesh = still_life(seed)
    assert same(bake(mesh), bake(moved(mesh, rotation(axis, angle))))


@bounded
@given(SEEDS, st.floats(-9.0, 9.0))
def test_a_scale_changes_nothing(seed: int, exponent: float) -> None:
    mesh = still_life(seed)
    assert same(bake(mesh), bake(moved(mesh, 10.0**exponent)))


@bounded
@given(SEEDS, st.tuples(*[st.floats(-1e6, 1e6)] * 3))
def test_a_translation_changes_nothing(seed: int, shift: tuple[float, float, float]) -> None:
    mesh = still_life(seed)
    assert same(bake(mesh), bake(moved(mesh, 1.0, shift)))


@bounded
@given(SEEDS, SEEDS)
def test_the_order_of_faces_and_of_their_corners_changes_nothing(seed: int, other: int) -> None:
    mesh, rng = still_life(seed), np.random.default_rng(other)
    rolled = np.stack([np.roll(face, rng.integers(3)) for face in mesh.faces])
    shuffled = Triangles(mesh.vertices, rolled[rng.permutation(len(rolled))].astype(np.int32))
    assert np.abs(bake(mesh).ao[0] - bake(shuffled).ao[0]).max() <= 3.0 / 256.0  # rays at edges


@bounded
@given(SEEDS, SEEDS)
def test_the_order_of_vertices_changes_nothing(seed: int, other: int) -> None:
    mesh = still_life(seed)
    order = np.random.default_rng(other).permutation(len(mesh.vertices))
    place = np.argsort(order)
    assert same(
        bake(mesh), bake(Triangles(mesh.vertices[order], place[mesh.faces].astype(np.int32))), place
    )


@bounded
@given(SEEDS)
def test_subdivided_faces_change_nothing_at_their_old_vertices(seed: int) -> None:
    mesh = still_life(seed)
    assert same(bake(mesh), bake(subdivided(mesh)))


@bounded
@given(SEEDS, st.integers(2, 3))
def test_duplicated_faces_change_nothing(seed: int, times: int) -> None:
    mesh = still_life(seed)
    doubled = Triangles(mesh.vertices, np.concatenate([mesh.faces] * times))
    assert np.abs(bake(mesh).ao[0] - bake(doubled).ao[0]).max() <= 3.0 / 256.0


def test_some_duplicated_faces_change_nothing() -> None:
    mesh = still_life(0)
    doubled = Triangles(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[::2]]))
    assert np.abs(bake(mesh).ao[0] - bake(doubled).ao[0]).max() <= 3.0 / 256.0


@bounded
@given(SEEDS, SEEDS)
def test_one_more_occluder_opens_nothing(seed: int, other: int) -> None:
    """The same rays go out: what was met before is met still."""
    mesh, rng = still_life(seed), np.random.default_rng(other)
    more = moved(
        icosphere(1), rng.uniform(0.1, 1.0), rng.uniform((-2.0, -2.0, 1.0), (2.0, 2.0, 5.0))
    )
    before, after = bake(mesh), bake(joined(mesh, more))
    assert float((after.ao[0][: len(mesh.vertices)] - before.ao[0]).max()) <= 3.0 / 256.0


@bounded
@given(SEEDS, st.floats(0.05, 5.0), st.floats(1.0, 10.0))
def test_a_longer_reach_opens_nothing(seed: int, reach: float, factor: float) -> None:
    mesh = still_life(seed)
    near, far = bake(mesh, max_distance=reach), bake(mesh, max_distance=factor * reach)
    endless = bake(mesh)
    assert float((far.ao[0] - near.ao[0]).max()) <= 1e-6
    assert float((endless.ao[0] - far.ao[0]).max()) <= 1e-6


# -- anything -------------------------------------------------------------------------------------


def soup(seed: int) -> Triangles:
    """Triangles with every kind of fault: twins, folds, needles, points, fins, extremes, NaN."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 40))
    vertices = rng.standard_normal((count, 3)) * 10.0 ** rng.uniform(-3.0, 3.0)
    for fault in rng.permutation(7)[: int(rng.integers(0, 5))]:
        i, j, k = rng.integers(0, count, 3)
        if fault == 0:
            vertices[i] = vertices[j]
        elif fault == 1:
            vertices[i] = 0.5 * (vertices[j] + vertices[k])
        elif fault == 2:
            vertices[i] = vertices[j] * (1.0 + 1e-12)
        elif fault == 3:
            vertices[i, rng.integers(3)] = rng.choice([np.nan, np.inf, -np.inf])
        elif fault == 4:
            vertices[i] *= 10.0 ** rng.uniform(-300.0, 30.0)
        elif fault == 5:
            vertices[:, rng.integers(3)] = 0.25
        else:
            vertices = np.round(vertices, 1)
    faces = rng.integers(0, count, (int(rng.integers(1, 80)), 3))
    faces = np.concatenate([faces, faces[::3, ::-1], faces[::5]])
    return Triangles(vertices, faces.astype(np.int32))


def chosen_settings(seed: int) -> BakeSettings:
    rng = np.random.default_rng(seed)
    limit = float(10.0 ** rng.uniform(-6.0, 6.0)) if rng.random() < 0.5 else None
    return BakeSettings(
        rays=int(rng.integers(1, 40)),
        tolerance=0.05 if rng.random() < 0.3 else None,
        max_rays=int(rng.integers(32, 200)),
        max_distance=limit,
        falloff="none" if limit is None else ("none", "linear", "smooth")[int(rng.integers(3))],
        backfaces="ignore" if rng.random() < 0.3 else "occlude",
        ground=(None, "+y", "+z")[int(rng.integers(3))],
    )


def normals_of_any_kind(seed: int, count: int) -> FloatArray | None:
    rng = np.random.default_rng(seed)
    if rng.random() < 0.5:
        return None
    normals = rng.standard_normal((count, 3))
    normals[rng.random(count) < 0.2] = 0.0
    normals[rng.random(count) < 0.1] = np.nan
    return normals


@settings(bounded, max_examples=80)
@given(SEEDS)
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning", "ignore:invalid value:RuntimeWarning")
def test_any_soup_bakes_to_finite_values_between_0_and_1(seed: int) -> None:
    mesh = soup(seed)
    scene = Scene.from_arrays(*mesh, normals=normals_of_any_kind(seed, len(mesh.vertices)))
    result = bake_vertices(scene, chosen_settings(seed))
    for values in (*result.ao, *result.standard_error):
        assert values.shape == (len(mesh.vertices),)
        assert np.isfinite(values).all()
    assert float(result.ao[0].min()) >= 0.0
    assert float(result.ao[0].max()) <= 1.0
    assert all("\n" not in warning for warning in result.warnings)


@settings(bounded, max_examples=40)
@given(SEEDS)
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning", "ignore:invalid value:RuntimeWarning")
def test_any_points_in_any_soup_have_finite_values_between_0_and_1(seed: int) -> None:
    mesh, rng = soup(seed), np.random.default_rng(seed)
    points = mesh.vertices[rng.integers(0, len(mesh.vertices), 30)]
    points[::2] *= 1.0 + 1e-9 * rng.standard_normal((15, 3))
    normals = rng.standard_normal((30, 3))
    normals[3] = 0.0
    above = None if rng.random() < 0.5 else rng.standard_normal((30, 3))
    estimate = visibility(Scene.from_arrays(*mesh), points, normals, chosen_settings(seed), above)
    assert np.isfinite(estimate.mean).all()
    assert np.isfinite(estimate.standard_error).all()
    assert float(estimate.mean.min()) >= 0.0
    assert float(estimate.mean.max()) <= 1.0

"""Seams: found where they are, and gone after they were made equal."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.atlas.seams import Seams, equalised, find_seams, joined_seams
from tests.atlas.patched import Patched, Surface, cube, cylinder, lookup, patched, sphere

Float32Array = NDArray[np.float32]

NOISE = 0.02


def seams_of(patches: Patched) -> Seams:
    return find_seams(patches.vertices, patches.faces, patches.uv, patches.normals)


def shading(patches: Patched, noise: float) -> tuple[Float32Array, Float32Array]:
    """A page of something smooth over the surface with noise on it, and its standard errors."""
    x, y, z = np.moveaxis(patches.position, -1, 0)
    smooth = 0.5 + 0.3 * np.sin(3.0 * x + 1.0) * np.cos(2.0 * y) + 0.1 * np.sin(z)
    page = smooth + np.random.default_rng(2).normal(0.0, noise, smooth.shape)
    return np.clip(page, 0.0, 1.0).astype(np.float32), np.full(smooth.shape, noise, np.float32)


def steps(image: Float32Array, seams: Seams, places: int = 50) -> NDArray[np.float64]:
    """(E, places): how far the two sides of each seam are apart, at places of no regular order."""
    share = np.random.default_rng(4).random((len(seams.uv), 1, places, 1))
    start, end = seams.uv[:, :, np.newaxis, 0], seams.uv[:, :, np.newaxis, 1]
    values = lookup(image, start + share * (end - start))
    return np.asarray(np.abs(values[:, 0] - values[:, 1]))


@pytest.mark.parametrize("surface", [sphere, cylinder, cube])
@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_no_step_is_left_at_smooth_seams(surface: Surface, noise: float) -> None:
    """Before, the step is that of two noisy texels; after, below a hundredth everywhere."""
    patches = patched(surface, rows=4, columns=8, size=512, padding=8)
    seams = seams_of(patches)
    values, error = shading(patches, noise)
    after = equalised(values, error, patches.chart >= 0, seams)
    assert steps(values, seams)[seams.smooth].max() > 2.0 * noise
    assert steps(after, seams)[seams.smooth].max() <= 0.01


def test_a_surface_of_patches_has_a_seam_wherever_two_meet() -> None:
    """3 x 8 patches of 4 x 4 squares, closed around: 24 upright borders and 16 lying ones, of 4 edges each."""
    seams = seams_of(patched(cylinder, rows=3, columns=8, size=256, padding=4))
    assert len(seams.uv) == (24 + 16) * 4
    assert seams.smooth.all()


def test_both_sides_of_a_seam_are_the_same_points_in_the_same_order() -> None:
    patches = patched(sphere, rows=2, columns=4, size=256, padding=4)
    where = {
        tuple(uv): tuple(place)
        for uv, place in zip(
            patches.uv.reshape(-1, 2), patches.vertices[patches.faces].reshape(-1, 3), strict=True
        )
    }
    for one, other in seams_of(patches).uv:
        assert [where[tuple(uv)] for uv in one] == [where[tuple(uv)] for uv in other]


def test_the_edges_of_a_cube_are_creases() -> None:
    """Of 8 upright borders, 4 are edges of the cube; lying ones run across its sides."""
    seams = seams_of(patched(cube, rows=2, columns=8, size=256, padding=4))
    assert len(seams.uv) == (2 * 8 + 8) * 4
    assert (~seams.smooth).sum() == 2 * 4 * 4


def test_a_step_at_a_crease_stays() -> None:
    patches = patched(cube, rows=1, columns=4, size=256, padding=8)
    page = (patches.chart % 2).astype(np.float32)
    after = equalised(page, np.full_like(page, 0.02), patches.chart >= 0, seams_of(patches))
    assert (after == page).all()


def test_a_mesh_without_cuts_has_no_seams() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    normals = np.broadcast_to([0.0, 0.0, 1.0], (2, 3, 3))
    assert len(find_seams(vertices, faces, vertices[faces][..., :2], normals).uv) == 0


def test_without_faces_there_are_no_seams_and_nothing_moves() -> None:
    none = find_seams(
        np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros((0, 3, 2)), np.zeros((0, 3, 3))
    )
    page = np.random.default_rng(1).random((8, 8), np.float32)
    for seams in (none, joined_seams([]), joined_seams([none, none])):
        assert len(seams.uv) == 0
        assert (equalised(page, page, np.ones((8, 8), bool), seams) == page).all()


def test_a_page_of_one_value_stays() -> None:
    patches = patched(sphere, rows=3, columns=4, size=256, padding=6)
    page = np.full((256, 256), 0.4, np.float32)
    assert (equalised(page, page, patches.chart >= 0, seams_of(patches)) == page).all()


def test_only_texels_that_a_lookup_on_a_seam_reads_move() -> None:
    """The middle of every patch stays, to the last bit; so do texels that no chart covers."""
    patches = patched(cylinder, rows=3, columns=4, size=256, padding=6)
    values, error = shading(patches, NOISE)
    seams = seams_of(patches)
    after = equalised(values, error, patches.chart >= 0, seams)
    share = np.linspace(0.0, 1.0, 400)[:, np.newaxis]
    places = (seams.uv[:, :, :1] + share * (seams.uv[:, :, 1:] - seams.uv[:, :, :1])) * 256 - 0.5
    near = np.zeros((256, 256), bool)
    for dy in (0, 1):
        for dx in (0, 1):
            corner = np.floor(places.reshape(-1, 2)).astype(int)
            near[corner[:, 1] + dy, corner[:, 0] + dx] = True
    assert (after[~near] == values[~near]).all()
    assert (after[near] != values[near]).any()


def test_the_noisier_side_moves() -> None:
    """Two texels meet at a seam, one ten times as sure as the other."""
    seams = Seams(
        uv=np.array([[[[0.25, 0.25], [0.25, 0.75]], [[0.75, 0.25], [0.75, 0.75]]]]),
        smooth=np.array([True]),
    )
    page = np.array([[0.3, 0.4], [0.3, 0.4]], np.float32)
    sure = np.array([[0.01, 0.1], [0.01, 0.1]], np.float32)
    after = equalised(page, sure, np.ones((2, 2), bool), seams)
    assert after[0, 1] == pytest.approx(after[0, 0], abs=0.01)
    assert abs(after[0, 0] - 0.3) < 0.01


@pytest.mark.parametrize(("error", "moves"), [(0.002, False), (0.3, True)])
def test_a_step_that_no_noise_explains_stays(error: float, moves: bool) -> None:
    """Where a body passes through the surface one side is closed: the open one would be made black."""
    seams = Seams(
        uv=np.array([[[[0.25, 0.25], [0.25, 0.75]], [[0.75, 0.25], [0.75, 0.75]]]]),
        smooth=np.array([True]),
    )
    page = np.array([[0.0, 0.9], [0.0, 0.9]], np.float32)
    after = equalised(page, np.full_like(page, error), np.ones((2, 2), bool), seams)
    assert bool((after != page).any()) == moves


def test_beside_a_small_true_step_both_sides_keep_their_values() -> None:
    """Something stands on a seam: one side of it is darker, by many times the noise of either."""
    patches = patched(cylinder, rows=1, columns=4, size=256, padding=8)
    truth, noise = np.where(patches.chart % 2 == 0, 0.35, 0.42), 0.001
    rng = np.random.default_rng(3)
    page = (truth + rng.normal(0.0, noise, truth.shape)).astype(np.float32)
    after = equalised(page, np.full_like(page, noise), patches.chart >= 0, seams_of(patches))
    assert np.abs(after - page).max() < 0.005


def test_a_page_of_few_rays_gets_no_worse() -> None:
    """What noise explains is closed, and that takes noise away on both sides."""
    patches = patched(sphere, rows=4, columns=8, size=256, padding=8)
    seams, covered = seams_of(patches), patches.chart >= 0
    truth = shading(patches, 0.0)[0]
    values, error = shading(patches, 0.05)
    after = equalised(values, error, covered, seams)
    moved = covered & (after != values)
    assert rms(after - truth, moved) < 0.9 * rms(values - truth, moved)


def rms(difference: Float32Array, chosen: NDArray[np.bool_]) -> float:
    return float(np.sqrt(np.mean(np.square(difference[chosen], dtype=np.float64))))


def test_values_stay_in_range() -> None:
    patches = patched(sphere, rows=3, columns=4, size=256, padding=6)
    page = np.random.default_rng(6).integers(0, 2, (256, 256)).astype(np.float32)
    after = equalised(page, np.full_like(page, 0.1), patches.chart >= 0, seams_of(patches))
    assert after.min() >= 0.0
    assert after.max() <= 1.0
    assert np.isfinite(after).all()

"""Rays through what alpha says is not there."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake import BakeSettings, Instance, Scene, bake_vertices, visibility
from aobake.atlas.lookup import sample
from aobake.meshes.scene import Attribute, Material, Mesh, Wrap
from aobake.settings import Falloff
from aobake.tracing.cutouts import CutOut, pass_through_holes
from aobake.tracing.world import Placement, Triangles, build_world
from tests.cards import UNIT, hole, image_of, overhead, scene_of, sheet
from tests.known import disc_factor, plane_with_falloff, rectangle_factor
from tests.scenes import TURNED, UP, FloatArray, affine, floor, patch
from tests.tracing.rays import occluded

AT_ORIGIN = np.zeros((16, 3)), np.tile(UP, (16, 1))
SQUARE = 4.0 * rectangle_factor(1.0, 1.0, 0.5)  # what a sheet at 0.5 takes of the origin's sky


def seen(scene: Scene, rays: int = 1024, **settings: object) -> float:
    """The mean over 16 points at the origin, each with directions of its own."""
    chosen = BakeSettings(rays=rays, **settings)  # type: ignore[arg-type]
    return float(visibility(scene, *AT_ORIGIN, chosen).mean.mean())


def asked_everywhere(cutout: CutOut, places: FloatArray) -> NDArray[np.bool_]:
    """Whether rays straight up stop at a unit square at places (N, 2) in [0, 1]^2."""
    square = patch((0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1))
    order = square.vertices[square.faces][..., :2]
    corners = cutout.corners.copy()
    corners[..., :2] = order * (corners[0, 0, :2]) - 0.5
    used = replace(cutout, corners=corners)
    part = Triangles(square.vertices, square.faces.astype(np.uint32), pass_through_holes(used))
    world = build_world([part], [Placement(0, np.eye(3, 4))])
    origins = np.column_stack([places, np.zeros(len(places))])
    return occluded(
        world.tree,
        world.frame.apply(origins).astype(np.float32),
        np.tile(np.float32(UP), (len(places), 1)),
    )


@pytest.mark.parametrize("nearest", [False, True])
@pytest.mark.parametrize("grain", [1, 11])
@pytest.mark.parametrize(
    "wrap", list(itertools.product(("repeat", "mirror", "clamp"), repeat=2)), ids="-".join
)
def test_alpha_is_looked_up_as_a_renderer_does(
    wrap: tuple[Wrap, Wrap], grain: int, nearest: bool
) -> None:
    """The oracle is the lookup of colours; places beside the cutoff are left to rounding."""
    rng = np.random.default_rng(3)
    alpha = np.kron(rng.integers(0, 256, (5, 7)), np.ones((grain, grain))).astype(np.uint8)
    periods, size = np.array([3.3, 2.7]), (7 * grain, 5 * grain)
    corners = np.zeros((2, 3, 3), np.float32)
    corners[..., :2], corners[..., 2] = periods * size, 0.8
    cutout = CutOut(corners=corners, alpha=alpha, edges=wrap, nearest=nearest, cutoff=0.4)
    places = rng.uniform(0.001, 0.999, (4000, 2))
    expected = (
        0.8 * sample((alpha / 255.0).astype(np.float32), places * periods, wrap, nearest)[:, 0]
    )
    clear = np.abs(expected - 0.4) > 1e-3
    if nearest:
        pixel = places * periods * size
        clear &= (np.abs(pixel - np.round(pixel)) > 1e-3).all(axis=1)
    stopped = asked_everywhere(cutout, places)
    assert clear.sum() > 3000
    assert np.array_equal(stopped[clear], (expected >= 0.4)[clear])
    assert 0.2 < stopped.mean() < 0.8


@pytest.mark.parametrize("radius", [0.3, 0.6, 0.9])
def test_a_disc_cut_out_of_a_sheet_lets_through_what_a_disc_covers(radius: float) -> None:
    """A = 1 - square + disc, and 1 - disc for the sheet that has a disc of it left."""
    sky = 1.0 - SQUARE + disc_factor(radius, 0.5)
    assert abs(seen(overhead(hole(256, radius))) - sky) < 2e-3
    left = overhead(hole(256, radius, inside=1.0, outside=0.0))
    assert abs(seen(left) - (1.0 - disc_factor(radius, 0.5))) < 2e-3


@pytest.mark.parametrize("alpha", [0.1, 0.5, 0.75])
def test_a_blended_sheet_takes_its_share(alpha: float) -> None:
    """A = 1 - alpha F, whether alpha is the factor's or the texture's."""
    stored = round(alpha * 255.0) / 255.0
    textured = overhead(np.full((4, 4), alpha), alpha_mode="BLEND")
    plain = overhead(None, alpha_mode="BLEND", base_color=(1.0, 1.0, 1.0, alpha))
    assert abs(seen(textured, rays=4096) - (1.0 - stored * SQUARE)) < 3e-3
    assert abs(seen(plain, rays=4096) - (1.0 - alpha * SQUARE)) < 3e-3


def spread_out(scene: Scene, settings: BakeSettings, sky: float) -> tuple[FloatArray, FloatArray]:
    """How far off 400 points under wide sheets are, each with directions of its own, and what they say of it."""
    points = np.random.default_rng(5).uniform(-1.0, 1.0, (400, 3)) * (1.0, 1.0, 0.0)
    found = visibility(scene, points, np.tile(UP, (400, 1)), settings)
    return found.mean.astype(np.float64) - sky, found.standard_error.astype(np.float64)


def blended(shares: Sequence[float], half: float = 1e4) -> Scene:
    return scene_of(
        [sheet(half, 1.0 + 0.1 * k, material=k) for k in range(len(shares))],
        [Material(alpha_mode="BLEND", base_color=(1.0, 1.0, 1.0, share)) for share in shares],
    )


@pytest.mark.parametrize("shares", [(0.5,), (0.3, 0.5, 0.7), (0.5,) * 6])
def test_sheets_behind_each_other_take_their_shares_without_noise(shares: Sequence[float]) -> None:
    """A = product of 1 - alpha at every point. A ray along an edge of two triangles may meet both."""
    sky = float(np.prod(1.0 - np.array(shares)))
    wrong, error = spread_out(blended(shares), BakeSettings(rays=256), sky)
    by_chance = np.sqrt(sky * (1.0 - sky) / 256)
    assert np.sqrt((wrong**2).mean()) < 0.04 * by_chance
    assert (np.abs(wrong) <= 2.0 * error).all()
    solid = scene_of([sheet(1e4, 1.0)], [Material()])
    opaque = spread_out(solid, BakeSettings(rays=256), 0.0)[1]
    assert error.max() < 1.5 * opaque.max(), "hardly more than under a sheet that stops all"


@pytest.mark.parametrize("share", [0.6, 0.9])
def test_the_error_beside_a_blended_edge_is_honest(share: float) -> None:
    """A = 1 - alpha F of a square that takes a part of the sky; errors come from its outline alone."""
    scene = blended((share,), half=1.0)
    places = np.zeros((400, 3)), np.tile(UP, (400, 1))
    found = visibility(scene, *places, BakeSettings(rays=256))
    wrong = found.mean - (1.0 - share * 4.0 * rectangle_factor(1.0, 1.0, 1.0))
    assert (np.abs(wrong) <= 2.0 * found.standard_error).mean() >= 0.93
    rms = float(np.sqrt((wrong**2).mean()))
    assert np.sqrt((found.standard_error**2).mean()) < 2.0 * rms


FADING = BakeSettings(rays=256, max_distance=1e9, falloff="linear")  # asks for the nearest hits


def test_where_the_nearest_hit_counts_sheets_are_drawn_independently() -> None:
    """Two triangles of a wide sheet, and three sheets."""
    shares = (0.3, 0.5, 0.7)
    sky = float(np.prod(1.0 - np.array(shares)))
    wrong, _ = spread_out(blended(shares), replace(FADING, rays=1024), sky)
    assert abs(wrong.mean()) < 2e-3
    assert np.sqrt((wrong**2).mean()) < 0.0096  # of independent draws


def test_a_share_is_drawn_more_evenly_than_by_chance() -> None:
    wrong, error = spread_out(blended((0.5,)), FADING, 0.5)
    rms = float(np.sqrt((wrong**2).mean()))
    assert rms < 0.25 * np.sqrt(0.25 / 256)
    assert rms < float(np.sqrt((error**2).mean())) < 5.0 * rms


@pytest.mark.parametrize("falloff", ["linear", "smooth"])
def test_a_falloff_looks_through_holes_for_the_nearest_surface(falloff: Falloff) -> None:
    """A near sheet that is not there, or half there, before a far one that is."""
    far = sheet(50.0, 0.6, material=1)
    for alpha, mode in ((0.2, "MASK"), (0.5, "BLEND")):
        thin = Material(base_color=(1.0, 1.0, 1.0, alpha), alpha_mode=mode)  # type: ignore[arg-type]
        scene = scene_of([sheet(50.0, 0.2), far], [thin, Material()])
        share = 0.5 if mode == "BLEND" else 0.0
        truth = share * plane_with_falloff(0.2, falloff)
        truth += (1.0 - share) * plane_with_falloff(0.6, falloff)
        assert abs(seen(scene, max_distance=1.0, falloff=falloff) - truth) < 5e-3


def test_instances_see_their_own_holes() -> None:
    """A sheet with a hole that stands in many places, turned and mirrored, equals sheets with holes of their own."""
    mesh, material = sheet(1.0, 0.0), overhead(hole(64, 0.7)).materials[0]
    transforms = []
    for k in range(6):
        linear = TURNED if k % 2 else np.diag([1.0, -1.0 if k % 3 else 1.0, 1.0])
        transforms.append(affine(linear, (k % 3 - 1.0, k // 3 - 0.5, 0.5 + 0.2 * k)))
    image = (image_of(hole(64, 0.7)),)
    placed = scene_of([mesh], [material], image, transforms)
    alone = Scene(
        meshes=tuple(
            replace(mesh, vertices=mesh.vertices @ t[:3, :3].T + t[:3, 3]) for t in transforms
        ),
        instances=tuple(Instance(mesh=number) for number in range(6)),
        materials=(material,),
        images=image,
    )
    points = np.random.default_rng(7).uniform(-1.0, 1.0, (200, 3)) * (1.0, 1.0, 0.2)
    settings = BakeSettings(rays=256)
    one, other = (
        visibility(scene, points, np.tile(UP, (200, 1)), settings).mean for scene in (placed, alone)
    )
    assert np.abs(one - other).mean() < 1e-4  # rays at the edges of holes
    assert np.abs(one - other).max() < 0.02
    assert 0.2 < float(one.mean()) < 0.8


@pytest.mark.parametrize("mirrored", [False, True])
def test_holes_and_backs_are_passed_through_together(mirrored: bool) -> None:
    """Two sheets, each with a hole; where backs are ignored the one that looks up lets all rays through."""
    material = replace(overhead(hole(64, 0.5)).materials[0], double_sided=False)
    down, up = np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0]) if mirrored else np.diag([1, -1, -1, 1.0])
    up[2, 3] = 0.25
    down[2, 3] = 0.5
    scene = scene_of([sheet(1.0, 0.0)], [material], (image_of(hole(64, 0.5)),), [down, up])
    lower = scene_of([sheet(1.0, 0.25)], [material], (image_of(hole(64, 0.5)),))
    upper = scene_of([sheet(1.0, 0.5)], [material], (image_of(hole(64, 0.5)),))
    assert abs(seen(scene, backfaces="ignore") - seen(upper)) < 3e-3
    assert seen(scene, backfaces="occlude") < seen(lower) + 3e-3
    both = replace(scene, materials=(replace(material, double_sided=True),))
    assert abs(seen(both, backfaces="ignore") - seen(scene, backfaces="occlude")) < 1e-6


def test_vertex_alpha_fades_a_sheet() -> None:
    """Alpha that rises from 0 to 1 across a sheet, cut at a quarter, leaves three quarters of it."""
    mesh = sheet(1.0, 0.5)
    colors = np.ones((4, 4))
    colors[:, 3] = (mesh.vertices[:, 0] + 1.0) / 2.0
    faded = replace(mesh, attributes={"COLOR_0": Attribute(values=colors)})
    scene = scene_of([faded], [Material(alpha_mode="MASK", alpha_cutoff=0.25)])
    left = 2.0 * (rectangle_factor(1.0, 1.0, 0.5) + rectangle_factor(0.5, 1.0, 0.5))
    assert abs(seen(scene) - (1.0 - left)) < 2e-3


def test_a_texture_that_is_moved_moves_its_hole() -> None:
    """KHR_texture_transform: half the coordinates show a quarter of the picture, whose hole is elsewhere."""
    alpha = np.ones((64, 64))
    alpha[:32, :32] = 0.0
    quarter = np.array([[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]])
    shown = overhead(alpha, base_color_texture=replace(UNIT, transform=quarter, nearest=True))
    assert seen(shown) == 1.0
    moved_on = np.array([[0.5, 0.0, 0.5], [0.0, 0.5, 0.0]])
    hidden = overhead(alpha, base_color_texture=replace(UNIT, transform=moved_on, nearest=True))
    assert abs(seen(hidden) - (1.0 - SQUARE)) < 2e-3


def test_a_sheet_far_larger_than_what_is_beside_it_keeps_its_holes() -> None:
    """An opaque one would be split for the detail; the halves of this one are known by their numbers."""
    alpha = np.ones((2, 2))
    alpha[:, 0] = 0.0
    texture = replace(UNIT, nearest=True)
    wide = overhead(alpha, half=1e4, base_color_texture=texture)
    speck = Mesh(vertices=1e-3 * floor(1.0, -1.0).vertices, faces=floor(1.0).faces)
    scene = scene_of([*wide.meshes, speck], list(wide.materials), wide.images)
    assert abs(seen(scene) - 0.5) < 2e-3


def test_threads_and_order_change_no_bit() -> None:
    scene = overhead(hole(32, 0.5, inside=0.3, outside=0.8), alpha_mode="BLEND")
    points = np.random.default_rng(9).uniform(-1.0, 1.0, (3000, 3)) * (1.0, 1.0, 0.1)
    normals = np.tile(UP, (len(points), 1))
    one, other, again = (
        visibility(scene, points, normals, BakeSettings(rays=64, threads=threads, seed=seed)).mean
        for threads, seed in ((1, 0), (2, 0), (2, 1))
    )
    assert np.array_equal(one, other)
    assert not np.array_equal(one, again)


def test_a_card_has_the_value_of_the_side_that_its_normal_shows() -> None:
    """Two-sided or not: a sheet that looks down at a floor is as occluded as the floor is by it."""
    material = overhead(hole(64, 0.5)).materials[0]
    meshes = [sheet(1.0, 0.5, cells=2), replace(sheet(1.0, 0.0, cells=2), material=None)]
    under = replace(meshes[1], vertices=floor(1.0, 0.0, 2).vertices, faces=floor(1.0, 0.0, 2).faces)
    for sided in (False, True):
        scene = scene_of(
            [meshes[0], under],
            [replace(material, double_sided=sided)],
            (image_of(hole(64, 0.5)),),
        )
        card, ground = bake_vertices(scene, BakeSettings(rays=1024)).ao
        middle = int(np.argmin(np.abs(meshes[0].vertices[:, :2]).sum(axis=1)))
        assert abs(card[middle] - (1.0 - SQUARE)) < 5e-3
        assert abs(ground[middle] - (1.0 - SQUARE + disc_factor(0.5, 0.5))) < 5e-3

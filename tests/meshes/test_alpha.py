"""What alpha makes of faces: whole, holed or gone; what a plan is told; what is broken."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from aobake import BakeSettings, InputError, Scene, bake_texture, bake_vertices, visibility
from aobake.atlas.lookup import sample
from aobake.meshes.alpha import GONE, HOLED, WHOLE, alpha_of, scene_alpha
from aobake.meshes.scene import Attribute, Image, Material, Mesh, Texture, Wrap
from aobake.meshes.surfaces import surfaces_of
from aobake.meshes.texel_counts import BoxesOfPixels, marked_share, pixels_around
from aobake.prepare import Prepared, build
from tests.cards import UNIT, hole, image_of, overhead, scene_of, sheet
from tests.scenes import FloatArray, floor


def prepared(scene: Scene, *effects: str) -> Prepared:
    settings = BakeSettings(effect=effects)
    return build(scene, surfaces_of(scene, settings), settings)


def filtered(scene: Scene, *effects: str) -> list[int]:
    """Faces of each part that has a filter."""
    parts = prepared(scene, *effects).parts
    return [len(part.faces) for part in parts if part.hit_filter is not None]


def faces_in_tree(scene: Scene) -> int:
    return sum(len(part.faces) for part in prepared(scene).parts)


def cells(alpha: FloatArray, count: int, texture: Texture = UNIT) -> Scene:
    """A sheet of count x count cells below one picture."""
    scene = overhead(alpha, base_color_texture=texture)
    return replace(scene, meshes=(sheet(1.0, 0.5, count),))


def test_a_mask_without_a_hole_costs_nothing() -> None:
    scene = cells(np.ones((8, 8)), 4)
    assert filtered(scene) == []
    assert faces_in_tree(scene) == 32
    (use,) = alpha_of(scene)
    assert (use.on, use.mode, use.share_transparent) == (False, "MASK", 0.0)
    assert "material 'leaf' is MASK, but none of its faces has a texel below" in use.reason


@pytest.mark.parametrize(("value", "holed"), [(0.5, 1), (0.998, 1), (1.0, 0)])
def test_only_what_is_transparent_is_blended(value: float, holed: int) -> None:
    assert len(filtered(overhead(np.full((2, 2), value), alpha_mode="BLEND"))) == holed


def test_only_faces_with_a_hole_are_asked_about() -> None:
    """A quarter of the picture is empty: of 8 x 8 cells, those along its edge are holed."""
    alpha = np.ones((64, 64))
    alpha[:32, :32] = 0.0
    scene = cells(alpha, 8, Texture(image=0, wrap=("clamp", "clamp")))
    kinds = scene_alpha(scene).meshes[0].kinds
    assert [int((kinds == kind).sum()) for kind in (WHOLE, HOLED, GONE)] == [78, 32, 18]
    assert filtered(scene) == [32]
    assert faces_in_tree(scene) == 110
    (use,) = alpha_of(scene)
    assert use.on
    assert "material 'leaf' is MASK with 2" in use.reason


def test_a_material_that_is_not_there_leaves_nothing_to_trace() -> None:
    scene = cells(np.zeros((4, 4)), 2)
    assert faces_in_tree(scene) == 0
    assert np.array_equal(bake_vertices(scene, BakeSettings(rays=16)).ao[0], np.ones(9, np.float32))


def test_an_opaque_material_has_no_alpha_whatever_its_texture_says() -> None:
    scene = overhead(np.zeros((4, 4)), alpha_mode="OPAQUE")
    assert alpha_of(scene) == ()
    assert filtered(scene) == []


def test_an_effect_that_is_off_looks_at_nothing() -> None:
    assert filtered(overhead(hole(16, 0.5))) == [2]
    assert filtered(overhead(hole(16, 0.5)), "alpha=off") == []


def test_a_scene_is_decoded_once() -> None:
    asked = []
    given = image_of(hole(16, 0.5))

    def data() -> bytes:
        asked.append(1)
        return given.data()

    scene = replace(overhead(hole(16, 0.5)), images=(Image(name="leaf", data=data),))
    alpha_of(scene)
    prepared(scene)
    assert len(asked) == 1


def test_the_factor_and_vertices_fade_what_the_texture_shows() -> None:
    """Alpha 0.6 passes a cutoff of 0.5, and no longer does at 0.8 of it; vertices fade one end of a row."""
    texture = np.full((2, 2), 0.6)
    assert filtered(overhead(texture)) == []
    assert faces_in_tree(overhead(texture)) == 2
    assert faces_in_tree(overhead(texture, base_color=(1.0, 1.0, 1.0, 0.8))) == 0
    mesh = sheet(1.0, 0.5, cells=4)
    colors = np.ones((25, 4))
    colors[:, 3] = mesh.vertices[:, 0] > -0.75
    faded = replace(mesh, attributes={"COLOR_0": Attribute(values=colors)})
    scene = scene_of([faded], [Material(alpha_mode="MASK")])
    assert filtered(scene)[0] >= 8


def test_meshes_are_told_apart_where_one_material_is_on_both() -> None:
    whole = sheet(1.0, 0.5)
    corner = Attribute(values=whole.attributes["TEXCOORD_0"].values * 0.1)
    scene = overhead(hole(32, 0.5))
    meshes = [whole, replace(whole, attributes={"TEXCOORD_0": corner})]
    scene = scene_of(meshes, list(scene.materials), scene.images)
    assert list(scene_alpha(scene).meshes) == [0]


def test_faces_that_were_turned_or_left_out_keep_their_coordinates() -> None:
    """One triangle has no area, one is wound the wrong way: the hole of the last one stays where it was."""
    square = floor(1.0, 0.5)
    uv = (square.vertices[:, :2] + 1.0) / 2.0
    order = np.array([[0, 0, 1], square.faces[0, ::-1], square.faces[1]])
    meshes = [
        Mesh(
            vertices=square.vertices,
            faces=faces,
            normals=np.tile((0.0, 0.0, -1.0), (4, 1)),
            material=0,
            attributes={"TEXCOORD_0": Attribute(values=uv)},
        )
        for faces in (order, square.faces[:, ::-1])
    ]
    alpha = np.ones((32, 32))
    alpha[2:12, 16:30] = 0.0
    material = Material(alpha_mode="MASK", base_color_texture=UNIT)
    scenes = [scene_of([mesh], [material], (image_of(alpha),)) for mesh in meshes]
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 3)) * (1.0, 1.0, 0.0)
    up = np.tile((0.0, 0.0, 1.0), (50, 1))
    one, other = (visibility(scene, points, up, BakeSettings(rays=256)).mean for scene in scenes)
    assert np.abs(one - other).max() <= 2.0 / 256.0
    assert float(one.std()) > 0.02


def broken(kind: str) -> Scene:
    scene = overhead(hole(16, 0.5))
    if kind == "garbage":
        return replace(scene, images=(Image(name="leaf.png", data=lambda: b"\x89PNG no"),))
    if kind == "no image":
        return replace(scene, images=())
    return replace(scene, meshes=(replace(scene.meshes[0], attributes={}),))


@pytest.mark.parametrize("kind", ["garbage", "no image", "no coordinates"])
def test_what_is_broken_is_opaque_and_said(kind: str) -> None:
    scene = broken(kind)
    opaque = replace(scene, materials=(replace(scene.materials[0], alpha_mode="OPAQUE"),))
    settings = BakeSettings(rays=64, size=16, denoise="off")
    for bake in (bake_vertices, bake_texture):
        warnings = [line for line in bake(scene, settings).warnings if "counts as opaque" in line]
        assert len(warnings) == 1
        assert "material 'leaf'" in warnings[0]
        assert "\n" not in warnings[0]
        assert not any("counts as opaque" in line for line in bake(opaque, settings).warnings)
    assert np.array_equal(
        bake_vertices(scene, settings).ao[0], bake_vertices(opaque, settings).ao[0]
    )
    assert "cannot be used" in alpha_of(scene)[0].reason
    with pytest.raises(InputError, match="counts as opaque"):
        bake_vertices(scene, replace(settings, strict=True))


@pytest.mark.parametrize(
    "wrap", list(itertools.product(("repeat", "mirror", "clamp"), repeat=2)), ids="-".join
)
def test_shares_of_marked_pixels_are_those_of_counting(wrap: tuple[Wrap, Wrap]) -> None:
    rng = np.random.default_rng(4)
    marks = rng.random((5, 7)) < 0.4
    low = rng.integers(-30, 30, (200, 2))
    boxes = BoxesOfPixels(low, low + rng.integers(1, 25, (200, 2)))
    found = marked_share(marks, boxes, wrap)
    for k in range(200):
        x, y = np.meshgrid(*(np.arange(boxes.low[k, i], boxes.high[k, i]) + 0.5 for i in (0, 1)))
        if wrap[0] == "clamp":
            x = np.unique(np.clip(x, 0.5, 6.5), axis=1)
        if wrap[1] == "clamp":
            y = np.unique(np.clip(y, 0.5, 4.5), axis=0)
        x, y = np.meshgrid(x[0], y[:, 0])
        places = np.column_stack([x.ravel() / 7.0, y.ravel() / 5.0])
        values = sample(marks.astype(np.float32), places, wrap, nearest=True)
        assert found[k] == pytest.approx(float(values.mean()), abs=1e-6)


def test_lookups_touch_no_pixel_outside_of_the_box_around_a_face() -> None:
    rng = np.random.default_rng(6)
    image = rng.random((9, 9)).astype(np.float32)
    places = rng.uniform(0.0, 9.0, (40, 3, 2))
    for nearest in (False, True):
        boxes = pixels_around(places, 0.01, nearest=nearest)
        for k in range(40):
            weights = rng.dirichlet((1, 1, 1), 200)
            values = sample(image, weights @ places[k] / 9.0, ("clamp", "clamp"), nearest)
            x0, y0 = np.maximum(boxes.low[k], 0)
            part = image[y0 : boxes.high[k, 1], x0 : boxes.high[k, 0]]
            assert part.min() - 1e-6 <= values.min()
            assert values.max() <= part.max() + 1e-6

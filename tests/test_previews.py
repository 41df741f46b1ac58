"""Previews that bake what the asset lacks, and comparisons."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aobake.errors import SettingsError
from aobake.previews import check_comparison, compare, preview
from aobake.render_settings import RenderSettings
from aobake.settings import BakeSettings
from tests.pictures import DIM, attribute, scene_of
from tests.scenes import Triangles, box, joined, mesh_of, moved

SOME = BakeSettings(rays=16)
SMALL = dataclasses.replace(DIM, size="320x200", samples=1)


def niche() -> Triangles:
    """A box that is open towards the camera, with another one in it: dark in its corners."""
    return joined(moved(box(without=("+z",)), 1.6), moved(box(), 0.6, (0.2, -0.3, -0.2)))


def test_an_asset_without_occlusion_is_baked_for_its_picture() -> None:
    scene = scene_of(mesh_of(niche()))
    shown, plain = (
        preview(scene, dataclasses.replace(DIM, ao=ao), SOME) for ao in ("auto", "none")
    )
    assert "bake" in shown.seconds
    assert shown.effects["ambient_occlusion"].on
    assert shown.pixels[..., 0].min() < 0.6
    assert "bake" not in plain.seconds
    assert plain.pixels[plain.pixels[..., 3] == 1.0].min() == 1.0


def test_an_asset_with_occlusion_is_not_baked_again_unless_asked_for() -> None:
    inside = niche()
    held = attribute(np.full(len(inside.vertices), 0.25))
    scene = scene_of(mesh_of(inside, attributes={"_AO": held}))
    shown = preview(scene, DIM, SOME)
    assert "bake" not in shown.seconds
    assert shown.pixels[16, 16, 0] == pytest.approx(0.25)
    again = preview(scene, dataclasses.replace(DIM, ao="bake"), SOME)
    assert "bake" in again.seconds
    assert again.pixels[16, 16, 0] != pytest.approx(0.25)


def test_grey_vertex_colours_are_taken_for_occlusion_and_others_are_not() -> None:
    inside = niche()
    grey = np.repeat(np.linspace(0.2, 1.0, len(inside.vertices))[:, None], 3, axis=1)
    for colors, baked in (
        (grey, False),
        (grey * (1.0, 0.5, 0.2), True),
        (np.ones_like(grey), True),
    ):
        scene = scene_of(mesh_of(inside, attributes={"COLOR_0": attribute(colors)}))
        shown = preview(scene, DIM, SOME)
        assert ("bake" in shown.seconds) == baked
        assert shown.effects["vertex_colors"].on


def test_the_error_of_a_bake_is_shown() -> None:
    shown = preview(scene_of(mesh_of(niche())), dataclasses.replace(DIM, channel="error"), SOME)
    assert 0.0 < shown.pixels[..., 0].max() <= 1.0


def test_a_constant_ambient_term_stands_beside_ambient_occlusion() -> None:
    found = compare(scene_of(mesh_of(niche())), "ao", SMALL, SOME)
    assert found.pixels.shape == (200, 320, 3)
    assert list(found.effects) == ["constant ambient term", "ambient occlusion"]
    assert [shown["ambient_occlusion"].on for shown in found.effects.values()] == [False, True]
    assert not found.effects["ambient occlusion"]["lights"].on
    left, right = found.pixels[60:120, 60:100], found.pixels[60:120, 220:260]
    assert left.std() < right.std()


def test_every_model_is_on_the_sheet_of_models() -> None:
    from aobake.shading import MODELS

    settings = RenderSettings(size="600x400", samples=1)
    found = compare(scene_of(mesh_of(niche())), "models", settings, SOME)
    assert len(found.effects) == len(MODELS)
    assert {"Lambert", "Cook-Torrance", "Minnaert"} <= found.effects.keys()


def test_bakes_with_more_rays_are_less_rough() -> None:
    settings = dataclasses.replace(SMALL, channel="error")
    found = compare(scene_of(mesh_of(niche())), "rays=4,256", settings, SOME)
    assert list(found.effects) == ["4 rays", "256 rays"]
    assert found.pixels[40:120, 40:120].mean() > found.pixels[40:120, 200:280].mean()


@pytest.mark.parametrize("what", ["", "all", "rays", "rays=", "rays=0", "rays=4,x", "rays=-1"])
def test_comparisons_that_do_not_exist_are_refused(what: str) -> None:
    with pytest.raises(SettingsError, match=r"compare is .*(rays=16,64,256)"):
        check_comparison(what, SMALL, SOME)


def test_a_parameter_that_models_do_not_share_is_refused_for_all_of_them() -> None:
    with pytest.raises(SettingsError, match="sigma"):
        check_comparison("models", dataclasses.replace(SMALL, sigma=0.3), SOME)

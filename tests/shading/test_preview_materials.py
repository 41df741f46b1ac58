"""What previews show of materials: colours, textures, occlusion, and what lies behind."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aobake.errors import InputError
from aobake.meshes.scene import Material, Texture
from aobake.shading.preview import Preview, render
from tests.pictures import (
    BEAUTY,
    CARD_UV,
    DIM,
    attribute,
    card,
    image,
    middle,
    one_sun,
    scene_of,
)
from tests.scenes import mesh_of, moved


def test_base_colour_is_texture_times_factor_times_vertex_colour() -> None:
    pixels = np.zeros((2, 2, 3), np.float32)
    pixels[:, 0], pixels[:, 1] = (128 / 255, 0, 0), (0, 0, 1)
    paint = Material(
        base_color=(0.5, 1.0, 0.5, 1.0), base_color_texture=Texture(image=0, nearest=True)
    )
    quad = mesh_of(
        card(),
        material=0,
        attributes={"TEXCOORD_0": attribute(CARD_UV), "COLOR_0": attribute(np.full((4, 3), 0.5))},
    )
    shown = render(scene_of(quad, materials=(paint,), images=(image(pixels),)), DIM).pixels
    half_grey = ((128 / 255 + 0.055) / 1.055) ** 2.4  # sRGB
    assert shown[16, 4, :3] == pytest.approx((0.25 * half_grey, 0, 0), abs=1e-5)
    assert shown[16, 28, :3] == pytest.approx((0, 0, 0.25), abs=1e-5)


def test_an_occlusion_texture_is_linear_and_obeys_its_strength() -> None:
    paint = Material(occlusion_texture=Texture(image=0), occlusion_strength=0.5)
    quad = mesh_of(card(), material=0, attributes={"TEXCOORD_0": attribute(CARD_UV)})
    dark = image(np.full((2, 2, 3), 51 / 255))
    shown = render(scene_of(quad, materials=(paint,), images=(dark,)), DIM)
    assert middle(shown)[0] == pytest.approx(1.0 + 0.5 * (0.2 - 1.0), abs=1e-5)
    assert shown.effects["ambient_occlusion"].on


def test_the_attribute_ao_goes_before_a_texture() -> None:
    paint = Material(occlusion_texture=Texture(image=0))
    values = {"TEXCOORD_0": attribute(CARD_UV), "_AO": attribute(np.full(4, 0.7))}
    quad = mesh_of(card(), material=0, attributes=values)
    shown = render(scene_of(quad, materials=(paint,), images=(image(np.zeros((2, 2, 3))),)), DIM)
    assert middle(shown)[0] == pytest.approx(0.7, abs=1e-6)


def test_bent_normals_are_shown_where_a_mesh_has_them() -> None:
    quad = mesh_of(card(), attributes={"_BENT_NORMAL": attribute(np.tile((0.6, 0.0, 0.8), (4, 1)))})
    shown = render(scene_of(quad), dataclasses.replace(DIM, channel="bent-normal"))
    assert middle(shown)[:3] == pytest.approx((0.8, 0.5, 0.9), abs=1e-6)
    assert shown.effects["bent_normals"].on


def test_an_image_that_cannot_be_read_is_left_out_with_a_warning() -> None:
    def broken() -> bytes:
        raise InputError("bark.png: there is no such file.")

    paint = Material(base_color=(0.5, 0.5, 0.5, 1.0), base_color_texture=Texture(image=0))
    quad = mesh_of(card(), material=0, attributes={"TEXCOORD_0": attribute(CARD_UV)})
    picture = dataclasses.replace(image(np.zeros((1, 1, 3)), "bark"), data=broken)
    shown = render(scene_of(quad, materials=(paint,), images=(picture,)), DIM)
    assert middle(shown)[0] == pytest.approx(0.5, abs=1e-6)
    assert [line for line in shown.warnings if "bark.png" in line]


def _behind(alpha: float, mode: str) -> Preview:
    """A black card with this alpha before a white one."""
    glass = Material(base_color=(0.0, 0.0, 0.0, alpha), alpha_mode=mode)  # type: ignore[arg-type]
    return render(
        scene_of(mesh_of(card(0.5), material=0), mesh_of(card(0.0, 2.0)), materials=(glass,)), DIM
    )


@pytest.mark.parametrize(
    ("alpha", "mode", "wanted"),
    [(0.25, "OPAQUE", 0.0), (0.25, "MASK", 1.0), (0.75, "MASK", 0.0), (0.25, "BLEND", 0.75)],
)
def test_what_is_cut_out_or_blended_shows_what_is_behind(
    alpha: float, mode: str, wanted: float
) -> None:
    shown = middle(_behind(alpha, mode))
    assert shown[0] == pytest.approx(wanted, abs=1e-6)
    assert shown[3] == 1.0


def test_light_falls_through_what_is_cut_out() -> None:
    hole = Material(base_color=(1.0, 1.0, 1.0, 0.0), alpha_mode="MASK")
    lid = mesh_of(moved(card(3.0, 0.5), 1.0, (3.0, 0.0, 0.0)), material=0)
    sun = one_sun((-1.0, 0.0, -1.0))
    scene = scene_of(mesh_of(card()), lid, materials=(hole,), lights=sun)
    assert middle(render(scene, BEAUTY))[0] > 0.5

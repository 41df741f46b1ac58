"""Pictures: what is lit, what is dark, and what is not simulated."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from aobake.errors import InputError, SettingsError
from aobake.meshes.scene import Instance, Light, Scene
from aobake.render_settings import RenderSettings
from aobake.settings import TraceSettings
from aobake.shading.camera import sample_places
from aobake.shading.materials import Baked
from aobake.shading.preview import render
from tests.pictures import (
    BEAUTY,
    DIM,
    Float32Array,
    card,
    looking_down_z,
    middle,
    one_sun,
    scene_of,
)
from tests.scenes import affine, box, floor, icosphere, joined, mesh_of, moved, rotation, unwelded


def test_a_white_sphere_under_constant_ambient_light_equals_its_occlusion() -> None:
    """Occlusion that is linear in y is known at each pixel of an orthographic picture."""
    ball = icosphere(4, 0.9)
    baked = Baked(ao=[(0.5 + 0.4 * ball.vertices[:, 1]).astype(np.float32)])
    shown = render(scene_of(mesh_of(ball)), DIM, baked).pixels
    rows = 1.0 - (np.arange(32) + sample_places(4)[:, 1].mean()) / 16
    inside = (shown[..., 3] == 1.0).sum()
    assert inside > 500
    wanted = np.broadcast_to((0.5 + 0.4 * rows)[:, None], (32, 32))
    assert np.abs(shown[..., 0] - wanted)[shown[..., 3] == 1.0].max() < 1e-3


@pytest.mark.parametrize("model", ["lambert", "oren-nayar", "phong", "blinn-phong"])
def test_a_white_open_sphere_in_a_furnace_is_white(model: str) -> None:
    settings = dataclasses.replace(DIM, model=model)
    shown = render(scene_of(mesh_of(icosphere(3))), settings).pixels
    assert np.abs(shown[..., :3] - shown[..., 3:]).max() < 1e-6
    assert shown[16, 16, 3] == 1.0


def test_a_mirror_symmetric_scene_gives_a_mirror_symmetric_picture() -> None:
    things = joined(moved(box(), 0.5, (0, -0.5, 0.3)), icosphere(3, 0.6), floor(1.0, -1.0))
    scene = dataclasses.replace(
        scene_of(mesh_of(things), cameras=()), lights=one_sun((0.0, -1.0, -1.0))
    )
    for size in ("48x32", "33x32"):
        shown = render(scene, dataclasses.replace(BEAUTY, size=size, view="0,15", samples=5)).pixels
        assert shown[..., :3].std() > 0.05
        assert np.abs(shown - shown[:, ::-1]).max() < 1e-5


def test_a_picture_is_the_same_for_any_number_of_threads() -> None:
    scene = scene_of(mesh_of(joined(icosphere(3, 0.5), moved(box(), 0.3, (0.5, 0.5, 0.5)))))
    settings = dataclasses.replace(BEAUTY, size="200x150", samples=16)
    one, four = (
        render(scene, settings, trace=TraceSettings(threads=n, ground="+y")).pixels.tobytes()
        for n in (1, 4)
    )
    assert one == four


@pytest.mark.parametrize("tilt", [0.0, 0.5, 1.2])
def test_a_lit_card_is_ambient_light_and_lamberts_cosine(tilt: float) -> None:
    sun = one_sun((math.sin(tilt), 0.0, -math.cos(tilt)))
    settings = dataclasses.replace(BEAUTY, key=2.0)
    shown = middle(render(scene_of(mesh_of(card()), lights=sun), settings))
    # Lights of a file are brought to the key's irradiance on what is lit by them.
    assert shown[0] == pytest.approx(0.25 + 2.0 / math.pi, abs=1e-5)


def test_occlusion_darkens_the_ambient_term_and_nothing_else() -> None:
    lit = scene_of(mesh_of(card()), lights=one_sun((0, 0, -1)))
    settings = dataclasses.replace(BEAUTY, ambient=0.3)
    opened, closed = (
        middle(render(lit, settings, Baked(ao=[np.full(4, ao, np.float32)])))[0] for ao in (1, 0)
    )
    assert opened - closed == pytest.approx(0.3, abs=1e-6)
    assert closed == pytest.approx(1.8 / math.pi, abs=1e-5)
    ignored = render(
        lit, dataclasses.replace(settings, ao="none"), Baked(ao=[np.zeros(4, np.float32)])
    )
    assert middle(ignored)[0] == pytest.approx(opened, abs=1e-6)


def test_what_stands_before_the_light_casts_a_shadow() -> None:
    lid = moved(card(3.0, 0.5), 1.0, (3.0, 0.0, 0.0))
    scene = scene_of(mesh_of(joined(card(), lid)), lights=one_sun((-1.0, 0.0, -1.0)))
    shadow = middle(render(scene, BEAUTY))
    assert shadow[0] == pytest.approx(0.25, abs=1e-6)
    assert middle(render(scene, dataclasses.replace(BEAUTY, no_shadows=True)))[0] > 0.5
    assert render(scene, BEAUTY).pixels[16, 2, 0] > 0.5


def test_a_smooth_coarse_ball_has_no_shadow_of_its_own_facets() -> None:
    """Where the smooth surface is lit well, no facet before it may take the light away."""
    ball = icosphere(1)
    lit = mesh_of(ball, normals=ball.vertices)
    settings = dataclasses.replace(BEAUTY, size="64x64")
    shown, free = (
        render(
            scene_of(lit, lights=one_sun((-1.0, 0.0, -0.2)), cameras=(looking_down_z(2.2),)),
            dataclasses.replace(settings, no_shadows=off),
        ).pixels
        for off in (False, True)
    )
    assert np.abs(shown - free).max() < 1e-6  # 0.11 where rays start on the facets


def test_a_shading_normal_is_that_of_the_sphere() -> None:
    ball = icosphere(3, 0.9)
    settings = dataclasses.replace(DIM, channel="normal", samples=1)
    shown = render(scene_of(mesh_of(ball, normals=ball.vertices)), settings).pixels
    x = (np.arange(32) + 0.5) / 16 - 1.0
    y = 1.0 - (np.arange(32) + sample_places(1)[0, 1]) / 16
    rows, columns = np.nonzero(shown[..., 3])
    found = 2.0 * shown[rows, columns, :3] - 1.0
    radius = np.hypot(x[columns], y[rows])
    inner = radius < 0.8
    assert inner.sum() > 300
    assert np.abs(found[inner, 0] - x[columns][inner] / 0.9).max() < 0.02
    assert np.abs(found[inner, 1] - y[rows][inner] / 0.9).max() < 0.02


def test_a_box_without_normals_has_flat_sides() -> None:
    shown = render(
        scene_of(mesh_of(moved(box(), rotation((1, 1, 0), 0.6)))),
        dataclasses.replace(DIM, channel="normal", samples=1),
    ).pixels
    colors = np.unique(np.round(shown[shown[..., 3] > 0][:, :3], 3), axis=0)
    assert len(colors) == 3


def test_instances_look_like_the_copies_that_they_are() -> None:
    ball = icosphere(2, 0.3)
    places = []
    for x, y, linear in ((-0.5, 0.2, np.eye(3)), (0.5, -0.2, np.diag([-1.0, 0.5, 1.0]))):
        places.append(affine(linear, (x, y, 0.0)))
    one = mesh_of(ball, normals=ball.vertices)
    placed = dataclasses.replace(
        scene_of(one), instances=tuple(Instance(mesh=0, transform=place) for place in places)
    )
    copies = scene_of(
        *(
            mesh_of(
                moved(ball, place[:3, :3], place[:3, 3]),
                normals=ball.vertices @ np.linalg.inv(place[:3, :3]),
            )
            for place in places
        )
    )
    a, b = (render(scene, BEAUTY).pixels for scene in (placed, copies))
    assert np.abs(a - b).max() < 0.02
    assert np.abs(a - b).mean() < 1e-4


@pytest.mark.parametrize(("scale", "shift"), [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6)])
def test_size_and_place_of_a_scene_do_not_show(scale: float, shift: float) -> None:
    things = joined(icosphere(3, 0.5), floor(1.0, -0.5))
    settings = dataclasses.replace(BEAUTY, view="20,30", size="48x32")
    a, b = (
        render(scene_of(mesh_of(each), cameras=()), settings).pixels
        for each in (things, moved(things, scale, (shift, -shift, shift)))
    )
    assert np.abs(a - b).mean() < 2e-3


def test_the_ground_takes_light_away_where_things_stand_on_it() -> None:
    scene = scene_of(mesh_of(moved(box(), 1.0, (0.0, 0.5, 0.0))), cameras=())
    settings = dataclasses.replace(DIM, view="0,20", size="64x48")
    ground = TraceSettings(ground="+y")
    alpha = render(scene, settings, trace=ground).pixels[..., 3]
    bare = render(scene, settings).pixels[..., 3]
    below = np.flatnonzero(bare[:, 32])[-1]  # the lower edge of the box
    # At the foot of a wall the ground sees half of the sky, and never less.
    assert 0.3 < alpha[below + 1, 32] < 0.52
    assert alpha[-1, 0] < alpha[below + 1, 32] - 0.2
    from_below = render(scene, dataclasses.replace(settings, view="0,-40"), trace=ground)
    assert np.array_equal(
        from_below.pixels, render(scene, dataclasses.replace(settings, view="0,-40")).pixels
    )


def test_an_open_ground_shows_nothing_far_from_what_stands_on_it() -> None:
    scene = scene_of(mesh_of(moved(card(), rotation((1, 0, 0), -math.pi / 2))), cameras=())
    settings = dataclasses.replace(DIM, view="0,60", size="64x48")
    shown = render(scene, settings, trace=TraceSettings(ground="+y")).pixels
    assert shown[0, 0, 3] < 0.02


def test_a_point_light_falls_off_with_the_square_of_its_distance() -> None:
    place = affine(1.0, (0.0, 0.0, 2.0))
    lamp = Light(kind="point", transform=place)
    settings = dataclasses.replace(BEAUTY, ambient=0.0, size="33x33", samples=1)
    shown = render(
        scene_of(mesh_of(card(half=4.0)), lights=(lamp,), cameras=(looking_down_z(8.0),)), settings
    )
    center, side = shown.pixels[16, 16, 0], shown.pixels[16, 24, 0]
    x, y = 8 / 33 * 8.0, (0.5 - sample_places(1)[0, 1]) * 8.0 / 33
    nearer = (4.0 + y * y) / (4.0 + x * x + y * y)
    # the square of the distance, and the cosine on the card
    assert side / center == pytest.approx(nearer**1.5, rel=2e-3)


def test_a_spot_is_dark_outside_of_its_cone() -> None:
    place = affine(1.0, (0.0, 0.0, 2.0))
    lamp = Light(kind="spot", transform=place, cone_rad=(0.1, math.atan(0.5)))
    settings = dataclasses.replace(BEAUTY, ambient=0.0, size="33x33")
    scene = scene_of(mesh_of(card(half=4.0)), lights=(lamp,), cameras=(looking_down_z(8.0),))
    shown = render(scene, settings).pixels
    assert shown[16, 16, 0] > 0.1
    assert shown[16, 24, 0] == 0.0


def test_only_what_the_scene_calls_for_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("this was not called for")

    scene = scene_of(mesh_of(icosphere(2)), lights=one_sun((0, 0, -1)))
    monkeypatch.setattr("aobake.shading.shot.reach", never)
    dim = render(scene, DIM)
    assert not dim.effects["shadows"].on
    assert not render(scene, dataclasses.replace(BEAUTY, no_shadows=True)).effects["shadows"].on
    with pytest.raises(AssertionError):
        render(scene, BEAUTY)
    monkeypatch.undo()
    monkeypatch.setattr("aobake.shading.lobes.evaluate", _only_checking())
    flat = render(scene, dataclasses.replace(BEAUTY, model="cook-torrance", ks=0.0))
    assert not flat.effects["specular"].on
    monkeypatch.undo()
    monkeypatch.setattr("aobake.shading.lobes.fresnel_schlick", never)
    phong = render(scene, dataclasses.replace(BEAUTY, model="phong"))
    assert phong.effects["specular"].on
    assert not phong.effects["fresnel"].on
    assert all(effect.reason.endswith(".") for effect in phong.effects.values())


def _only_checking() -> object:
    from aobake.shading.models import evaluate

    def check(model: object, normal: Float32Array, *rest: object) -> object:
        assert normal.dtype == np.float64, "pictures are made of float32"
        return evaluate(model, normal, *rest)  # type: ignore[arg-type]

    return check


def test_a_camera_inside_of_something_is_rendered_with_a_warning() -> None:
    shell = scene_of(mesh_of(unwelded(moved(box(), 30.0))))
    shell = dataclasses.replace(
        shell, cameras=(dataclasses.replace(looking_down_z(), yfov_rad=1.0, height=None),)
    )
    shown = render(shell, DIM)
    assert [line for line in shown.warnings if "inside" in line]
    assert middle(shown)[3] == 1.0
    away = render(shell, dataclasses.replace(DIM, camera="frame"))
    assert not [line for line in away.warnings if "inside" in line]


@pytest.mark.parametrize(
    ("settings", "error", "words"),
    [
        ({"model": "cook-torance"}, SettingsError, ("cook-torrance", "minnaert")),
        ({"model": "phong", "roughness": 0.3}, SettingsError, ("roughness",)),
        ({"model": "cook-torrance", "roughness": -1.0}, SettingsError, ("roughness", "-1")),
        ({"model": "cook-torrance", "ior": 0.0}, SettingsError, ("ior",)),
        ({"ks": 0.5}, SettingsError, ("lambert", "no specular", "phong")),
        ({"size": "30000x30000"}, SettingsError, ("million pixels", "memory")),
        ({"channel": "error"}, InputError, ("error", "bake")),
        ({"channel": "ao"}, InputError, ("ao", "bake")),
        ({"channel": "bent-normal"}, InputError, ("_BENT_NORMAL",)),
        ({"camera": "left"}, InputError, ("left", "there are 0")),
    ],
)
def test_what_cannot_be_shown_is_refused(
    settings: dict[str, object], error: type[Exception], words: tuple[str, ...]
) -> None:
    chosen = dataclasses.replace(DIM, **settings)  # type: ignore[arg-type]
    with pytest.raises(error) as caught:
        render(scene_of(mesh_of(card())), chosen)
    assert all(word in str(caught.value) for word in words)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("shapes", [[], [3], [4, 4]])
def test_occlusion_of_another_scene_is_refused(shapes: list[int]) -> None:
    baked = Baked(ao=[np.ones(count, np.float32) for count in shapes])
    with pytest.raises(InputError, match="does not fit the scene"):
        render(scene_of(mesh_of(card())), DIM, baked)


def test_a_scene_without_faces_is_refused() -> None:
    with pytest.raises(InputError, match="no triangle"):
        render(Scene.from_arrays(np.zeros((3, 3)), np.zeros((0, 3), np.int32)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"size": "0x10"}, {"size": "big"}, {"samples": 0}, {"samples": 2.5}, {"view": "30"},
        {"view": "0,91"}, {"view": "nan,0"}, {"fov": 0.0}, {"up": "y"}, {"lights": "sun"},
        {"key": -1.0}, {"ambient": math.inf}, {"ks": 1.5}, {"channel": "depth"}, {"tone": "film"},
        {"background": "#12345"}, {"camera": ""}, {"ao": "some"}, {"no_shadows": 1}, {"exposure": 99.0},
    ],
)  # fmt: skip
def test_settings_without_a_meaning_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(SettingsError) as caught:
        RenderSettings(**wrong)  # type: ignore[arg-type]
    assert str(caught.value).startswith(next(iter(wrong)))

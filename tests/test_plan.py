"""The plan: what is on, why, what it costs, and what can be said against it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aobake import (
    BakeSettings,
    Instance,
    Material,
    Mesh,
    Scene,
    SettingsError,
    bake_texture,
    bake_vertices,
    plan,
    save,
)
from aobake.atlas.unwrap import Charts, unwrap
from aobake.demo import hall
from aobake.images import encode
from aobake.meshes.scene import Attribute, Image, Texture
from aobake.overrides import EFFECTS
from aobake.plan import texture_plan
from aobake.planning.cost import estimated
from tests.conftest import Run
from tests.scenes import box, floor, icosphere, joined, mesh_of
from tests.support import one_line


def one(shape: tuple[np.ndarray, np.ndarray], *materials: Material) -> Scene:
    """A mesh called 'thing', made of the first material."""
    vertices, faces = shape
    mesh = Mesh(vertices=vertices, faces=faces, name="thing", material=0 if materials else None)
    return Scene(meshes=(mesh,), instances=(Instance(mesh=0, name="thing"),), materials=materials)


BOX = one(box())


def effect(
    name: str, scene: Scene = BOX, settings: Mapping[str, Any] | None = None
) -> tuple[bool, str]:
    found = plan(scene, BakeSettings(**(settings or {}))).effects[name]
    return found.on, found.reason


def test_what_nobody_asked_for_and_nothing_calls_for_is_off() -> None:
    effects = plan(BOX).effects
    assert {name for name, found in effects.items() if found.on} == {"occlusion", "open_sky"}
    assert not any(found.forced for found in effects.values())
    assert all(found.reason.endswith(".") for found in effects.values())
    assert all("\n" not in found.reason for found in effects.values())


def test_a_scene_without_triangles_has_no_occlusion() -> None:
    empty = Scene.from_arrays(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert effect("occlusion", empty) == (False, "There is no triangle in the scene.")


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        ("max_distance", {"max_distance": 0.25}, "0.25"),
        ("falloff", {"max_distance": 1.0, "falloff": "smooth"}, "smooth"),
        ("ground", {"ground": "+z"}, "+z"),
        ("backfaces", {"backfaces": "ignore"}, "mesh 'thing'"),
        ("distribution", {"distribution": "uniform"}, "uniform"),
        ("spread", {"spread": 162.0}, "162 degrees"),
        ("occluders", {"occluders": ("own",)}, "itself alone"),
        ("occluders", {"occluders": ("thing",)}, "'thing'"),
        ("exclude", {"exclude": ("thing",)}, "'thing'"),
        ("bent_normals", {"bent_normals": True}, "same rays"),
        ("method", {"method": "lsq"}, "lsq"),
    ],
)
def test_what_is_asked_for_is_on_and_says_so(
    name: str, settings: dict[str, Any], said: str
) -> None:
    on, reason = effect(name, BOX, settings)
    assert on
    assert said in reason
    assert not plan(BOX).effects[name].on


def test_two_sided_materials_have_no_backs_to_pass_through() -> None:
    sheet = one(floor(1.0), Material(name="leaf", double_sided=True))
    on, reason = effect("backfaces", sheet, {"backfaces": "ignore"})
    assert not on
    assert "double-sided" in reason


def masked(alpha: np.ndarray) -> Scene:
    """A square with a texture of which alpha decides."""
    pixels = np.ones((*alpha.shape, 4), np.float32)
    pixels[..., 3] = alpha
    data = encode(pixels, "png", "8")
    uv = Attribute(values=np.array([(0.0, 1.0), (0.0, 0.0), (1.0, 1.0), (1.0, 0.0)]))
    shape = floor(1.0)
    leaf = Material(name="leaf", alpha_mode="MASK", base_color_texture=Texture(image=0))
    mesh = Mesh(
        vertices=shape.vertices,
        faces=shape.faces,
        name="card",
        material=0,
        attributes={"TEXCOORD_0": uv},
    )
    return Scene(
        meshes=(mesh,),
        instances=(Instance(mesh=0),),
        materials=(leaf,),
        images=(Image(name="leaf.png", data=lambda: data),),
    )


def test_a_mask_is_a_cut_out_only_where_it_has_a_hole() -> None:
    alpha = np.ones((16, 16), np.float32)
    assert not effect("alpha", masked(alpha))[0]
    alpha[4:12, 4:12] = 0.0
    on, reason = effect("alpha", masked(alpha))
    assert on
    assert "'leaf' is MASK" in reason
    off = plan(masked(alpha), BakeSettings(effect=("alpha=off",))).effects["alpha"]
    assert off.forced
    assert not off.on


def test_meshes_that_stand_in_several_places_are_instances() -> None:
    twice = replace(BOX, instances=(Instance(mesh=0), Instance(mesh=0)))
    on, reason = effect("instances", twice)
    assert on
    assert "mesh 'thing'" in reason


@pytest.mark.parametrize(
    ("switch", "name", "on"),
    [
        ("open_sky=off", "open_sky", False),
        ("backfaces=on", "backfaces", True),
        ("method=on", "method", True),
        ("bent_normals=on", "bent_normals", True),
        ("distribution=on", "distribution", True),
        ("ground=off", "ground", False),
    ],
)
def test_an_effect_that_is_switched_by_hand_says_so(switch: str, name: str, on: bool) -> None:
    found = plan(BOX, BakeSettings(effect=(switch,))).effects[name]
    assert found.on is on
    assert found.forced
    assert "by hand" in found.reason


def test_switches_are_settings() -> None:
    settings = BakeSettings(effect=("method=on", "denoise=off", "normal_map=on"), rays=7)
    assert (settings.method, settings.denoise, settings.normal_map) == ("lsq", "off", True)
    assert replace(settings, rays=8).method == "lsq"


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ({"effect": ("metod=on",)}, ("metod", '"method"')),
        ({"effect": ("method",)}, ("NAME=on",)),
        ({"effect": ("method=yes",)}, ("NAME=on",)),
        ({"effect": ("method=on", "method=off")}, ("on and off",)),
        ({"effect": ("ground=on",)}, ("give ground",)),
        ({"effect": ("ground=off",), "ground": "+y"}, ("contradicts ground", "'+y'")),
        ({"effect": ("method=off",), "method": "lsq"}, ("contradicts method",)),
        ({"effect": ("denoise=on",), "denoise": "off"}, ("contradicts denoise",)),
        ({"effect": ("occluders=off",), "occluders": ("own",)}, ("contradicts occluders",)),
        ({"effect": ("alpha=on",)}, ("alpha", "only be off")),
        ({"effect": ("sharing=on",)}, ("sharing", "only be off")),
        ({"effect": 3}, ("words are needed",)),
    ],
)
def test_a_switch_that_means_nothing_is_refused(
    given: dict[str, object], parts: tuple[str, ...]
) -> None:
    with pytest.raises(SettingsError) as caught:
        BakeSettings(**given)  # type: ignore[arg-type]
    assert all(part in str(caught.value) for part in parts), caught.value
    assert "\n" not in str(caught.value)


def test_every_effect_that_can_be_switched_is_in_a_plan() -> None:
    assert set(EFFECTS) <= set(plan(BOX).effects) | set(texture_plan(BOX).effects)


def test_a_plan_says_how_it_turned_out_once_it_was_followed() -> None:
    found = bake_vertices(Scene.from_arrays(*icosphere(3)), BakeSettings(rays=256))
    assert "642 of 642 points" in found.plan.effects["open_sky"].reason


def test_the_demo_is_planned_as_it_is_meant() -> None:
    effects = plan(hall()).effects
    assert {name for name, found in effects.items() if found.on} == {
        "occlusion",
        "open_sky",
        "instances",
    }


def test_an_estimate_counts_what_the_bake_then_spends() -> None:
    mesh = joined(icosphere(3), box((0.5, 0.5, -1.0), (2.0, 2.0, 1.0)))
    scene, settings = Scene.from_arrays(*mesh), BakeSettings(rays=64)
    cost = estimated(plan(scene, settings), scene, settings)
    assert cost.points == len(mesh.vertices)
    assert cost.rays == bake_vertices(scene, settings).rays
    assert cost.seconds == pytest.approx(sum(cost.stages.values()))
    assert set(cost.stages) == {"prepare", "build", "trace"}
    assert set(cost.effects) == set(plan(scene, settings).effects)
    assert cost.bytes > 0


def test_an_estimate_knows_what_needs_no_ray() -> None:
    scene, settings = Scene.from_arrays(*icosphere(4)), BakeSettings(rays=1024)
    assert estimated(plan(scene, settings), scene, settings).rays == 0


@pytest.mark.parametrize("texture", [False, True])
def test_an_estimate_of_nothing_is_nothing(texture: bool) -> None:
    empty = Scene.from_arrays(np.zeros((0, 3)), np.zeros((0, 3), int))
    decided = texture_plan(empty) if texture else plan(empty)
    cost = estimated(decided, empty, texture=texture)
    assert (cost.points, cost.rays) == (0, 0)


def test_an_estimate_of_a_texture_counts_its_pages_and_names_the_stages_of_the_bake() -> None:
    shapes = [icosphere(2), box((2.0, 0.0, 0.0), (3.0, 1.0, 1.0))]
    scene = Scene.from_meshes([mesh_of(s) for s in shapes])
    one = BakeSettings(rays=4, size=64, denoise="off")
    several = replace(one, atlas="mesh", supersample=2, denoise="on")
    costs = [estimated(texture_plan(scene, s), scene, s, texture=True) for s in (one, several)]
    assert costs[1].points == pytest.approx(8 * costs[0].points, abs=8)
    baked = bake_texture(scene, one)
    assert set(costs[0].stages) == set(baked.seconds) - {"compile"}
    assert set(costs[1].stages) == set(costs[0].stages) | {"denoise"}
    assert costs[0].rays == pytest.approx(baked.rays, rel=0.5)
    assert all(spent >= 0.0 for spent in costs[1].stages.values())


def test_an_estimate_knows_what_need_not_be_unwrapped(monkeypatch: pytest.MonkeyPatch) -> None:
    sheet = masked(np.ones((4, 4), np.float32))
    asked: list[int] = []

    def noting(meshes: Sequence[Mesh], settings: BakeSettings, threads: int | None) -> list[Charts]:
        asked.append(len(meshes))
        return unwrap(meshes, settings, threads)

    monkeypatch.setattr("aobake.planning.texture_cost.unwrap", noting)
    for uv, times in (("auto", 0), ("unwrap", 2)):
        settings = BakeSettings(rays=1, size=32, uv=uv)
        estimated(texture_plan(sheet, settings), sheet, settings, texture=True)
        assert len(asked) == times


@pytest.fixture
def asset(tmp_path: Path) -> Path:
    save(bake_vertices(BOX, BakeSettings(rays=1)), tmp_path / "box.glb")
    return tmp_path / "box.glb"


def test_the_command_prints_what_the_plan_says(asset: Path, run: Run) -> None:
    ran = run("plan", asset, "--backfaces", "ignore", "--effect=open_sky=off")
    assert ran.status == 0
    assert ran.err == ""
    assert "effects.backfaces: on (x 1.2): " in ran.out
    assert "effects.open_sky: off: " in ran.out
    assert "estimate.seconds: " in ran.out
    assert sorted(path.name for path in asset.parent.iterdir()) == ["box.glb"]


@pytest.mark.parametrize("texture", [False, True])
def test_json_holds_effects_and_the_total(asset: Path, run: Run, texture: bool) -> None:
    flags = ["--texture", "--size=64"] if texture else []
    ran = run("plan", asset, "--json", "--effect", "backfaces=on", *flags)
    found = json.loads(ran.out)
    assert set(found) == {"effects", "total"}
    kinds = {"on": bool, "reason": str, "forced": bool, "cost": dict}
    for told in found["effects"].values():
        assert {key: type(value) for key, value in told.items()} == kinds
        assert set(told["cost"]) == {"factor", "seconds", "bytes"}
    assert found["effects"]["backfaces"]["forced"] is True
    assert ("denoise" in found["effects"]) is texture
    assert found["total"]["seconds"] >= 0.0


@pytest.mark.parametrize(
    ("flags", "parts"),
    [
        (["--effect", "groud=on"], ["groud", '"ground"']),
        (["--exclude", "thin"], ["'thin'", '"thing"']),
        (["--occluders", "own", "--occluders", "thing"], ["'own'"]),
        (["--max-distance", "5%%"], ["'5%%'"]),
        (["--spread", "200"], ["--spread is 200"]),
    ],
)
def test_a_mistake_ends_with_status_2(
    asset: Path, run: Run, flags: list[str], parts: list[str]
) -> None:
    ran = run("plan", asset, *flags)
    assert ran.status == 2, ran
    assert one_line(ran.err, "aobake: error: ", *parts), ran.err

"""Cameras and lights stand where their nodes put them, in the scene that is shown alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from aobake.meshes.scene import Scene
from tests.meshes.formats.gltf.build import Builder, Json, load

QUARTER = [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)]  # about y: what looked along -z looks along -x
LENS = {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}


def lit(number: int = 0) -> Json:
    return {"extensions": {"KHR_lights_punctual": {"light": number}}}


def read(path: Path, *nodes: Json, cameras: list[Json] = [], lights: list[Any] = []) -> Scene:  # noqa: B006
    """A square, and these nodes below one that is turned and moved."""
    builder = Builder()
    if cameras:
        builder.json["cameras"] = cameras
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    square = builder.node(mesh=builder.mesh())
    below = [builder.node(**node) for node in nodes]
    above = builder.node(rotation=QUARTER, translation=[5, 0, 0], children=below)
    hidden = builder.node(camera=0, **lit()) if cameras else builder.node(**lit())
    builder.show(square, above)
    builder.put("scenes", {"nodes": [hidden]})
    return load(builder.glb(path / "a.glb"))


def test_cameras_stand_where_their_nodes_are(tmp_path: Path) -> None:
    flat = {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "zfar": 9, "znear": 0}}
    nodes = ({"camera": 0, "translation": [0, 0, 2], "name": "front"}, {"camera": 1})
    found = read(tmp_path, *nodes, cameras=[LENS, {**flat, "name": "plan"}])
    front, plan = found.cameras
    assert (front.name, front.yfov_rad, front.height) == ("front", 0.5, None)
    assert (plan.name, plan.yfov_rad, plan.height) == ("plan", None, 4.0)
    assert_allclose(front.transform @ (0, 0, 0, 1), [7, 0, 0, 1], atol=1e-15)
    assert_allclose(front.transform @ (0, 0, -1, 0), [-1, 0, 0, 0], atol=1e-15)
    assert found.warnings == ()


def test_lights_stand_where_their_nodes_are(tmp_path: Path) -> None:
    lights: list[Json] = [
        {"type": "directional", "name": "sun", "color": [1, 0.5, 0.25], "intensity": 3},
        {"type": "point", "range": 4},
        {"type": "spot", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}},
        {"type": "spot", "spot": {}},
    ]
    nodes = [{**lit(number), "translation": [0, number, 0]} for number in range(4)]
    found = read(tmp_path, *nodes, lights=lights)
    sun, point, spot, plain = found.lights
    assert (sun.kind, sun.name, sun.color, sun.intensity) == (
        "directional",
        "sun",
        (1, 0.5, 0.25),
        3,
    )
    assert (point.kind, point.color, point.intensity, point.range) == ("point", (1, 1, 1), 1, 4)
    assert (spot.cone_rad, plain.cone_rad, sun.range) == ((0.25, 0.5), (0, math.pi / 4), None)
    assert_allclose(spot.transform @ (0, 0, 0, 1), [5, 2, 0, 1], atol=1e-15)
    assert_allclose(sun.transform @ (0, 0, -1, 0), [-1, 0, 0, 0], atol=1e-15)
    assert not sun.transform.flags.writeable


def test_the_scene_that_is_shown_is_the_only_one_that_has_them(tmp_path: Path) -> None:
    found = read(tmp_path, cameras=[LENS], lights=[{"type": "point"}])
    assert (found.cameras, found.lights) == ((), ())


@pytest.mark.parametrize(
    ("camera", "said"),
    [
        ({"type": "perspective"}, "perspective is missing"),
        ({"type": "perspective", "perspective": {"yfov": 0}}, "yfov is 0"),
        ({"type": "perspective", "perspective": {"yfov": 4}}, "yfov is 4"),
        ({"type": "orthographic", "orthographic": {"ymag": -1}}, "ymag is -1"),
        ({}, "type is missing"),
    ],
)
def test_a_broken_camera_is_passed_over_with_a_line(
    tmp_path: Path, camera: Json, said: str
) -> None:
    found = read(tmp_path, {"camera": 0}, {"camera": 1}, cameras=[camera, LENS])
    assert len(found.cameras) == len(found.warnings) == 1
    assert said in found.warnings[0]


@pytest.mark.parametrize(
    ("light", "said"),
    [
        ({"type": "lamp"}, "'lamp'"),
        ({}, "type is missing"),
        ({"type": "point", "range": 0}, "range is 0"),
        ({"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}}, "cone"),
        (None, "light 0 is no object"),
    ],
)
def test_a_broken_light_is_passed_over_with_a_line(
    tmp_path: Path, light: Json | None, said: str
) -> None:
    found = read(tmp_path, lit(0), lit(1), lit(7), lights=[light, {"type": "point"}])
    assert len(found.lights) == 1
    assert len(found.warnings) == 2
    assert said in found.warnings[0]
    assert "light is 7" in found.warnings[1]
    assert np.isfinite(found.lights[0].transform).all()

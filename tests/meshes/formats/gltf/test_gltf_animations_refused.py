"""Poses that no clip has, and clips that cannot be read: one line each."""

from __future__ import annotations

import random
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aobake
from aobake.errors import InputError, SettingsError
from tests.meshes.formats.gltf.build import (
    pack_glb,
    square_builder,
)
from tests.meshes.formats.gltf.clips import (
    animate,
    at,
    hinge,
    moving,
    sliding_square,
)
from tests.meshes.formats.gltf.test_gltf_fuzz import damaged_json, refused
from tests.support import one_line


@pytest.mark.parametrize(
    "pose", ["slide", "slide@", "@1", "slide@now", "slide@nan", "slide@inf", ""]
)
def test_what_is_no_pose_is_a_wrong_setting(tmp_path: Path, pose: str) -> None:
    with pytest.raises(SettingsError, match="CLIP@SECONDS"):
        at(sliding_square(), tmp_path, pose)


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ("slyde@1", "no animation 'slyde'. Did you mean \"slide\""),
        ("7@1", "no animation '7'"),
        ("slide@2.001", 'animation 0 "slide" lasts from 0.0 to 2.0 s, and 2.001 s'),
        ("slide@-0.1", "lasts from 0.0 to 2.0 s"),
        ("slide@1e300", "1e+300 s was asked for"),
    ],
)
def test_clips_and_moments_that_are_not_there_are_refused(
    tmp_path: Path, pose: str, words: str
) -> None:
    with pytest.raises(InputError) as refused:
        at(sliding_square(), tmp_path, pose)
    assert words in str(refused.value)


def test_an_asset_without_animations_has_no_pose(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no animation 'a'. It has none."):
        at(square_builder(), tmp_path, "a@0")


def test_formats_without_animations_have_no_pose(corner: Path) -> None:
    with pytest.raises(InputError, match=r"animations are read from glTF alone"):
        aobake.load(corner, pose="a@0")


ONE = [[0, 0, 0]]


@pytest.mark.parametrize(
    ("channel", "words"),
    [
        (moving("translation", [1, 0], ONE * 2), "run backwards"),
        (moving("translation", [0, np.nan], ONE * 2), "not finite"),
        (moving("translation", [0, 1], ONE * 3), "3 values for 2 keys"),
        (moving("translation", [0, 1], ONE * 2, how="CUBICSPLINE"), "do not go with"),
        (moving("translation", [0, 1], ONE * 2, how="BEZIER"), "LINEAR, STEP, CUBICSPLINE exist"),
        (moving("translation", [0], [[0, 0, np.inf]]), "a translation is not finite"),
        (moving("rotation", [0], ONE), "VEC4 is needed"),
        (moving("weights", [0, 1], [0.0, 0.0, 0.0]), "3 values for 2 keys"),
        (moving("translation", [0], ONE) | {"node": 5}, "the file has 1 nodes"),
    ],
)
def test_clips_that_cannot_be_read_are_refused_in_one_line(
    tmp_path: Path, channel: dict[str, Any], words: str
) -> None:
    builder = square_builder()
    animate(builder, "a", channel)
    with pytest.raises(InputError) as refused:
        at(builder, tmp_path, "a@0")
    assert one_line(f"{refused.value}\n", "a.glb", words)


def test_a_sampler_without_keys_is_refused(tmp_path: Path) -> None:
    builder = sliding_square()
    builder.json["accessors"][builder.json["animations"][0]["samplers"][0]["input"]]["count"] = 0
    with pytest.raises(InputError, match="sampler 0 has no keys"):
        at(builder, tmp_path, "0@0")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"samplers": []}, "sampler is 0, and the file has 0 samplers"),
        ({"channels": []}, "has no channels"),
        ({"channels": [{"sampler": 0}]}, "target is missing"),
        ({"channels": [{"sampler": 0, "target": {"node": 0}}]}, "path is missing"),
        ({"samplers": [{"output": 0}]}, "input is missing"),
    ],
)
def test_broken_json_of_clips_is_refused(
    tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    builder = sliding_square()
    builder.json["animations"][0] |= change
    with pytest.raises(InputError, match=words):
        at(builder, tmp_path, "0@0")


def test_a_node_with_a_matrix_cannot_be_animated(tmp_path: Path) -> None:
    builder = sliding_square()
    del builder.json["nodes"][0]["translation"]
    builder.json["nodes"][0]["matrix"] = np.eye(4).reshape(-1).tolist()
    with pytest.raises(InputError, match="node 0 has a matrix"):
        at(builder, tmp_path, "0@0")


@pytest.mark.timeout(30)
def test_whatever_is_done_to_a_clip_it_is_read_or_refused_in_one_line(tmp_path: Path) -> None:
    rng = random.Random(5)
    builder = hinge()
    path, data = tmp_path / "a.glb", bytes(builder.data)
    whole = builder.with_buffer()
    kept = {"animations", "accessors", "nodes"}  # what is damaged
    refusals = 0
    for _ in range(400):
        damaged = damaged_json({name: whole[name] for name in kept}, rng)
        path.write_bytes(pack_glb({**whole, **damaged}, data))
        line = refused(partial(aobake.load, path, pose="0@1"))
        assert not line or one_line(f"{line}\n", "a.glb")
        refusals += bool(line)
    assert 20 < refusals < 380

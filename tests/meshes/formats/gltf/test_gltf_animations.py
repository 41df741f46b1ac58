"""Assets at a moment of their animations: where things stand, and what is baked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import aobake
from aobake.errors import InputError
from aobake.meshes.motion import Motion
from tests.conftest import Run
from tests.known import wall_factor
from tests.meshes.formats.gltf.build import (
    SQUARE,
    Builder,
    attribute,
    square_builder,
    unpack_glb,
)
from tests.meshes.formats.gltf.clips import (
    CENTRE,
    FLAP,
    FLOOR,
    UPRIGHT,
    animate,
    at,
    hinge,
    lifted,
    moving,
    places,
    sliding_square,
)
from tests.scenes import moved
from tests.support import one_line


@pytest.mark.parametrize("clip", ["slide", "0"])
@pytest.mark.parametrize(("seconds", "x"), [("0", 0.0), ("0.5", 1.0), ("2", 4.0), ("1e0", 2.0)])
def test_a_clip_by_name_or_number_moves_its_node(
    tmp_path: Path, clip: str, seconds: str, x: float
) -> None:
    scene = at(sliding_square(), tmp_path, f"{clip}@{seconds}")
    np.testing.assert_allclose(places(scene), np.add(SQUARE, [x, 0, 0]), rtol=1e-15)


def test_without_a_pose_no_animation_is_looked_at(tmp_path: Path) -> None:
    builder = sliding_square()
    builder.json["animations"][0]["samplers"][0]["input"] = 999
    assert places(at(builder, tmp_path, None))[0][0] == 100.0


def test_a_name_goes_before_a_number_and_may_hold_the_sign(tmp_path: Path) -> None:
    builder = sliding_square()
    for name, x in (("0", 7.0), ("a@b", 8.0)):
        animate(builder, name, moving("translation", [0], [[x, 0, 0]]))
    assert places(at(builder, tmp_path, "0@0"))[0][0] == 7.0
    assert places(at(builder, tmp_path, "a@b@0"))[0][0] == 8.0


def test_several_properties_of_a_node_move_at_once_and_the_rest_stays(tmp_path: Path) -> None:
    """x = (1, 0, 0) at 1 s: scaled to 3, turned to +y, at the z of the file."""
    builder = square_builder(translation=[0, 0, 5], scale=[9, 9, 9])
    turned = moving("rotation", [0, 2], [[0, 0, 0, 1], [0, 0, 1, 0]])
    animate(builder, "both", moving("scale", [0, 2], [[1, 1, 1], [5, 5, 5]]), turned)
    np.testing.assert_allclose(places(at(builder, tmp_path, "both@1"))[1], [0, 3, 5], atol=1e-12)


@pytest.mark.parametrize(("how", "x"), [("STEP", 0.0), ("LINEAR", 1.0), ("CUBICSPLINE", 0.8125)])
def test_samplers_interpolate_as_they_say(tmp_path: Path, how: str, x: float) -> None:
    """A quarter of the way from 0 to 4 in 2 s; the spline leaves and arrives at 1 a second.

    5/32 * 4 from the values, 2 * 9/64 and -2 * 3/64 from the slopes.
    """
    rows: list[list[float]] = [[0, 0, 0], [4, 0, 0]]
    if how == "CUBICSPLINE":  # the 50 are slopes outside of the two keys
        rows = [[50, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0], [4, 0, 0], [50, 0, 0]]
    builder = square_builder()
    animate(builder, "a", moving("translation", [0, 2], rows, how=how))
    assert places(at(builder, tmp_path, "a@0.5"))[0][0] == pytest.approx(x)


@pytest.mark.parametrize("dtype", ["i1", "i2"])
def test_rotations_may_be_normalised_whole_numbers(tmp_path: Path, dtype: str) -> None:
    """Half of a turn of 180 degrees about z; -one is the other name of one."""
    one = np.iinfo(dtype).max
    builder = square_builder()
    keys = [[0, 0, 0, -one], [0, 0, -one, 0]]
    animate(
        builder,
        "a",
        moving("rotation", [0, 1], keys, dtype=dtype, more={"normalized": True}),
    )
    np.testing.assert_allclose(places(at(builder, tmp_path, "a@0.5"))[1], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize("how", ["LINEAR", "CUBICSPLINE"])
def test_weights_of_morph_targets_move_together(tmp_path: Path, how: str) -> None:
    builder = lifted([0.0, 0.0])
    keys = [0.0, 1.0, 0.5, 0.0]  # both weights at 0 s, both at 1 s
    if how == "CUBICSPLINE":
        keys = [9, 9, *keys[:2], 0, 0, 0, 0, *keys[2:], 9, 9]
    animate(builder, "talk", moving("weights", [0, 1], keys, how=how))
    np.testing.assert_allclose(
        places(at(builder, tmp_path, "talk@0.5")), np.add(SQUARE, [5, 0, 0.25]), atol=1e-12
    )


def test_nodes_that_share_a_mesh_bend_it_each_in_its_own_way(tmp_path: Path) -> None:
    builder = lifted([0.0, 0.0])
    builder.json["scenes"][0]["nodes"].append(builder.node(mesh=0))
    animate(builder, "talk", moving("weights", [0], [1.0, 0.0]))
    scene = at(builder, tmp_path, "talk@0")
    assert [mesh.vertices[0, 2] for _, mesh in scene.placed()] == [1.0, 0.0]


def test_joints_take_their_skin_along(tmp_path: Path) -> None:
    builder = Builder()
    skin = {
        "JOINTS_0": builder.accessor([[0, 0, 0, 0]] * 4, "u1"),
        "WEIGHTS_0": builder.accessor([[1, 0, 0, 0]] * 4),
    }
    joint = builder.node()
    body = builder.node(mesh=builder.mesh(builder.primitive(attributes=skin), name="body"), skin=0)
    builder.put("skins", {"joints": [joint]})
    builder.show(joint, body)
    animate(builder, None, moving("translation", [0, 1], [[0, 0, 0], [0, 0, 8]]))
    scene = at(builder, tmp_path, "0@0.25")
    np.testing.assert_allclose(places(scene), np.add(SQUARE, [0, 0, 2]))
    assert scene.motion.skinned == ('mesh 0 "body"',)


def test_a_clip_goes_on_to_the_end_of_its_longest_channel(tmp_path: Path) -> None:
    """What begins later waits at its first value, and what ends earlier stays at its last one."""
    builder = square_builder()
    early = moving("translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    late = moving("scale", [3, 4], [[2, 2, 2], [3, 3, 3]])
    animate(builder, "a", early, late)
    np.testing.assert_allclose(places(at(builder, tmp_path, "a@2"))[1], [3, 0, 0])


def test_the_last_moment_of_a_clip_can_be_named_in_decimals(tmp_path: Path) -> None:
    """1.3 is stored as 1.29999995; the line that refuses a later moment says 1.3 as well."""
    builder = square_builder()
    animate(builder, "a", moving("translation", [0, 1.3], [[0, 0, 0], [4, 0, 0]]))
    assert places(at(builder, tmp_path, "a@1.3"))[0][0] == 4.0
    with pytest.raises(InputError, match=r"from 0.0 to 1.3 s, and 1.30001 s"):
        at(builder, tmp_path, "a@1.30001")


def test_a_clip_begins_at_zero_even_where_its_first_key_is_later(tmp_path: Path) -> None:
    builder = square_builder()
    animate(builder, "a", moving("translation", [1, 2], [[3, 0, 0], [4, 0, 0]]))
    assert places(at(builder, tmp_path, "a@0"))[0][0] == 3.0


def test_what_moves_no_node_is_passed_over_with_a_warning(tmp_path: Path) -> None:
    builder = sliding_square()
    clip = builder.json["animations"][0]
    pointer = {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}
    clip["channels"] += [
        {"sampler": 0, "target": {"path": "pointer", "extensions": pointer}},
        {"sampler": 0, "target": {"path": "translation"}},  # of no node: to be ignored
    ]
    scene = at(builder, tmp_path, "slide@1")
    assert places(scene)[0][0] == 2.0
    (warning,) = scene.warnings
    assert "1 of its 3 channels" in warning
    assert "KHR_animation_pointer" in warning


@pytest.mark.parametrize(
    ("builder", "sentence"),
    [
        (square_builder(), "Nothing in the scene moves."),
        (sliding_square(), 'Animation 0 "slide" moves nodes; they are baked where they stand without it.'),
        (lifted([0.0, 0.0]), 'Mesh 0 "face" is morphed; it is baked in its rest pose.'),
    ],
)  # fmt: skip
def test_a_scene_says_how_it_stands(tmp_path: Path, builder: Builder, sentence: str) -> None:
    assert str(at(builder, tmp_path, None).motion) == sentence


def test_a_posed_scene_says_in_which_pose(tmp_path: Path) -> None:
    motion = at(sliding_square(), tmp_path, "0@0.5").motion
    assert motion == Motion(clips=('animation 0 "slide"',), pose='animation 0 "slide" at 0.5 s')
    assert str(motion) == 'The scene stands as in animation 0 "slide" at 0.5 s.'


def test_facts_name_the_clips_and_their_length(tmp_path: Path) -> None:
    builder = sliding_square()
    times = builder.json["animations"][0]["samplers"][0]["input"]
    builder.json["accessors"][times] |= {"min": [0.0], "max": [1.2999999523162842]}
    source = at(builder, tmp_path, None).source
    assert source is not None
    assert source.facts()["animations"] == ['0 "slide" (1.3 s)']


def test_a_hinge_that_turns_is_baked_as_one_that_was_modelled_so(tmp_path: Path) -> None:
    """Two plates at a right angle; the floor's centre sees a wall of its own size half a side away."""
    settings = aobake.BakeSettings(rays=1024, method="point")
    path = hinge().glb(tmp_path / "a.glb")
    posed = aobake.bake_vertices(aobake.load(path, pose="close@1.5"), settings)
    modelled = Builder()
    for part in (moved(FLAP, UPRIGHT), FLOOR):
        mesh = modelled.mesh(modelled.primitive(part.vertices, part.faces.reshape(-1)))
        modelled.node(mesh=mesh)
    still = aobake.load(modelled.show(0, 1).glb(tmp_path / "b.glb"))
    expected = aobake.bake_vertices(still, settings)
    for found, value in zip(posed.ao, expected.ao, strict=True):
        np.testing.assert_allclose(found, value, atol=2 / 1024)  # rounding may turn a ray or two
    sky = 1.0 - wall_factor(0.5, 1.0, 0.5, 0.5)
    error = float(posed.standard_error[1][CENTRE])
    assert abs(posed.ao[1][CENTRE] - sky) <= 4.0 * error
    assert aobake.bake_vertices(aobake.load(path), settings).ao[1][CENTRE] == 1.0


def test_a_posed_bake_changes_nothing_but_the_occlusion(run: Run, tmp_path: Path) -> None:
    source, out, rest = hinge().glb(tmp_path / "a.glb"), tmp_path / "b.glb", tmp_path / "c.glb"
    assert run("vertex", source, "-o", out, "--pose", "close@1.5", "--rays", 64).status == 0
    assert run("vertex", source, "-o", rest, "--rays", 64).status == 0
    (before, data, _), (after, baked, _), (other, _, _) = map(unpack_glb, (source, out, rest))
    assert after == other
    assert baked.startswith(data)
    for name in ("nodes", "animations", "scenes"):
        assert after[name] == before[name]
    grey = [attribute(path, "COLOR_0", mesh=1)[CENTRE, 0] for path in (out, rest)]
    assert grey[0] < grey[1]


@pytest.mark.parametrize(("pose", "status"), [("close@9", 1), ("clothe@1", 1), ("close", 2)])
def test_a_pose_that_cannot_be_taken_is_one_line(
    run: Run, tmp_path: Path, pose: str, status: int
) -> None:
    source, out = hinge().glb(tmp_path / "a.glb"), tmp_path / "b.glb"
    ran = run("vertex", source, "-o", out, "--pose", pose)
    assert (ran.status, ran.out, out.exists()) == (status, "", False)
    assert one_line(ran.err)

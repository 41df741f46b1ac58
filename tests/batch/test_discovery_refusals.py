"""What a batch does not bake: assets that fail alone, and batches that must not begin."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from aobake import InputError, SettingsError
from aobake.batch.discovery import plan_batch
from aobake.batch.places import local_folder
from aobake.batch.settings import BatchSettings
from aobake.batch.tasks import Planned
from tests.batch.test_discovery import assets, planned, targets, toml

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such links or names")


def refused(found: list[Planned]) -> dict[str, str]:
    return {one.source: one.refused for one in found if one.refused}


@pytest.mark.parametrize(
    ("names", "bake", "what"),
    [
        (("a.glb", "a.stl"), "vertex", "a.glb would also be written for"),
        (("x/a.stl", "x/a.off"), "vertex", "x/a.glb would also be written for"),
        (("a.obj", "a.gltf"), "texture", "images beside"),
    ],
)
def test_assets_with_one_output_are_refused_and_name_each_other(
    tmp_path: Path, names: tuple[str, str], bake: str, what: str
) -> None:
    assets(tmp_path, *names, "other.glb")
    found = planned(tmp_path, BatchSettings(bake=(bake,)))  # type: ignore[arg-type]
    reasons = refused(found)
    assert set(reasons) == set(names)
    for one, other in (names, names[::-1]):
        assert reasons[one].startswith(f"{tmp_path / 'in' / one}: ")
        assert what in reasons[one]
        assert f"for {other}." in reasons[one]
        assert "Leave one of them out" in reasons[one]


def test_assets_of_one_name_that_share_no_file_are_baked(tmp_path: Path) -> None:
    assets(tmp_path, "a.glb", "a.obj", "a.gltf", "b/a.glb")
    assert len(targets(tmp_path)) == 4


def test_one_of_two_rivals_may_be_left_out(tmp_path: Path) -> None:
    assets(tmp_path, "a.glb", "a.stl")
    assert list(targets(tmp_path, BatchSettings(skip=("*.stl",)))) == ["a.glb"]
    toml(tmp_path, '[files."*.stl"]\nskip = true\n')
    assert list(targets(tmp_path)) == ["a.glb"]


def test_a_wrong_file_of_settings_fails_the_assets_below_it_alone(tmp_path: Path) -> None:
    assets(tmp_path, "a.glb", "bad/b.glb", "bad/x/c.glb", "worse/d.glb")
    bad = toml(tmp_path, "ray = 3\n", under="bad")
    worse = toml(tmp_path, 'falloff = "linear"\n', under="worse")
    found = planned(tmp_path)
    reasons = refused(found)
    assert list(reasons) == ["bad/b.glb", "bad/x/c.glb", "worse/d.glb"]
    assert reasons["bad/b.glb"].startswith(f'{bad}: there is no setting "ray"')
    assert reasons["worse/d.glb"].startswith(f"{worse}: falloff")
    assert refused(planned(tmp_path, None, {"max_distance": 2.0})).keys() == {
        "bad/b.glb",
        "bad/x/c.glb",
    }


def test_a_format_that_cannot_hold_the_result_fails_its_assets_alone(tmp_path: Path) -> None:
    assets(tmp_path, "a.glb", "b.glb")
    toml(tmp_path, '[files."b.*"]\nformat = "stl"\n')
    reasons = refused(planned(tmp_path))
    assert list(reasons) == ["b.glb"]
    assert "format is 'stl'" in reasons["b.glb"]


@pytest.mark.parametrize(
    ("settings", "flags", "message"),
    [
        (BatchSettings(), {"rays": 0}, "--rays is 0"),
        (BatchSettings(preset="hero"), {}, "--preset is 'hero'"),
        (BatchSettings(format="gbl"), {}, "format is 'gbl'.*Did you mean \"glb\""),
        (BatchSettings(format="ply", bake=("texture",)), {}, "format is 'ply'.*lightmap"),
    ],
)
def test_a_flag_that_is_wrong_for_every_asset_begins_no_batch(
    tmp_path: Path, settings: BatchSettings, flags: dict[str, object], message: str
) -> None:
    assets(tmp_path, "a.glb")
    with pytest.raises(SettingsError, match=message):
        planned(tmp_path, settings, flags)


@pytest.mark.parametrize(
    ("source", "target", "why"),
    [
        ("in", "in", "the assets are in this folder"),
        ("in", "in/baked", "would be baked again"),
        ("in/props", "in", "lies in it"),
    ],
)
def test_outputs_and_assets_are_kept_apart(
    tmp_path: Path, source: str, target: str, why: str
) -> None:
    assets(tmp_path, "props/a.glb")
    with pytest.raises(SettingsError, match=why):
        plan_batch(
            local_folder(tmp_path / source), local_folder(tmp_path / target), BatchSettings()
        )


@posix
def test_outputs_and_assets_are_kept_apart_behind_links_too(tmp_path: Path) -> None:
    assets(tmp_path, "a.glb")
    (tmp_path / "link").symlink_to("in")
    with pytest.raises(SettingsError, match="the assets are in this folder"):
        plan_batch(local_folder(tmp_path / "in"), local_folder(tmp_path / "link"), BatchSettings())


@pytest.mark.parametrize("words", ["baked", "baked/", "/baked/**", "ba*"])
def test_outputs_may_lie_among_the_assets_where_they_are_excluded(
    tmp_path: Path, words: str
) -> None:
    assets(tmp_path, "a.glb", "baked/a.glb")
    source, target = local_folder(tmp_path / "in"), local_folder(tmp_path / "in" / "baked")
    found = plan_batch(source, target, BatchSettings(skip=(words,)))
    assert [one.source for one in found] == ["a.glb"]
    assert not refused(found)


def test_a_folder_that_is_not_there_is_no_batch(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        planned(tmp_path)


@posix
def test_hostile_names_are_names(tmp_path: Path) -> None:
    names = [
        "a b.glb", "'quote\".glb", "🫖.glb", "<script>alert(1)<", "line\nbreak.glb", "-o.glb",
        "$(reboot).glb", os.fsdecode(b"caf\xe9.glb"), "[x].glb", "a/*.glb", "{b}.glb", "%41.glb",
    ]  # fmt: skip
    assets(tmp_path, *(f"{name}/x.glb" if name.endswith("<") else name for name in names))
    found = planned(tmp_path)
    assert len(found) == len(names)
    assert not refused(found)
    assert all(one.job.input.is_file() for one in found)


@posix
def test_a_name_too_long_for_its_output_fails_alone_in_one_line(tmp_path: Path) -> None:
    longest = "é" * 125 + "x.glb"  # 255 bytes
    line = "a\n" * 124 + ".stl"
    assets(tmp_path, longest, line)
    assert not refused(planned(tmp_path))
    reasons = refused(planned(tmp_path, BatchSettings(bake=("vertex", "texture"))))
    assert set(reasons) == {longest, line}
    assert all("more than 255 bytes" in reason for reason in reasons.values())
    assert all(len(reason.splitlines()) == 1 for reason in reasons.values())


@posix
def test_what_cannot_be_read_is_refused_unless_it_is_excluded(tmp_path: Path) -> None:
    assets(tmp_path, "a.glb")
    (tmp_path / "outside").mkdir()
    (tmp_path / "in" / "gone.glb").symlink_to("nothing")
    (tmp_path / "in" / "gone.txt").symlink_to("nothing")
    (tmp_path / "in" / "far").symlink_to(tmp_path / "outside")
    reasons = refused(planned(tmp_path))
    assert set(reasons) == {"gone.glb", "far"}
    assert reasons["far"].startswith(f"{tmp_path / 'in' / 'far'}: ")
    assert not refused(planned(tmp_path, BatchSettings(skip=("far/", "gone.*"))))


@posix
def test_a_link_to_a_folder_that_holds_it_ends(tmp_path: Path) -> None:
    assets(tmp_path, "x/a.glb")
    (tmp_path / "in" / "x" / "loop").symlink_to(tmp_path / "in")
    assert list(targets(tmp_path)) == ["x/a.glb"]

"""What is baked again, what is not, and what is only copied: every way a job can stand."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from aobake.batch import keys, standing
from aobake.batch.places import Stamp
from aobake.batch.tasks import Outcome
from aobake.settings import BakeSettings
from tests.batch.workshop import SETTINGS, Workshop, digest


@pytest.fixture
def shop(tmp_path: Path) -> Workshop:
    """A batch of two assets and one that has a texture, baked once."""
    made = Workshop(tmp_path)
    made.asset("a.glb", "box")
    made.asset("props/b.glb", "ball")
    made.asset("props/c.gltf", "chair")
    made.asset("props/wood.png", "oak")
    made.sides["props/c.gltf"] = ("props/wood.png",)
    assert set(made.kinds().values()) == {"new"}
    return made


def test_a_second_run_bakes_nothing_and_a_third_reads_nothing(shop: Workshop) -> None:
    assert set(shop.kinds().values()) == {"unchanged"}
    shop.read_names.clear()
    assert set(shop.kinds().values()) == {"unchanged"}
    assert shop.read_names == []
    assert shop.is_right()


def test_an_asset_under_a_new_stamp_is_read_once_and_is_unchanged(shop: Workshop) -> None:
    shop.run()
    shop.read_names.clear()
    os.utime(shop.source.path("a.glb"), (1, 1))
    assert shop.kinds()["a.glb"] == "unchanged"
    assert shop.read_names == ["a.glb"]
    assert shop.kinds()["a.glb"] == "unchanged"
    assert shop.read_names == ["a.glb"]


def test_a_changed_asset_alone_is_baked_again(shop: Workshop) -> None:
    shop.asset("a.glb", "fox")  # of the same size: only its digest tells
    found = shop.run()
    assert {name: s.kind for name, s in found.items() if s.to_bake} == {"a.glb": "input changed"}
    assert "a.glb" in found["a.glb"].reason
    assert shop.is_right()


def test_an_asset_that_changed_while_it_was_baked_is_baked_again(shop: Workshop) -> None:
    """Its digest is of what was read, its stamp of what came after: they must not vouch for each other."""
    shop.asset("a.glb", "one")
    planned = shop.planned("a.glb")
    with shop.open() as manifest:
        manifest.begin({})
        manifest.standings([planned])
        outcome = shop.baked(planned)
        shop.asset("a.glb", "two")
        manifest.record(planned, outcome)
    assert shop.look(planned).kind == "input changed"


def test_an_asset_that_changed_before_its_digest_was_taken_is_baked_again(shop: Workshop) -> None:
    """It was read, written anew by somebody else, and only then digested: the digest is of no bake."""
    shop.asset("a.glb", "one")
    planned = shop.planned("a.glb")
    with shop.open() as manifest:
        manifest.begin({})
        manifest.standings([planned])
        made = shop.output(planned)
        shop.asset("a.glb", "two")
        outcome = shop.baked(planned)
        shop.target.path("a.glb").write_bytes(made)
        manifest.record(planned, replace(outcome, outputs=(("a.glb", digest(made)),)))
    found = shop.look(planned)
    assert (found.kind, found.reason) == ("input changed", "a.glb changed while it was baked")
    assert shop.kinds(planned) == {"a.glb": "input changed"}
    assert shop.kinds(planned) == {"a.glb": "unchanged"}
    assert shop.target.path("a.glb").read_bytes() == shop.output(planned)


@pytest.mark.parametrize("change", ["other", "gone"])
def test_a_side_file_counts_as_the_asset_does(shop: Workshop, change: str) -> None:
    if change == "gone":
        shop.source.path("props/wood.png").unlink()
    else:
        shop.asset("props/wood.png", "ash")
    found = shop.look(shop.planned("props/c.gltf"))
    assert found.kind == "input changed"
    assert "props/wood.png" in found.reason


def test_a_side_file_outside_of_the_folder_counts_as_well(shop: Workshop) -> None:
    """As where --root allows it: its name is a path then."""
    outside = shop.source.folder.parent / "wood.png"
    outside.write_bytes(b"oak")
    shop.sides["a.glb"] = (outside.as_posix(),)
    planned = shop.planned("a.glb")
    with shop.open() as manifest:
        manifest.begin({})
        manifest.standings([planned])
        manifest.record(planned, shop.baked(planned, copies=False))
    assert shop.look(planned).kind == "unchanged"
    outside.write_bytes(b"ash")
    assert shop.look(planned).kind == "input changed"


def test_a_side_file_that_was_absent_and_appears_has_its_asset_baked_again(shop: Workshop) -> None:
    shop.sides["a.glb"] = ("tint.png",)
    shop.asset("a.glb", "with a tint")
    assert shop.kinds()["a.glb"] == "input changed"
    assert shop.kinds()["a.glb"] == "unchanged"
    shop.asset("tint.png", "red")
    assert shop.run()["a.glb"].reason == "tint.png is there now"
    assert shop.kinds()["a.glb"] == "unchanged"


def test_settings_that_matter_have_it_baked_again_and_are_named(shop: Workshop) -> None:
    found = shop.look(shop.planned("a.glb", replace(SETTINGS, rays=32)))
    assert found.kind == "settings changed"
    assert found.reason == "rays 16 -> 32"


def test_settings_that_do_not_matter_leave_it_be(shop: Workshop) -> None:
    other = replace(
        SETTINGS, threads=1, size=64, padding=9, denoise="off"
    )  # of textures, all but one
    assert shop.look(shop.planned("a.glb", other)).kind == "unchanged"


def test_the_same_number_written_in_another_way_is_the_same(shop: Workshop) -> None:
    planned = shop.planned("a.glb", replace(SETTINGS, max_distance=2))
    shop.run(planned)
    keys._recipe.cache_clear()  # to which 2 is 2.0 in any case
    assert shop.look(shop.planned("a.glb", replace(SETTINGS, max_distance=2.0))).kind == "unchanged"
    assert shop.look(shop.planned("a.glb", replace(SETTINGS, max_distance=2.5))).kind != "unchanged"


def test_another_version_bakes_everything_again(
    shop: Workshop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(standing, "__version__", "99.0")
    found = shop.look(shop.planned("a.glb"))
    assert found.kind == "version changed"
    assert "99.0" in found.reason


def test_an_output_that_was_deleted_or_changed_by_hand_is_made_again(shop: Workshop) -> None:
    shop.target.path("a.glb").unlink()
    shop.target.path("props/b.glb").write_bytes(b"painted over")
    found = shop.run()
    assert found["a.glb"].kind == "output missing"
    assert found["props/b.glb"].kind == "output changed"
    assert shop.is_right()


def test_a_side_file_that_was_deleted_beside_the_output_is_made_again(shop: Workshop) -> None:
    shop.run(
        shop.planned("props/c.gltf", replace(SETTINGS, rays=8))
    )  # finds it there, and leaves it
    shop.run(shop.planned("props/c.gltf"))
    shop.target.path("props/wood.png").unlink()
    assert shop.kinds()["props/c.gltf"] == "output missing"
    assert shop.target.path("props/wood.png").read_bytes() == b"oak"


def test_a_job_that_failed_is_tried_again_and_its_last_good_bake_is_not_forgotten(
    shop: Workshop,
) -> None:
    shop.asset("a.glb", "broken")
    planned = shop.planned("a.glb")
    with shop.open() as manifest:
        manifest.begin({})
        manifest.standings([planned])
        manifest.record(planned, Outcome(number=0, status="crashed", reason="a.glb: it crashed"))
    found = shop.look(planned)
    assert (found.kind, found.reason) == ("failed before", "it failed before: a.glb: it crashed")
    assert (found.seconds, found.peak_bytes) == (2.5, 1000)
    shop.asset("a.glb", "box")
    assert shop.look(planned).kind == "unchanged"


def test_a_job_that_never_was_done_is_new_or_failed(shop: Workshop) -> None:
    shop.asset("d.glb")
    planned = shop.planned("d.glb", BakeSettings(rays=77))
    assert shop.look(planned).kind == "new"
    with shop.open() as manifest:
        manifest.begin({})
        manifest.note([planned], "stopped", "the batch was stopped")
    assert shop.look(planned).kind == "new"
    with shop.open() as manifest:
        manifest.begin({})
        manifest.record(planned, Outcome(number=0, status="timeout", reason="d.glb: too slow"))
    found = shop.look(planned)
    assert (found.kind, found.seconds) == ("failed before", None)


def test_a_refused_job_is_not_looked_at(shop: Workshop) -> None:
    refused = replace(shop.planned("a.glb"), refused="a.glb: two assets have this output.")
    found = shop.look(refused)
    assert (found.kind, found.reason) == ("refused", refused.refused)
    assert not found.to_bake


def test_a_target_that_another_asset_has_now_is_baked_again(shop: Workshop) -> None:
    shop.asset("a.ply", "another")
    found = shop.look(shop.planned("a.ply", target="a.glb"))
    assert (found.kind, found.reason) == ("input changed", "it was made from a.glb before")


def test_names_that_cannot_be_printed_are_quoted_in_a_reason() -> None:
    assert standing.shown("stone 🪨.glb") == "stone 🪨.glb"
    assert standing.shown("a\nb\udcff.glb") == r"'a\nb\udcff.glb'"


def test_a_look_at_10000_unchanged_jobs_asks_the_database_three_times(tmp_path: Path) -> None:
    shop = Workshop(tmp_path)
    shop.asset("a.glb")
    shop.run()
    one = shop.planned("a.glb")
    many = [replace(one, target=f"{number}.glb") for number in range(10_000)]
    with shop.open() as manifest:
        asked: list[str] = []
        manifest._database._connection.set_trace_callback(asked.append)
        found = manifest.standings(many)
    assert len(asked) == 3
    assert {each.kind for each in found} == {"moved"}
    assert len(shop.read_names) <= 1  # the asset, for all of them


def test_stamps_are_told_apart_by_time_as_by_size() -> None:
    assert Stamp(3, "1") != Stamp(3, "2")

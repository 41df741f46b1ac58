"""Assets under new names: their outputs are copied, whatever has to be set aside for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from aobake.batch.places import LocalFolder
from aobake.errors import OutputError
from tests.batch.workshop import SETTINGS, Workshop


@pytest.fixture
def shop(tmp_path: Path) -> Workshop:
    made = Workshop(tmp_path)
    for name in ("a", "b", "c"):
        made.asset(f"{name}.glb", name * 3)
    made.run()
    return made


def test_a_renamed_asset_has_its_output_copied_with_all_that_is_known(shop: Workshop) -> None:
    shop.rename("a.glb", "props/chair.glb")
    found = shop.run()["props/chair.glb"]
    assert (found.kind, found.reuse) == ("moved", "a.glb")
    assert found.reason == "its content is that of a.glb before"
    assert shop.is_right()
    assert set(shop.kinds().values()) == {"unchanged"}
    with shop.open() as manifest:
        assert manifest.pictures("props/chair.glb") == {"after": b"PNG of a.glb"}


def test_a_renamed_folder_is_moved_as_a_whole_side_files_too(tmp_path: Path) -> None:
    shop = Workshop(tmp_path)
    for number in range(5):
        shop.asset(f"old/{number}.glb", f"thing {number}")
        shop.sides[f"old/{number}.glb"] = ("old/maps/wood.png",)
        shop.sides[f"new/{number}.glb"] = ("new/maps/wood.png",)
    shop.asset("old/maps/wood.png", "oak")
    for planned in shop.all_planned():  # into the output, as a GLB holds it: no copy beside
        with shop.open() as manifest:
            manifest.begin({})
            manifest.standings([planned])
            manifest.record(planned, shop.baked(planned, copies=False))
    shop.source.path("old").rename(shop.source.path("new"))
    assert set(shop.kinds().values()) == {"moved"}
    assert set(shop.kinds().values()) == {"unchanged"}
    shop.asset("new/maps/wood.png", "ash")
    assert set(shop.kinds().values()) == {"input changed"}


def test_two_assets_that_swapped_names_swap_their_outputs(shop: Workshop) -> None:
    shop.rename("a.glb", "x")
    shop.rename("b.glb", "a.glb")
    shop.rename("x", "b.glb")
    assert shop.kinds() == {"a.glb": "moved", "b.glb": "moved", "c.glb": "unchanged"}
    assert shop.is_right()
    assert sorted(path.name for path in shop.database.parent.iterdir()) == ["batch.sqlite"]
    with shop.open() as manifest:
        assert manifest.pictures("a.glb") == {"after": b"PNG of b.glb"}
        assert manifest.pictures("b.glb") == {"after": b"PNG of a.glb"}


def test_a_row_of_assets_that_moves_up_by_one_is_not_baked(shop: Workshop) -> None:
    shop.rename("c.glb", "d.glb")
    shop.rename("b.glb", "c.glb")
    shop.rename("a.glb", "b.glb")
    shop.asset("a.glb", "a new one")
    assert shop.kinds() == {"a.glb": "input changed"} | dict.fromkeys(
        ("b.glb", "c.glb", "d.glb"), "moved"
    )
    assert shop.is_right()


def test_a_copy_of_an_asset_has_a_copy_of_its_output(shop: Workshop) -> None:
    shop.asset("copy.glb", "aaa")
    assert shop.kinds()["copy.glb"] == "moved"
    assert shop.is_right()


@pytest.mark.parametrize("trouble", ["settings", "output", "format"])
def test_what_is_not_the_same_in_all_is_baked(shop: Workshop, trouble: str) -> None:
    name, bake = "z.glb", SETTINGS
    if trouble == "format":
        name = "z.obj"
        shop.asset("a.obj", "aaaa")
        shop.run()
        shop.rename("a.obj", name)
    else:
        shop.rename("a.glb", name)
    if trouble == "settings":
        bake = replace(SETTINGS, seed=1)
    if trouble == "output":
        shop.target.path("a.glb").write_bytes(b"painted over")
    assert shop.look(shop.planned(name, bake)).kind == "new"


def test_the_side_files_must_be_the_same_as_well(shop: Workshop) -> None:
    shop.asset("b.glb", "with a texture")
    shop.asset("wood.png", "oak")
    shop.sides["b.glb"] = ("wood.png",)
    planned = shop.planned("b.glb")
    with shop.open() as manifest:
        manifest.begin({})
        manifest.standings([planned])
        manifest.record(planned, shop.baked(planned, copies=False))
    shop.rename("b.glb", "props/b.glb")
    moved = shop.planned("props/b.glb")
    assert shop.look(moved).kind == "new"
    shop.asset("props/wood.png", "ash")
    assert shop.look(moved).kind == "new"
    shop.asset("props/wood.png", "oak")
    assert shop.look(moved).kind == "moved"


def test_a_swap_that_cannot_be_set_aside_is_baked(
    shop: Workshop, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = LocalFolder.copy

    def full_at_times(self: LocalFolder, name: str, to: str) -> None:
        if to.startswith(".aobake/"):
            raise OutputError(f"{to}: it cannot be written (No space left on device).")
        copy(self, name, to)

    monkeypatch.setattr(LocalFolder, "copy", full_at_times)
    shop.rename("a.glb", "x")
    shop.rename("b.glb", "a.glb")
    shop.rename("x", "b.glb")
    assert set(shop.kinds(shop.planned("a.glb"), shop.planned("b.glb")).values()) == {"moved"}
    assert shop.is_right()


def test_a_ply_is_not_moved_where_occluders_go_by_its_name(tmp_path: Path) -> None:
    """Its mesh is called after the file: under another name it may be chosen, or not."""
    for occluders, kind in ((("all",), "moved"), (("own",), "moved"), (("stone*",), "new")):
        folder = tmp_path / occluders[0].strip("*")
        folder.mkdir()
        shop = Workshop(folder)
        bake = replace(SETTINGS, occluders=occluders)
        shop.asset("stone.ply")
        shop.run(shop.planned("stone.ply", bake))
        shop.rename("stone.ply", "tree.ply")
        assert shop.look(shop.planned("tree.ply", bake)).kind == kind


def test_what_cannot_be_copied_is_baked(shop: Workshop, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: LocalFolder, name: str, to: str) -> None:
        raise OutputError(f"{to}: it cannot be written (No space left on device).")

    shop.rename("a.glb", "d.glb")
    monkeypatch.setattr(LocalFolder, "copy", full)
    planned = shop.planned("d.glb")
    with shop.open() as manifest:
        manifest.begin({})
        (found,) = manifest.standings([planned])
        assert found.kind == "moved"
        assert manifest.adopt([(planned, found)]) == [(planned, found)]
    assert shop.look(planned).kind == "moved"

"""What is stale, and what of it is removed: only what a bake wrote, and nothing that anybody needs."""

from __future__ import annotations

from pathlib import Path

import pytest

from aobake.batch.manifest import Pruned
from aobake.batch.tasks import Planned
from tests.batch.workshop import Workshop


@pytest.fixture
def shop(tmp_path: Path) -> Workshop:
    made = Workshop(tmp_path)
    made.asset("a.glb", "a")
    made.asset("b.glb", "b")
    made.run()
    return made


def pruned(shop: Workshop, *planned: Planned) -> Pruned:
    with shop.open() as manifest:
        jobs = list(planned or shop.all_planned())
        listed = manifest.stale(jobs)
        found = manifest.prune(jobs)
        assert set(listed) == {*found.removed, *(name for name, _ in found.kept)}
        return found


def outputs(shop: Workshop) -> set[str]:
    return {file.name for file in shop.target.files(lambda folder: folder != ".aobake")}


def test_the_output_of_an_asset_that_is_gone_is_removed_and_forgotten(shop: Workshop) -> None:
    shop.source.path("a.glb").unlink()
    assert pruned(shop) == Pruned(removed=("a.glb",), kept=())
    assert outputs(shop) == {"b.glb"}
    assert pruned(shop) == Pruned(removed=(), kept=())
    assert set(shop.kinds().values()) == {"unchanged"}


def test_what_was_changed_or_put_there_by_hand_is_kept(shop: Workshop) -> None:
    shop.source.path("a.glb").unlink()
    shop.target.path("a.glb").write_bytes(b"painted over")
    shop.target.path("notes.txt").write_bytes(b"mine")
    found = pruned(shop)
    assert found == Pruned(removed=(), kept=(("a.glb", "it was changed since it was written"),))
    assert outputs(shop) == {"a.glb", "b.glb", "notes.txt"}


def test_assets_that_were_not_asked_for_keep_their_outputs(shop: Workshop) -> None:
    assert pruned(shop, shop.planned("b.glb")) == Pruned(removed=(), kept=())


def test_an_asset_that_is_written_elsewhere_now_leaves_its_old_output(shop: Workshop) -> None:
    moved = shop.planned("a.glb", target="a_vertex.glb")
    shop.run(moved)
    assert pruned(shop, moved, shop.planned("b.glb")).removed == ("a.glb",)
    assert outputs(shop) == {"a_vertex.glb", "b.glb"}


def test_what_lies_in_a_folder_that_cannot_be_read_is_not_gone(shop: Workshop) -> None:
    shop.asset("props/c.glb", "c")
    shop.run()
    shop.source.path("props").rename(shop.source.folder.parent / "elsewhere")
    shop.source.path("props").symlink_to(shop.source.folder.parent / "unmounted")
    assert pruned(shop) == Pruned(removed=(), kept=())


def test_nothing_is_removed_where_no_asset_is_left(shop: Workshop) -> None:
    """As a folder looks whose disk is not mounted."""
    shop.source.path("a.glb").unlink()
    shop.source.path("b.glb").unlink()
    found = pruned(shop)
    assert [name for name, _ in found.kept] == ["a.glb", "b.glb"]
    assert outputs(shop) == {"a.glb", "b.glb"}


def test_a_side_file_stays_as_long_as_one_asset_needs_it(shop: Workshop) -> None:
    """The first asset brings the texture along, the second finds it there; then the first goes, then the second."""
    shop.asset("wood.png", "oak")
    for name in ("p.gltf", "q.gltf"):
        shop.asset(name, name)
        shop.sides[name] = ("wood.png",)
    shop.run()
    shop.source.path("p.gltf").unlink()
    assert pruned(shop).removed == ("p.gltf",)
    assert set(shop.kinds().values()) == {"unchanged"}
    shop.source.path("q.gltf").unlink()
    assert pruned(shop).removed == ("q.gltf", "wood.png")


def test_a_side_file_that_was_there_before_any_bake_is_never_removed(shop: Workshop) -> None:
    shop.target.path("wood.png").write_bytes(b"oak")
    shop.asset("wood.png", "oak")
    shop.asset("p.gltf")
    shop.sides["p.gltf"] = ("wood.png",)
    shop.run()
    shop.source.path("p.gltf").unlink()
    assert pruned(shop).removed == ("p.gltf",)
    assert "wood.png" in outputs(shop)


def test_what_a_bake_wrote_and_the_next_one_does_not_is_stale(shop: Workshop) -> None:
    shop.asset("wood.png", "oak")
    shop.asset("p.gltf", "with a texture")
    shop.sides["p.gltf"] = ("wood.png",)
    shop.run()
    shop.asset("p.gltf", "without")
    shop.sides["p.gltf"] = ()
    shop.run()
    assert pruned(shop) == Pruned(removed=("wood.png",), kept=())
    assert pruned(shop) == Pruned(removed=(), kept=())
    assert set(shop.kinds().values()) == {"unchanged"}


def test_an_output_whose_name_differs_from_one_in_use_by_case_alone_is_kept(shop: Workshop) -> None:
    """On many disks it is the same file."""
    shop.rename("a.glb", "A.glb")
    shop.run()
    ((name, why),) = pruned(shop).kept
    assert name == "a.glb"
    assert "upper and lower case" in why
    assert "A.glb" in outputs(shop)


def test_a_name_that_leads_out_of_the_target_is_never_followed(shop: Workshop) -> None:
    outside = shop.target.folder.parent / "mine.glb"
    outside.write_bytes(shop.target.path("a.glb").read_bytes())
    with shop.open() as manifest, manifest._database.writing() as connection:
        connection.execute(
            "UPDATE files SET name = ? WHERE role = 'out' AND name = ?", (b"../mine.glb", b"a.glb")
        )
    shop.source.path("a.glb").unlink()
    with shop.open() as manifest:
        ((name, why),) = manifest.prune([shop.planned("b.glb")]).kept
    assert (name, why) == ("../mine.glb", "it lies outside of the folder of the outputs")
    assert outside.exists()

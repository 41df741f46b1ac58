"""`aobake view`, from a file to a page."""

from __future__ import annotations

import webbrowser
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.support import one_line


def test_an_asset_becomes_one_page_and_stays_as_it_is(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    before = corner.read_bytes()
    ran = run("view", corner, "-o", tmp_path / "corner.html")
    assert (ran.status, ran.err) == (0, "")
    assert "corner.html: 144 triangles" in ran.out
    page = (tmp_path / "corner.html").read_text(encoding="utf-8")
    assert "<title>corner.obj</title>" in page
    assert "144 triangles · " in page
    assert corner.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["corner.html", "corner.obj"]


def test_the_same_asset_gives_the_same_page(run: Run, corner: Path, tmp_path: Path) -> None:
    for name in ("a.html", "b.htm"):
        ran = run("view", corner, "-o", tmp_path / name, "--quiet")
        assert (ran.status, ran.out, ran.err) == (0, "", "")
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.htm").read_bytes()


def test_an_existing_page_is_kept_unless_forced(run: Run, corner: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.html"
    out.write_text("mine", encoding="ascii")
    ran = run("view", corner, "-o", out)
    assert ran.status == 2
    assert one_line(ran.err, "out.html", "--force"), ran.err
    assert out.read_text(encoding="ascii") == "mine"
    assert run("view", corner, "-o", out, "--force").status == 0


def test_a_name_that_is_no_page_is_refused_before_anything_is_read(
    run: Run, tmp_path: Path
) -> None:
    ran = run("view", tmp_path / "missing.glb", "-o", tmp_path / "out.png")
    assert ran.status == 2
    assert one_line(ran.err, "out.png", ".html"), ran.err


def test_a_missing_asset_is_one_line(run: Run, tmp_path: Path) -> None:
    ran = run("view", tmp_path / "gone.glb", "-o", tmp_path / "out.html")
    assert ran.status == 1
    assert one_line(ran.err, "gone.glb"), ran.err
    assert not (tmp_path / "out.html").exists()


def test_asked_to_it_opens_the_page_that_it_wrote(
    run: Run, corner: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []
    monkeypatch.setattr(webbrowser, "open", seen.append)
    assert run("view", corner, "-o", tmp_path / "a b.html", "--open").status == 0
    assert seen == [(tmp_path / "a b.html").as_uri()]

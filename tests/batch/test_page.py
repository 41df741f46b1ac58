"""report.html as a file: whole, closed to the network, small, and the same jobs that were put in."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from aobake.batch.page import keep_viewer, page, write_page
from aobake.batch.tasks import Entry
from tests.batch.made_up import HOSTILE, entries, entry, facts, picture


def no_pictures(_: Entry) -> dict[str, bytes]:
    return {}


def elements(path: Path, tag: str) -> list[tuple[str, str]]:
    """Attributes and text of all elements of a tag, as a browser divides them."""
    text = path.read_text(encoding="utf-8")
    return re.findall(rf"<{tag}\b([^>]*)>(.*?)</{tag}\s*>", text, re.DOTALL | re.IGNORECASE)


def rows(path: Path) -> list[dict[str, Any]]:
    (data,) = (text for attributes, text in elements(path, "script") if "json" in attributes)
    return list(json.loads(data))


def test_the_page_holds_every_job(tmp_path: Path) -> None:
    count = len(HOSTILE) + 20
    path = tmp_path / "report.html"
    write_page(path, facts(count), entries(count), no_pictures)
    for row, given in zip(rows(path), entries(count), strict=True):
        assert row["source"] == given.source
        assert row["state"] == given.state
        assert row.get("reason", "") == given.reason
    assert list(tmp_path.iterdir()) == [path], "nothing beside it that is not needed"


@pytest.mark.parametrize("name", HOSTILE)
def test_names_are_data_and_never_markup(tmp_path: Path, name: str) -> None:
    path = tmp_path / "report.html"
    write_page(path, facts(0, source=name), [entry(name)], no_pictures)
    assert len(elements(path, "script")) == 2
    assert [row["source"] for row in rows(path)] == [name]
    shown = name.replace("\0", " ").encode("utf-8", "replace").decode()
    assert html.unescape(elements(path, "h1")[0][1]).startswith(shown.split("\r")[0])
    text = path.read_text(encoding="utf-8")
    (data,) = re.findall(r'id="rows">(.*?)</script>', text, re.DOTALL)
    assert data.isascii()
    assert not set("<>&") & set(data)


def test_the_page_may_run_its_own_script_and_reach_nothing(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_page(path, facts(1), entries(1), no_pictures)
    text = path.read_text(encoding="utf-8")
    found = re.search(r'Content-Security-Policy" content="([^"]*)"', text)
    assert found
    policy = html.unescape(found[1])
    own = [elements(path, "script")[1][1], elements(path, "style")[0][1]]
    hashes = [base64.b64encode(hashlib.sha256(part.encode()).digest()).decode() for part in own]
    assert re.findall(r"'sha256-([^']+)'", policy) == hashes
    assert policy.startswith("default-src 'none';")
    assert "http" not in policy
    assert "unsafe" not in policy
    assert "://" not in text


def test_settings_are_told_where_they_are_not_the_defaults(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    given = entry("a.glb", settings={"rays": 64, "seed": 0, "falloff": "none", "threads": 2})
    write_page(path, facts(0), [given, entry("b.glb", settings={"seed": 0})], no_pictures)
    first, second = rows(path)
    assert first["settings"] == {"rays": 64, "threads": 2}
    assert "settings" not in second


def test_pictures_are_within_the_page_until_they_would_be_too_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = len(picture(0))
    monkeypatch.setattr(page, "MOST_EMBEDDED", 3 * one)
    path = tmp_path / "all about it.html"

    def pictures(given: Entry) -> dict[str, bytes]:
        number = int(given.source)
        return {"before": picture(number), "after": picture(number + 100)}

    write_page(path, facts(0), [entry(str(n)) for n in range(3)], pictures)
    found = [row[which] for row in rows(path) for which in ("before", "after")]
    assert [address.startswith("data:image/png;base64,") for address in found] == [True] * 3 + [
        False
    ] * 3
    for address, shade in zip(found[3:], (101, 2, 102), strict=True):
        assert address.startswith("all%20about%20it_files/")
        beside = tmp_path / address.replace("%20", " ")
        assert beside.read_bytes() == picture(shade)
    write_page(path, facts(0), [entry("7")], pictures)
    assert list((tmp_path / "all about it_files").iterdir()) == [], "of no use any more"


def test_viewers_are_linked_where_they_were_kept_and_the_asset_stands(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    folder = tmp_path / "report_files"
    names = ["<b>.glb", "b.glb", "c.glb"]
    for name in names[:2]:
        keep_viewer(path, name, b"viewer of " + name.encode())
    (folder / "notes.txt").write_text("mine", encoding="utf-8")
    jobs = [entry("<b>.glb"), entry("b.glb", "failed"), entry("c.glb")]
    write_page(path, facts(0), jobs, no_pictures)
    first, *others = rows(path)
    assert (tmp_path / first["view"]).read_bytes() == b"viewer of <b>.glb"
    assert not any("view" in row for row in others)
    kept = {item.name for item in folder.iterdir()}
    assert kept == {"draco.min.js", "viewer.min.js", "notes.txt", Path(first["view"]).name}


def test_a_page_that_breaks_off_leaves_the_earlier_one(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_page(path, facts(2), entries(2), no_pictures)
    before = path.read_bytes()

    def broken() -> Iterator[Entry]:
        yield entry("a.glb")
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_page(path, facts(2), broken(), no_pictures)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_the_same_batch_gives_the_same_page(tmp_path: Path) -> None:
    made = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_page(tmp_path / name / "r.html", facts(30), entries(30), no_pictures)
        made.append((tmp_path / name / "r.html").read_bytes())
    assert made[0] == made[1]

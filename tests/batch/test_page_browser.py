"""report.html in a browser without a network: 300 assets, sorted, filtered and opened by keyboard."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

import aobake
from aobake.batch.page import keep_viewer, write_page
from aobake.batch.page import page as page_module
from aobake.batch.tasks import Entry
from aobake.viewer import packed_glb, page_of
from tests.batch.made_up import HOSTILE, entries, entry, facts, picture
from tests.browser import CHROMIUM, Browser, browsing

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")

COUNT = 300
NAMES = "[...document.querySelectorAll('.name')].map((name) => name.title)"
FOCUSED = "document.activeElement.title || document.activeElement.textContent"
SETTLED = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done())))"


def pictures(entry: Entry) -> dict[str, bytes]:
    return {} if entry.report is None else {"before": picture(200), "after": picture(90)}


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page, whose later pictures lie beside it."""
    path = tmp_path_factory.mktemp("page") / "report.html"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page_module, "MOST_EMBEDDED", 50 * len(picture(0)))
        write_page(path, facts(COUNT), entries(COUNT), pictures)
    return path


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browsing(tmp_path_factory.mktemp("profile")) as found:
        yield found


@pytest.fixture
def tab(browser: Browser, report: Path) -> Browser:
    """The page, opened anew."""
    browser.trouble.clear()
    browser.leave()
    browser.open(report)
    return browser


def shown(tab: Browser) -> int:
    """How many assets the page says that it shows."""
    return int(str(tab.run("document.querySelector('#count').textContent")).split()[0])


def tab_to(tab: Browser, text: str) -> None:
    """Press Tab until an element with this text has the focus."""
    for _ in range(40):
        if str(tab.run(FOCUSED)).startswith(text):
            return
        tab.press("Tab")
    raise AssertionError(f"{text} cannot be reached")


def test_a_page_of_300_assets_shows_the_worst_first_and_makes_only_what_is_in_view(
    tab: Browser,
) -> None:
    assert shown(tab) == COUNT
    assert tab.run("document.querySelectorAll('tr.row').length") < 60
    assert tab.run("document.querySelector('tr.row .c-state').textContent").startswith("crashed")
    assert tab.trouble == []


def test_pictures_are_seen_in_the_page_and_beside_it(tab: Browser) -> None:
    tab_to(tab, "Triangles")
    tab.press("Enter")
    for turned in ("beside", "within"):
        assert tab.run(SETTLED) is None
        found = tab.run(
            "Promise.all([...document.images].map((image) => image.decode().then(() => "
            "[image.src.startsWith('data:'), image.naturalWidth])))"
        )
        assert len(found) > 20
        assert {width for _, width in found} == {8}
        assert {inside for inside, _ in found} == {turned == "within"}
        tab.press("Enter")  # the other way round
    assert tab.trouble == []


def test_headers_sort_by_keyboard_and_say_how(tab: Browser) -> None:
    tab_to(tab, "Triangles")
    tab.press("Enter")
    sort = "document.activeElement.closest('th').getAttribute('aria-sort')"
    first = "document.querySelector('tr.row .c-triangles').textContent"
    assert tab.run(sort) == "descending"
    most = max(n for n, entry in enumerate(entries(COUNT)) if entry.report is not None)
    assert tab.run(first) == str(most), "triangles are the numbers of the assets"
    tab.press("Enter")
    assert tab.run(sort) == "ascending"
    assert tab.run(first) == "0"
    assert tab.run("document.querySelectorAll('[aria-sort]').length") == 1


def test_counts_filter_and_are_taken_back(tab: Browser) -> None:
    failed = sum(entry.state == "failed" for entry in entries(COUNT))
    tab_to(tab, "failed")
    tab.press("Enter")
    assert shown(tab) == failed
    assert tab.run("document.activeElement.getAttribute('aria-pressed')") == "true"
    tab.press("Enter")
    assert shown(tab) == COUNT
    warned = sum(bool(entry.report and entry.report["warnings"]) for entry in entries(COUNT))
    tab_to(tab, "with warnings")
    tab.press("Enter")
    assert shown(tab) == warned


def test_text_finds_names_messages_and_nothing(tab: Browser) -> None:
    tab.press("/", *"00123")
    assert shown(tab) == 1
    assert tab.run(NAMES)[0].endswith("asset 00123.glb")
    tab.press(*"xyz")
    assert shown(tab) == 0
    tab_to(tab, "Show all")
    tab.press("Enter")
    assert shown(tab) == COUNT
    assert tab.run("document.activeElement.id") == "text"


def test_a_folder_holds_the_folders_in_it(tab: Browser) -> None:
    inside = sum(entry.source.startswith("props/") for entry in entries(COUNT))
    tab.run(
        "document.querySelector('#folder').value = 'props', "
        "document.querySelector('#folder').dispatchEvent(new Event('change'))"
    )
    assert shown(tab) == inside


def test_rows_are_walked_and_opened_by_keyboard(tab: Browser) -> None:
    at = "Number(document.activeElement.closest('tr').dataset.number)"
    names = [entry.source for entry in entries(COUNT)]
    # Scripts compare texts by their units of 16 bits.
    in_order = sorted(range(COUNT), key=lambda n: names[n].encode("utf-16-be", "surrogatepass"))
    tab_to(tab, "Asset")
    tab.press("Enter")  # sorted by name
    tab_to(tab, tab.run(f"{NAMES}[0]"))
    tab.press("End")
    assert tab.run(at) == in_order[-1]
    tab.press("ArrowUp", "ArrowUp", "ArrowDown")
    assert tab.run(at) == in_order[-2]
    tab.press("Enter")
    assert tab.run("document.activeElement.getAttribute('aria-expanded')") == "true"
    assert tab.run("document.querySelector('#detail').textContent").startswith("before baking")
    tab.press("Enter")
    assert tab.run("document.querySelector('#detail')") is None
    tab.press("Home", "PageDown")
    assert tab.run(SETTLED) is None
    assert 2 < in_order.index(tab.run(at)) < 30
    top, bottom, height = tab.run(
        "(({ top, bottom }) => [top, bottom, innerHeight])"
        "(document.activeElement.getBoundingClientRect())"
    )
    assert 0 <= top < bottom <= height, "what has the focus is in view"


def test_names_are_shown_as_they_are_and_do_nothing(tab: Browser) -> None:
    for name in HOSTILE:
        source = next(
            entry.source for entry in entries(len(HOSTILE)) if entry.source.endswith(name)
        )
        found = tab.run(f"ROWS.findIndex((row) => row.source === {json.dumps(source)})")
        assert found >= 0
        tab.run(f"chosen.text = ROWS[{found}].source.toLowerCase(), choose(), toggle({found})")
        assert shown(tab) == 1
        text = tab.run("document.querySelector('#body').textContent")
        for spelled in ("\x00", "\x1b", "\u202e", "\n"):
            assert spelled not in text
    assert tab.run("document.documentElement.dataset.broken || ''") == ""
    assert tab.run("document.querySelectorAll('script').length") == 2
    assert tab.trouble == []


def test_a_viewer_runs_the_script_that_it_shares(
    browser: Browser, corner: Path, tmp_path: Path
) -> None:
    """Its policy lets it; whether this browser can draw is another question."""
    path = tmp_path / "report.html"
    viewer = page_of(packed_glb(aobake.load(corner)).glb, "corner", scripts_in="")
    keep_viewer(path, "corner.glb", viewer)
    write_page(path, facts(0), [entry("corner.glb")], pictures)
    browser.leave()
    browser.open(path)
    link = browser.run("toggle(0), document.querySelector('#detail a').href")
    browser.leave()
    browser.trouble.clear()
    browser.open(tmp_path / "report_files" / link.rpartition("/")[2])
    assert browser.run("document.documentElement.dataset.state") in {"ready", "failed"}
    assert not [line for line in browser.trouble if "Content Security Policy" in line]


def test_details_move_what_is_below_and_nothing_is_lost_on_the_way(tab: Browser) -> None:
    """Scrolled through with details open, every asset comes by once, in order."""
    tab_to(tab, tab.run(f"{NAMES}[0]"))
    tab.press("ArrowDown", "ArrowDown", "Enter")
    found = tab.run(
        """(async () => {
          const seen = new Map();
          for (let y = 0; y <= document.documentElement.scrollHeight; y += 500) {
            scrollTo(0, y);
            await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
            for (const row of document.querySelectorAll('tr.row')) {
              const at = Math.round(row.getBoundingClientRect().top + scrollY);
              const earlier = seen.get(row.dataset.number);
              if (earlier !== undefined && Math.abs(earlier - at) > 1) return `${row.dataset.number} moved`;
              seen.set(row.dataset.number, at);
            }
          }
          return seen.size;
        })()"""
    )
    assert found == COUNT
    assert tab.trouble == []

"""The page on formats says what its script finds."""

from __future__ import annotations

import pytest

from tests.support import ROOT, python

SCRIPT = ROOT / "benchmarks" / "formats.py"
pytestmark = pytest.mark.skipif(not SCRIPT.is_file(), reason="not a checkout")


def test_the_page_on_formats_is_what_the_script_finds() -> None:
    for name in ("pxr", "lxml", "networkx", "collada"):
        pytest.importorskip(name, reason="the extras usd and formats")
    ran = python(str(SCRIPT))
    assert ran.returncode == 0, ran.stderr
    page = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    assert ran.stdout == page, "run: python benchmarks/formats.py > docs/formats.md"
    assert "| no |" not in page.partition("## What is kept")[2]

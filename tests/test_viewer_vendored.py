"""The scripts that pages carry are those that were built, of the versions that are pinned."""

from __future__ import annotations

import hashlib
import json
import re
from importlib.resources import files

import pytest

from tests.support import ROOT

FOLDER = files("aobake.viewer")


def test_vendored_files_are_those_that_were_built() -> None:
    vendor = FOLDER / "vendor"
    manifest = json.loads((vendor / "manifest.json").read_text(encoding="utf-8"))
    found = {path.name for path in vendor.iterdir()} - {"manifest.json"}
    assert found == manifest["files"].keys()
    for name, digest in manifest["files"].items():
        assert hashlib.sha256((vendor / name).read_bytes()).hexdigest() == digest, name


def test_vendored_files_are_of_the_versions_that_are_pinned() -> None:
    manifest = json.loads((FOLDER / "vendor" / "manifest.json").read_text(encoding="utf-8"))
    wanted = json.loads((ROOT / "viewer" / "package.json").read_text(encoding="utf-8"))
    locked = json.loads((ROOT / "viewer" / "package-lock.json").read_text(encoding="utf-8"))
    assert manifest["packages"].items() <= wanted["devDependencies"].items()
    for name, version in wanted["devDependencies"].items():
        assert re.fullmatch(r"\d+\.\d+\.\d+", version), f"{name} is not pinned"
        entry = locked["packages"][f"node_modules/{name}"]
        assert entry["version"] == version
        assert entry["integrity"].startswith("sha512-")


@pytest.mark.parametrize("name", ["viewer.min.js", "draco.min.js"])
def test_vendored_scripts_cannot_end_the_element_that_holds_them(name: str) -> None:
    text = (FOLDER / "vendor" / name).read_bytes()
    assert text.isascii()
    assert b"</script" not in text.lower()
    assert b"<!--" not in text
    assert b"eval(" not in text.replace(b"wasm-unsafe-eval", b"")

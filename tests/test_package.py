"""The package as it is shipped: each file once, nothing at the top level, tools that stay off the links."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import aobake
from tests.support import ROOT

LINKS = ("cli", "meshes", "shading")
IN_CHECKOUT = (ROOT / "pyproject.toml").is_file()
pytestmark = pytest.mark.skipif(not IN_CHECKOUT, reason="not a checkout")


def packaged() -> set[str]:
    kinds = {".py", ".typed", ".html", ".css", ".js", ".json", ".txt"}
    files = [p for p in (ROOT / "aobake").rglob("*") if p.is_file() and p.suffix in kinds]
    return {p.relative_to(ROOT).as_posix() for p in files}


def build(kind: str, folder: Path) -> Path:
    code = (
        f"import sys; from hatchling.builders.{kind} import {kind.capitalize()}Builder as Builder; "
        "print(next(Builder(sys.argv[1]).build(directory=sys.argv[2], versions=['standard'])))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(ROOT), str(folder)],
        capture_output=True,
        text=True,
        check=True,
    )
    return Path(done.stdout.strip())


def test_the_wheel_holds_each_file_once_and_one_package(tmp_path: Path) -> None:
    pytest.importorskip("hatchling", reason="comes with the extra dev")
    with zipfile.ZipFile(build("wheel", tmp_path)) as wheel:
        names = wheel.namelist()
        metadata = wheel.read(f"aobake-{aobake.__version__}.dist-info/METADATA").decode()
    code = {
        name for name in names if not name.startswith(f"aobake-{aobake.__version__}.dist-info/")
    }
    assert len(names) == len(set(names))
    assert code == packaged()
    assert f"\nVersion: {aobake.__version__}\n" in metadata
    for extra in ("repair", "denoise", "plot", "cluster", "formats", "usd", "all", "dev"):
        assert f"\nProvides-Extra: {extra}\n" in metadata


def test_the_source_archive_holds_what_builds_and_tests_it(tmp_path: Path) -> None:
    pytest.importorskip("hatchling", reason="comes with the extra dev")
    with tarfile.open(build("sdist", tmp_path)) as archive:
        names = [name.partition("/")[2] for name in archive.getnames()]
    assert len(names) == len(set(names))
    assert packaged() <= set(names)
    assert {"pyproject.toml", "README.md", "LICENSE", "Makefile", "tests/conftest.py"} <= set(names)
    assert not [name for name in names if name.partition("/")[0] in LINKS]


@pytest.mark.parametrize("name", LINKS)
def test_a_link_at_the_top_leads_into_the_package(name: str) -> None:
    if not (ROOT / "aobake" / name).is_dir():
        pytest.skip(f"aobake/{name} comes later")
    link = ROOT / name
    if not link.exists():
        pytest.skip("unpacked from an archive, which holds no links")
    assert link.is_symlink()
    assert link.resolve() == ROOT / "aobake" / name


def test_the_formatter_sees_no_file_through_a_link() -> None:
    pytest.importorskip("ruff", reason="comes with the extra dev")
    done = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--show-files", "."],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    seen = [Path(line).relative_to(ROOT).parts[0] for line in done.stdout.split("\n") if line]
    assert "aobake" in seen
    assert not set(seen) & set(LINKS)

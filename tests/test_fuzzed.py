"""Files that fuzzing has found, each named by what is wrong with it: read and baked, or refused in one line."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from fuzz.contract import hold

FOUND = sorted((Path(__file__).parent / "fuzzed").iterdir())


@pytest.mark.timeout(100)  # kernels may have to be compiled first
@pytest.mark.parametrize("file", FOUND, ids=lambda file: file.name)
def test_a_file_that_once_broke_a_bake_does_so_no_more(file: Path, tmp_path: Path) -> None:
    path = tmp_path / file.name
    shutil.copyfile(file, path)
    hold(path)


def test_there_are_such_files() -> None:
    assert len(FOUND) >= 4

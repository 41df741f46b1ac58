"""Temporary folders of workers: gone with their process, or with the next batch, and no folder of anybody else."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from aobake.batch.scratch import MARK, PREFIX, make_scratch, remove_abandoned
from aobake.errors import EngineError

HOLD = """
import sys
from aobake.batch.scratch import make_scratch
scratch = make_scratch()
print(scratch.folder, flush=True)
sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def test_a_folder_is_removed_with_all_that_is_in_it(temporary: Path) -> None:
    scratch = make_scratch()
    (Path(scratch.folder) / "fetched.glb").write_bytes(b"much")
    scratch.remove()
    assert list(temporary.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="files in use are not renamed there")
def test_that_of_a_killed_process_is_removed_by_the_next_one_and_not_before() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        folder = Path(process.stdout.readline().strip())
        (folder / "fetched.glb").write_bytes(b"much")
        remove_abandoned()
        assert folder.exists()
        process.kill()
    remove_abandoned()
    assert not folder.exists()


def test_folders_of_others_stay(temporary: Path) -> None:
    kept = temporary / "kept"
    kept.mkdir()
    (kept / MARK).touch()
    for name in (f"{PREFIX}no_marks", "aobake-workshop", f"{PREFIX}too_long_"):
        (temporary / name).mkdir()
        (temporary / name / "work.txt").touch()
    (temporary / f"{PREFIX}too_long_" / MARK).touch()
    (temporary / f"{PREFIX}abcdefgh").symlink_to(kept)
    before = sorted(temporary.rglob("*"))
    remove_abandoned()
    assert sorted(temporary.rglob("*")) == before


def test_a_machine_without_temporary_files_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", "/dev/null/none")
    with pytest.raises(EngineError, match=r"temporary files \(.*TMPDIR"):
        make_scratch()

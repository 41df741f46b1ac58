"""Compiled kernels on disk: found again by every process and installation, and never trusted when broken."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aobake import environment
from aobake.tracing import kept
from aobake.tracing.compiled import Kernel, kernel
from tests.support import ROOT, modules_after

KERNEL = r"""
import sys
from numba.core import event
import numpy as np
import toy
compiled = []
class Listener(event.Listener):
    def on_start(self, told): compiled.append(told)
    def on_end(self, told): pass
event.register("numba:compile", Listener())
assert toy.total(np.arange(4.0)) == 6.0
print(len(compiled))
"""
TOTAL = """
from aobake.tracing.compiled import inlined, kernel
@kernel
def total(values):
    result = 0.0
    for value in values:
        result += same(value)
    return result
@inlined
def same(value):
    return value
"""
ALONE = """
from aobake.tracing.compiled import compile_alone
compile_alone()
import numpy as np
import toy
print(toy.total(np.arange(4.0)))
import numba
try:
    print(numba.njit(lambda value: value + 1)(1))
except RuntimeError as error:
    print(error)
"""
BAKE = r"""
import sys
from numba.core import event
compiled = []
class Listener(event.Listener):
    def on_start(self, told): compiled.append(told)
    def on_end(self, told): pass
event.register("numba:compile", Listener())
import aobake
from aobake.tracing.kept import Kept
asked, code = [], Kept.code
Kept.code = lambda self, *given: (asked.append(self), code(self, *given))[1]
scene = aobake.Scene.from_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
aobake.bake_vertices(scene, aobake.BakeSettings(rays=4))
from aobake import ahead
needed = len(asked)
ahead.compile_origins()
print(len(compiled), needed, len(ahead.place_origins.kinds), aobake.__file__, sep="\n")
"""


def started(code: str, path: Path, cache: Path | None) -> subprocess.Popen[str]:
    """A Python that imports from `path` first, and keeps kernels in `cache`, or where it does without one."""
    environment = {**os.environ, "PYTHONPATH": f"{path}{os.pathsep}{ROOT}"}
    if cache is not None:
        environment[kept.FOLDER_VARIABLE] = str(cache)
    return subprocess.Popen(
        [sys.executable, "-c", code], cwd=path, env=environment, stdout=subprocess.PIPE, text=True
    )


def said(process: subprocess.Popen[str]) -> list[str]:
    """The lines that it prints."""
    out, _ = process.communicate(timeout=110)
    assert process.returncode == 0
    return out.splitlines()


def test_of_two_processes_one_compiles_and_a_new_release_that_was_moved_finds_its_code(
    tmp_path: Path,
) -> None:
    site, cache = tmp_path / "site", tmp_path / "kept"
    site.mkdir()
    (site / "toy.py").write_text(TOTAL, encoding="utf-8")
    both = [started(KERNEL, site, cache) for _ in range(2)]
    counts = sorted(int(said(process)[0]) for process in both)
    assert counts[0] == 0
    assert counts[1] > 0
    assert [path.suffix for path in cache.iterdir()] == [".kernel"]
    moved = site.rename(tmp_path / "elsewhere")
    (moved / "toy.py").write_text("# a new release\n" + TOTAL, encoding="utf-8")
    assert said(started(KERNEL, moved, cache)) == ["0"]


def test_a_process_that_compiles_kernels_alone_refuses_what_is_none_of_them(tmp_path: Path) -> None:
    (tmp_path / "toy.py").write_text(TOTAL, encoding="utf-8")
    assert said(started(ALONE, tmp_path, tmp_path / "kept")) == [
        "6.0",
        "numba serves kernels alone in this process, see compile_alone.",
    ]


def test_a_smallest_bake_needs_few_kernels_and_another_installation_compiles_none(
    tmp_path: Path,
) -> None:
    copy = tmp_path / "site" / "aobake"
    shutil.copytree(
        ROOT / "aobake", copy, copy_function=shutil.copy, ignore=lambda *_: {"__pycache__"}
    )
    said(started(BAKE, ROOT, None))  # which may be the first that ever ran here
    compiled, asked, kinds_of_origins, file = said(started(BAKE, copy.parent, None))
    assert Path(file).parent == copy
    assert compiled == "0"
    assert int(asked) <= 12
    assert kinds_of_origins == "1", "what is compiled ahead is what a bake asks for"


def test_a_bake_whose_kernels_are_kept_imports_no_numba() -> None:
    bake = [
        "import aobake",
        "scene = aobake.Scene.from_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])",
        "aobake.bake_vertices(scene, aobake.BakeSettings(rays=4))",
    ]
    modules_after(bake)  # which may be the first that ever ran here
    loaded = modules_after(bake)
    assert "llvmlite" in loaded
    assert "numba" not in loaded


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(kept.FOLDER_VARIABLE, str(tmp_path / "kept"))
    return tmp_path / "kept"


def fresh() -> Kernel[[object], int]:
    """A kernel that this process has not compiled."""

    def doubled(value):  # type: ignore[no-untyped-def]
        return 2 * value

    return kernel(doubled)


def test_a_folder_that_cannot_be_written_costs_a_line_and_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "a file"
    place.touch()
    monkeypatch.setenv(kept.FOLDER_VARIABLE, str(place))
    monkeypatch.setattr(kept, "_PROBLEMS", [])
    for _ in range(2):
        assert fresh()(4) == 8
    (line,) = environment.cache_warnings()
    assert str(place) in line
    assert kept.FOLDER_VARIABLE in line
    assert "\n" not in line


@pytest.mark.parametrize("content", [b"", b"not a kernel", None])
def test_a_file_that_cannot_be_read_is_made_again(cache: Path, content: bytes | None) -> None:
    first = fresh()
    assert first(21) == 42
    (file,) = cache.iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2] if content is None else content)
    again = fresh()
    assert again(21) == 42
    assert len(file.read_bytes()) == len(whole)
    assert [path.name for path in cache.iterdir()] == [file.name]


def test_a_kernel_is_known_once_it_is_kept(cache: Path) -> None:
    doubling = fresh()
    assert not doubling.is_kept()
    assert doubling(np.int64(1)) == 2
    assert doubling.is_kept()


def test_what_was_not_used_for_the_longest_time_makes_room(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache.mkdir()
    monkeypatch.setattr(kept, "MOST_BYTES", 250)
    for age, name in enumerate(["new.kernel", "used.kernel", "old.kernel"]):
        (cache / name).write_bytes(bytes(100))
        os.utime(cache / name, (0, 1e9 - age))
    (cache / "left.part").touch()
    os.utime(cache / "left.part", (0, 0))
    (cache / "somebody's.txt").write_bytes(bytes(1000))
    kept._make_room(cache)
    assert {path.name for path in cache.iterdir()} == {
        "new.kernel",
        "used.kernel",
        "somebody's.txt",
    }


@pytest.mark.parametrize(
    ("platform", "variable", "value", "expected"),
    [
        ("linux", "XDG_CACHE_HOME", "/caches", "/caches"),
        ("linux", "XDG_CACHE_HOME", "not absolute", "/users/me/.cache"),
        ("darwin", "XDG_CACHE_HOME", "/caches", "/users/me/Library/Caches"),
        ("win32", "LOCALAPPDATA", "/local", "/local"),
        ("win32", "LOCALAPPDATA", "", "/users/me/AppData/Local"),
    ],
)
def test_each_platform_has_its_folder_for_what_can_be_made_again(
    platform: str, variable: str, value: str, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(kept.FOLDER_VARIABLE, raising=False)
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(Path, "home", lambda: Path("/users/me"))
    monkeypatch.setenv(variable, value)
    assert kept.folder() == Path(expected) / "aobake" / "kernels"


def test_a_user_without_a_home_keeps_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv(kept.FOLDER_VARIABLE, raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    monkeypatch.setattr(kept, "_PROBLEMS", [])
    assert kept.folder() is None
    assert fresh()(3) == 6
    assert "no home" in str(kept.problem())

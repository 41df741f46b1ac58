"""Starting up: help is quick because nothing heavy is imported for it, and it tells the truth."""

from __future__ import annotations

import dataclasses
import importlib
import re
from pathlib import Path

import pytest

import aobake
from aobake.cli.app import COMMANDS
from aobake.settings import (
    AtlasSettings,
    ImageSettings,
    StoreSettings,
    TraceSettings,
    VertexSettings,
)
from aobake.tracing import kept
from tests.conftest import Run
from tests.support import modules_after, one_line, python

HEAVY = {"numpy", "numba", "trimesh", "scipy", "DracoPy", "embreex", "llvmlite"}


@pytest.mark.parametrize("arguments", [["--help"], ["vertex", "--help"], ["--version"], ["vertx"]])
def test_what_needs_no_bake_imports_nothing_heavy(arguments: list[str]) -> None:
    code = [
        "import contextlib, io, aobake.cli",
        "with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):",
        f"    aobake.cli.main({arguments!r})",
    ]
    loaded = modules_after(code)
    assert "cyclopts" in loaded
    assert not loaded & HEAVY


def test_a_command_is_imported_alone(run: Run) -> None:
    code = "import sys, aobake.cli; aobake.cli.main(['info', '--help']); print(*sys.modules)"
    done = python("-c", code)
    assert done.returncode == 0, done.stderr
    loaded = done.stdout.splitlines()[-1].split()
    assert "aobake.cli.info" in loaded
    assert not {f"aobake.cli.{name}" for name in COMMANDS if name != "info"} & set(loaded)


@pytest.mark.parametrize("name", COMMANDS)
def test_what_a_command_is_listed_as_is_how_its_own_help_begins(name: str) -> None:
    command = getattr(importlib.import_module(f"aobake.cli.{name}"), name)
    assert command.__doc__.splitlines()[0] == COMMANDS[name]


def test_every_command_is_in_the_help_with_what_it_does(run: Run) -> None:
    ran = run("--help")
    assert ran.status == 0
    assert ran.err == ""
    for command in COMMANDS:
        assert re.search(rf"\b{command}\s+[A-Z]\w+ ", ran.out), command


@pytest.mark.parametrize(
    ("command", "kind"),
    [
        ("vertex", TraceSettings),
        ("vertex", VertexSettings),
        ("vertex", StoreSettings),
        ("texture", TraceSettings),
        ("texture", AtlasSettings),
        ("texture", ImageSettings),
    ],
)
def test_the_help_shows_every_setting_with_its_default(
    run: Run, command: str, kind: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    text = run(command, "--help").out
    for field in dataclasses.fields(kind):
        line = next(
            part for part in text.split("\n") if f"--{field.name.replace('_', '-')} " in part
        )
        assert len(line.split()) > 4, "a flag explains itself"
        if field.default not in {None, ()}:
            several = field.default if isinstance(field.default, tuple) else (field.default,)
            assert f"[default: {' '.join(map(str, several))}]" in line
        assert "None" not in line


def test_help_fits_into_80_columns() -> None:
    done = python("-m", "aobake", "vertex", "--help")
    assert done.returncode == 0
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_the_version_is_that_of_the_package(run: Run) -> None:
    assert run("--version").out == f"{aobake.__version__}\n"


def test_a_cache_that_cannot_be_written_is_one_line_and_no_failure(
    run: Run, corner: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept, "_PROBLEMS", ["compiled code cannot be kept in here.", "nor there."])
    ran = run("vertex", corner, "-o", tmp_path / "out.obj", "--rays", 4)
    assert ran.status == 0
    assert one_line(ran.err, "warning: compiled code cannot be kept in here.")

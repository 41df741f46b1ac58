"""The hook for pre-commit and the GitHub Action: they can be read, and what they run does what they say."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from aobake.meshes.formats import READABLE
from tests.conftest import Run
from tests.scenes import CUBE_OBJ
from tests.support import ROOT

HOOKS, ACTION = ROOT / ".pre-commit-hooks.yaml", ROOT / "action.yml"
INPUT = re.compile(r"\$\{\{ *inputs\.(\w+) *\}\}")

pytestmark = pytest.mark.skipif(not ACTION.is_file(), reason="not a checkout")


def parsed(path: Path) -> Any:
    yaml = pytest.importorskip("yaml", reason="it comes with aobake[cluster]")
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def scripts() -> list[str]:
    """What the action runs in a shell."""
    return [step["run"] for step in parsed(ACTION)["runs"]["steps"] if "run" in step]


def test_the_hook_runs_a_batch_when_an_asset_or_its_settings_change(run: Run) -> None:
    (hook,) = parsed(HOOKS)
    program, *words = shlex.split(hook["entry"])
    assert (program, run(*words, "--help").status) == ("aobake", 0)
    assert (hook["language"], hook["pass_filenames"], hook["require_serial"]) == (
        "python",
        False,
        True,
    )
    for name in (*(f"props/a{ending}" for ending in READABLE), "A.GLB", "aobake.toml", "wood.png"):
        assert re.search(hook["files"], name), name
    assert not re.search(hook["files"], "readme.md")


def test_every_input_that_the_action_uses_is_declared_and_none_is_pasted_into_a_script() -> None:
    text, action = ACTION.read_text(encoding="utf-8"), parsed(ACTION)
    assert set(INPUT.findall(text)) == set(action["inputs"])
    assert not any("${{" in script for script in scripts())
    assert all(step.get("shell") == "bash" for step in action["runs"]["steps"] if "run" in step)


def test_options_in_the_action_exist(run: Run) -> None:
    (line,) = [
        line for script in scripts() for line in script.splitlines() if line.startswith("aobake")
    ]
    said = run("batch", "--help").out
    options = re.findall(r"(?<= )--?[a-z][a-z-]*", line)
    assert options == ["-o", "--junit"]
    assert all(option in said for option in options)


@pytest.mark.skipif(
    sys.platform == "win32" or shutil.which("bash") is None, reason="needs bash on a POSIX system"
)
def test_the_script_of_the_action_bakes_into_a_folder_that_is_not_there_yet(tmp_path: Path) -> None:
    program = tmp_path / "bin" / "aobake"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m aobake "$@"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    (tmp_path / "my assets").mkdir()
    (tmp_path / "my assets" / "crate.obj").write_text(CUBE_OBJ, encoding="ascii")
    environment = {
        **os.environ,
        "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": "",
        "FOLDER": "my assets",
        "OUTPUT": "baked $(touch pwned)",
        "ARGUMENTS": "--rays 4  --pictures none",
    }
    done = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", scripts()[-1]],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    out = tmp_path / environment["OUTPUT"]
    assert {"crate.obj", "report.json", "report.html", "junit.xml"} <= {
        path.name for path in out.iterdir()
    }
    assert not (tmp_path / "pwned").exists()

"""Wrong usage: one line on stderr that names the nearest known thing, status 2, and no file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import Run
from tests.support import one_line


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["vertx"], ["vertx", '"vertex"']),
        (["--quite"], ["--quite"]),
        (["vertex"], ["INPUT is missing", "aobake vertex --help"]),
        (["vertex", "a.obj"], ["--output is missing"]),
        (["vertex", "a.obj", "-o"], ["-o needs a value"]),
        (["vertex", "a.obj", "b.obj", "-o", "c.obj"], ["'b.obj' is one argument too many"]),
        (["vertex", "a.obj", "-o", "b.obj", "--rayz", "4"], ["--rayz", '"--rays"']),
        (["vertex", "a.obj", "-o", "b.obj", "--rayz=4"], ["--rayz.", '"--rays"']),
        (
            ["vertex", "a.obj", "-o", "b.obj", "--rays", "many"],
            ["--rays is 'many'", "whole number"],
        ),
        (["vertex", "a.obj", "-o", "b.obj", "--rays", "2.5"], ["--rays is '2.5'", "whole number"]),
        (["vertex", "a.obj", "-o", "b.obj", "--rays", "0"], ["--rays is 0"]),
        (
            ["vertex", "a.obj", "-o", "b.obj", "--tolerance", "x"],
            ["--tolerance is 'x'", "a number"],
        ),
        (["vertex", "a.obj", "-o", "b.obj", "--max-distance", "-1"], ["--max-distance is -1.0"]),
        (["vertex", "a.obj", "-o", "b.obj", "--falloff", "liner"], ["--falloff", '"linear"']),
        (
            ["vertex", "a.obj", "-o", "b.obj", "--falloff", "linear"],
            ["give --max-distance as well"],
        ),
        (["vertex", "a.obj", "-o", "b.obj", "--store", "colour"], ["--store", '"color"']),
        (["vertex", "a.obj", "-o", "b.obj", "--quiet=3"], ["--quiet is a switch"]),
        (["vertex", "a.obj", "-o", "b.obj", "--no-quiet"], ["--no-quiet", '"--quiet"']),
        (["vertex", "a.obj", "-o", "b.obj", "--rays=1", "--rays=2"], ["more than once"]),
        (["vertex", "a.obj", "-o", "b.stl"], ["b.stl", ".glb"]),
        (["vertex", "a.obj", "-o", "b"], ["b: a name without an ending"]),
    ],
)
def test_a_mistake_is_one_line_and_status_2(
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    parts: list[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = run(*arguments)
    assert ran.status == 2
    assert ran.out == ""
    assert one_line(ran.err, "aobake: error: ", *parts), ran.err
    assert list(tmp_path.iterdir()) == []


def test_a_setting_can_be_taken_back_to_none(run: Run, corner: Path, tmp_path: Path) -> None:
    (tmp_path / "aobake.toml").write_text("tolerance = 0.01\n", encoding="utf-8")
    ran = run("vertex", corner, "-o", tmp_path / "out.obj", "--rays", 8, "--tolerance", "none")
    assert ran.status == 0, ran.err

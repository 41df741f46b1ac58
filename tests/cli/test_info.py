"""`aobake info`: facts of an asset, or of aobake itself."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import aobake
from aobake.cli.info import bounds
from tests.conftest import Run
from tests.support import one_line


def test_without_an_asset_it_tells_versions_and_the_machine(run: Run) -> None:
    ran = run("info")
    assert ran.status == 0
    assert f"versions.aobake: {aobake.__version__}\n" in ran.out
    assert "versions.embree: 4." in ran.out
    assert "machine.processors: " in ran.out


def test_an_asset_is_counted_and_measured(run: Run, corner: Path) -> None:
    data = json.loads(run("info", corner, "--json").out)
    assert data["file"]["format"] == "OBJ"
    assert data["scene"]["triangles"] == 2 * 2 * 36
    assert data["scene"]["vertices"] == 98
    assert data["scene"]["highest corner"] == [1.0, 1.0, 1.0]
    assert data["problems"] == {}


def test_piped_it_is_one_fact_a_line(run: Run, corner: Path) -> None:
    out = run("info", corner).out
    assert "scene.triangles: 144\n" in out
    assert "scene.lowest corner: 0, 0, 0\n" in out


def test_a_long_list_is_cut_for_people_and_whole_in_json(run: Run, tmp_path: Path) -> None:
    mesh = aobake.Mesh(vertices=np.eye(3), faces=np.array([[0, 1, 2]], np.int32))
    scene = aobake.Scene.from_meshes([mesh] * 30)
    aobake.save(aobake.bake_vertices(scene, aobake.BakeSettings(rays=1)), tmp_path / "many.glb")
    assert "more" in run("info", tmp_path / "many.glb").out
    assert '"more"' not in run("info", tmp_path / "many.glb", "--json").out


def test_a_missing_asset_is_one_line(run: Run, tmp_path: Path) -> None:
    ran = run("info", tmp_path / "gone.glb")
    assert ran.status == 1
    assert one_line(ran.err, "gone.glb")


def test_bounds_are_those_of_what_is_finite_where_it_stands() -> None:
    mesh = aobake.Mesh(
        vertices=np.array([[0, 0, 0], [1, 2, 3], [np.nan, 9, 9]]), faces=np.zeros((0, 3), np.int32)
    )
    move = np.eye(4)
    move[:3, 3] = 10, 0, 0
    scene = aobake.Scene(
        meshes=(mesh,), instances=(aobake.Instance(mesh=0), aobake.Instance(mesh=0, transform=move))
    )
    assert bounds(scene) == ([0, 0, 0], [11, 2, 3])


@pytest.mark.parametrize("count", [0, 3])
def test_bounds_of_nothing_are_empty(count: int) -> None:
    nothing = aobake.Scene.from_arrays(np.full((count, 3), np.inf), np.zeros((0, 3), np.int32))
    assert bounds(nothing) == ([], [])

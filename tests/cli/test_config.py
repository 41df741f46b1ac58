"""aobake.toml: the nearest one counts, flags have the last word, mistakes are named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from aobake import SettingsError
from aobake.config import configured, rendering
from tests.conftest import Run
from tests.support import one_line


def write(folder: Path, text: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "aobake.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_defaults_then_the_file_then_flags(tmp_path: Path) -> None:
    file = write(tmp_path, 'rays = 64\nseed = 5\nstore = "attribute"\n')
    chosen = configured(tmp_path / "a.glb", {"rays": 16}, None)
    assert (chosen.bake.rays, chosen.bake.seed, chosen.bake.max_rays) == (16, 5, 4096)
    assert chosen.store.store == "attribute"
    assert chosen.files == (file,)


def test_every_file_above_contributes_and_the_nearest_has_the_last_word(tmp_path: Path) -> None:
    far = write(tmp_path, "rays = 64\nseed = 5\n")
    near = write(tmp_path / "props" / "chairs", "rays = 32\n")
    chosen = configured(tmp_path / "props" / "chairs" / "a.glb", {})
    assert (chosen.bake.rays, chosen.bake.seed) == (32, 5)
    assert chosen.files == (far, near)
    assert configured(tmp_path / "props" / "a.glb").files == (far,)


def test_a_file_can_be_the_topmost(tmp_path: Path) -> None:
    write(tmp_path, "rays = 64\nseed = 5\n")
    near = write(tmp_path / "props", "root = true\nrays = 32\n")
    chosen = configured(tmp_path / "props" / "chairs" / "a.glb", {})
    assert (chosen.bake.rays, chosen.bake.seed, chosen.files) == (32, 0, (near,))


def test_what_is_beside_the_way_to_the_asset_does_not_count(tmp_path: Path) -> None:
    write(tmp_path / "here", "rays = 64\n")
    (tmp_path / "there").mkdir()
    assert configured(tmp_path / "here" / ".." / "there" / "a.glb").bake.rays == 256


def test_a_relative_asset_is_looked_up_from_where_we_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, "rays = 7\n")
    monkeypatch.chdir(tmp_path)
    assert configured(Path("a.glb")).bake.rays == 7


def test_what_is_in_no_file_has_no_aobake_toml(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, "rays = 7\n")
    monkeypatch.chdir(tmp_path)
    assert configured(None).bake.rays == 256


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("ray = 64\n", ['"ray"', 'Did you mean "rays"']),
        ("rays = '64'\n", ["rays is '64'", "whole number"]),
        ("rays = 64.0\n", ["rays is 64.0"]),
        ("rays = true\n", ["rays is True"]),
        ("rays = 0\n", ["rays is 0"]),
        ("tolerance = '0.01'\n", ["tolerance is"]),
        ("falloff = 'liner'\n", ["falloff", '"linear"']),
        ("falloff = ['linear']\n", ["falloff"]),
        ("[bake]\nrays = 4\n", ['"bake"']),
        ("rays = \n", ["no TOML"]),
        ("render = 3\n", ["render is 3", "[render]"]),
        ("[render]\nmodle = 'phong'\n", ['"modle" in [render]', 'Did you mean "model"']),
    ],
)
def test_a_mistake_in_the_file_names_the_file(
    run: Run, corner: Path, tmp_path: Path, text: str, parts: list[str]
) -> None:
    write(tmp_path, text)
    ran = run("vertex", corner, "-o", tmp_path / "out.obj")
    assert ran.status == 2
    assert one_line(ran.err, "aobake.toml", *parts), ran.err
    assert not (tmp_path / "out.obj").exists()


def test_a_report_holds_all_that_it_takes_to_repeat_a_bake(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    file = write(tmp_path, "rays = 3\n")
    report = tmp_path / "r.json"
    arguments = ["-o", tmp_path / "out.obj", "--root", tmp_path, "--report", report]
    assert run("vertex", corner, *arguments).status == 0
    data = json.loads(report.read_text(encoding="utf-8"))
    assert data["schema"] == 2
    assert data["settings"]["rays"] == 3
    assert data["settings_files"] == [str(file)]
    assert data["reading"] == {"scene": None, "pose": None, "root": str(tmp_path)}


def test_pictures_have_a_table_of_their_own(tmp_path: Path) -> None:
    asset = tmp_path / "a.glb"
    write(tmp_path, 'size = 512\n[render]\nsize = "64x48"\nmodel = "phong"\n')
    assert configured(asset).bake.size == 512
    chosen = rendering(asset, {"model": "minnaert"})
    assert (chosen.size, chosen.model) == ("64x48", "minnaert")
    write(tmp_path, '[render]\nsize = "64"\n')
    with pytest.raises(SettingsError, match=r"aobake\.toml: size is '64'"):
        rendering(asset, {})


def test_a_mistake_in_a_flag_is_not_blamed_on_the_file(tmp_path: Path) -> None:
    write(tmp_path, 'falloff = "linear"\n')
    with pytest.raises(SettingsError) as caught:
        configured(tmp_path / "a.glb", {"rays": 0})
    assert str(caught.value).startswith("--rays is 0")


def test_a_setting_may_be_completed_by_a_flag(tmp_path: Path) -> None:
    write(tmp_path, 'falloff = "linear"\n')
    assert configured(tmp_path / "a.glb", {"max_distance": 2.0}).bake.falloff == "linear"
    with pytest.raises(SettingsError, match=r"aobake\.toml.*max_distance"):
        configured(tmp_path / "a.glb", {})


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "aobake.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SettingsError, match="no TOML"):
        configured(tmp_path / "a.glb")

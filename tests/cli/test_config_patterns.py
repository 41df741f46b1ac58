"""Presets and patterns in aobake.toml: which of them apply, in which order, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from aobake import SettingsError
from aobake.config import configured, rendering
from aobake.config_file import PICTURE, SETTINGS
from tests.cli.test_config import write
from tests.conftest import Run
from tests.support import one_line

STUDIO = """
rays = 100
seed = 1

[preset.hero]
rays = 1000
max_rays = 5000

[preset.far]
rays = 10
ground = "+y"

[files."props/**"]
rays = 200

[files."props/hero/*.glb"]
preset = "hero"
seed = 2

[files."*_lod2.glb"]
preset = "far"
"""


def rays(asset: Path, *, preset: str | None = None) -> int:
    return configured(asset, preset=preset).bake.rays


def test_a_pattern_is_stronger_than_what_holds_for_everything(tmp_path: Path) -> None:
    write(tmp_path, STUDIO)
    assert rays(tmp_path / "a.glb") == 100
    assert rays(tmp_path / "props" / "a.glb") == 200


def test_a_preset_stands_where_a_pattern_names_it(tmp_path: Path) -> None:
    write(tmp_path, STUDIO)
    chosen = configured(tmp_path / "props" / "hero" / "a.glb").bake
    assert (chosen.rays, chosen.max_rays, chosen.seed) == (1000, 5000, 2)


def test_of_two_presets_that_are_named_the_last_one_applies_alone(tmp_path: Path) -> None:
    write(tmp_path, STUDIO)
    chosen = configured(tmp_path / "props" / "hero" / "a_lod2.glb").bake
    assert (chosen.rays, chosen.ground, chosen.max_rays, chosen.seed) == (10, "+y", 4096, 2)


def test_a_preset_from_a_flag_applies_where_no_pattern_names_another(tmp_path: Path) -> None:
    write(tmp_path, STUDIO)
    assert rays(tmp_path / "a.glb", preset="far") == 10
    assert rays(tmp_path / "props" / "a.glb", preset="far") == 200  # a pattern is more particular
    hero = configured(tmp_path / "props" / "hero" / "a.glb", preset="far").bake
    assert (hero.rays, hero.ground) == (1000, None)


def test_a_nearer_file_is_stronger_than_a_pattern_farther_away(tmp_path: Path) -> None:
    write(tmp_path, STUDIO)
    write(tmp_path / "props", "rays = 300\n")
    assert rays(tmp_path / "props" / "a.glb") == 300


def test_a_nearer_file_names_and_refines_presets_of_one_farther_away(tmp_path: Path) -> None:
    write(tmp_path, STUDIO)
    write(
        tmp_path / "sets",
        'rays = 3\n[preset.hero]\nmax_rays = 6000\n[files."big*"]\npreset = "hero"\n',
    )
    chosen = configured(tmp_path / "sets" / "big.glb").bake
    assert (chosen.rays, chosen.max_rays) == (1000, 6000)
    assert rays(tmp_path / "sets" / "small.glb") == 3


def test_patterns_are_relative_to_the_folder_of_their_file(tmp_path: Path) -> None:
    write(tmp_path / "props", '[files."hero/*.glb"]\nrays = 7\n')
    assert rays(tmp_path / "props" / "hero" / "a.glb") == 7
    assert rays(tmp_path / "props" / "x" / "hero" / "a.glb") == 256


def test_a_preset_is_chosen_by_a_flag_of_the_commands(
    run: Run, corner: Path, tmp_path: Path
) -> None:
    write(tmp_path, "[preset.quick]\nrays = 3\nseed = 9\n")
    report = tmp_path / "r.json"
    arguments = ["vertex", corner, "-o", tmp_path / "o.obj", "--report", report]
    assert run(*arguments, "--preset", "quick").status == 0
    assert '"rays": 3,' in report.read_text(encoding="utf-8")
    ran = run(*arguments, "--preset", "quik", "--force")
    assert ran.status == 2
    assert one_line(ran.err, "--preset is 'quik'", 'Did you mean "quick"')


def test_without_config_no_file_counts(run: Run, corner: Path, tmp_path: Path) -> None:
    write(tmp_path, "this is no TOML")
    ran = run("vertex", corner, "-o", tmp_path / "o.obj", "--rays", 3, "--no-config")
    assert ran.status == 0, ran.err


def test_a_preset_needs_a_file_that_has_one(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"--preset is 'hero'.*\[preset\.NAME\]"):
        configured(tmp_path / "a.glb", preset="hero")


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("preset = 'hero'\n", ["preset is 'hero'", "[preset]"]),
        ("[preset]\nhero = 3\n", ["[preset.hero]"]),
        ("[preset.hero]\nray = 3\n", ['"ray" in [preset.hero]', 'Did you mean "rays"']),
        ("[preset.hero]\nskip = true\n", ['"skip" in [preset.hero]']),
        ("[files]\n'*.glb' = 3\n", ['files."*.glb" is 3']),
        ("[files.'*.glb']\nray = 3\n", ['"ray" in [files."*.glb"]', 'Did you mean "rays"']),
        ("[files.'*.glb']\noutput = 'x'\n", ['"output"']),
        ("[files.'../*.glb']\nrays = 3\n", ["'../*.glb' leaves its folder"]),
        ("[files.'*.{glb,obj}']\nrays = 3\n", ["brace"]),
        ("[files.'*']\nbake = 'vertx'\n", ["bake is 'vertx'", 'Did you mean "vertex"']),
        ("[files.'*']\nbake = []\n", ["bake is []"]),
        ("[files.'*']\nskip = 1\n", ["skip is 1", "true or false"]),
        ("[files.'*']\nformat = '../a'\n", ["format is '../a'", "glb"]),
        ("[files.'*']\npreset = 3\n", ["preset is 3"]),
        ("[files.'*']\npreset = 'hero'\n", ["preset", "'hero'", "[preset.NAME]"]),
        ("[preset.hero]\n[files.'*']\npreset = 'hro'\n", ["'hro'", 'Did you mean "hero"']),
        ("root = 1\n", ["root is 1", "true or false"]),
        ("[files.'*']\nrays = 0\n", ["rays is 0"]),
        ("rays = " + "[\n" * 5000 + "]\n" * 5000, ["too deep"]),
        ("rays = [" + "1,\n" * 5000 + "]\n", ["rays is [1, 1", "..."]),
        ("# a comment\n" * 9000, ["64 KiB"]),
        (f"seed = 3\n{'a.' * 30000}a = 3\n", ["line 2", "1000 bytes"]),
        (f"{'x' * 900} = 3\n", ["no setting"]),
    ],
)
def test_a_mistake_names_the_file_and_the_table(
    tmp_path: Path, text: str, parts: list[str]
) -> None:
    write(tmp_path, text)
    with pytest.raises(SettingsError) as caught:
        configured(tmp_path / "a.glb")
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'aobake.toml'}: ")
    assert all(part in message for part in parts), message
    assert len(message) < 1000


def test_of_several_files_the_one_with_the_mistake_is_named(tmp_path: Path) -> None:
    far = write(tmp_path, "rays = 0\n")
    write(tmp_path / "props", "seed = 3\n")
    with pytest.raises(SettingsError) as caught:
        configured(tmp_path / "props" / "a.glb")
    assert str(caught.value).startswith(f"{far}: rays is 0")


ODD = (
    "1", "-1", "1.5", "inf", "nan", "9" * 40, "true", "[]", "['']", "[1]", "[[1]]", "{a = 1}", "''", "'x'", "'%'",
    "'rms:'", "1979-05-27", "07:32:00", '"\\u0000"', '"\u0662"',
)  # fmt: skip


@pytest.mark.parametrize("value", ODD)
def test_a_value_of_any_kind_is_taken_or_refused_in_one_line(tmp_path: Path, value: str) -> None:
    for key in sorted(SETTINGS | PICTURE):
        asset = tmp_path / "a.glb"
        known = {"": SETTINGS, "[render]\n": PICTURE}
        for table in (table for table, keys in known.items() if key in keys):
            write(tmp_path, f"{table}{key} = {value}\n")
            try:
                configured(asset)
                rendering(asset, {})
            except SettingsError as error:
                line = str(error)
                assert line.startswith(f"{tmp_path / 'aobake.toml'}: "), line
                assert len(line.splitlines()) == 1

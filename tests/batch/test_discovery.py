"""What a batch bakes: which assets, with which settings, into which files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from aobake import SettingsError
from aobake.batch.discovery import plan_batch
from aobake.batch.places import Found, Place, Stamp, local_folder
from aobake.batch.settings import BatchSettings
from aobake.batch.tasks import Planned
from aobake.config import Configured, configured


def assets(folder: Path, *names: str) -> None:
    for name in names:
        path = folder / "in" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"an asset")


def toml(folder: Path, text: str, under: str = "") -> Path:
    path = folder / "in" / under / "aobake.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def planned(
    folder: Path,
    settings: BatchSettings | None = None,
    flags: Mapping[str, object] | None = None,
) -> list[Planned]:
    source, target = local_folder(folder / "in"), local_folder(folder / "out")
    return plan_batch(source, target, settings or BatchSettings(), flags)


def targets(folder: Path, settings: BatchSettings | None = None) -> dict[str, str]:
    """Output -> command, of all that can be baked."""
    return {one.target: one.job.command for one in planned(folder, settings) if not one.refused}


def test_assets_are_found_in_order_and_the_tree_is_mirrored(tmp_path: Path) -> None:
    assets(tmp_path, "b/c.OBJ", "a.glb", "b/readme.md", "b/c/d.ply", "x.zip", "y.fbx")
    found = planned(tmp_path)
    assert [(one.source, one.target) for one in found] == [
        ("a.glb", "a.glb"),
        ("b/c.OBJ", "b/c.OBJ"),
        ("b/c/d.ply", "b/c/d.ply"),
    ]
    first = found[0].job
    assert (first.input, first.output) == (tmp_path / "in" / "a.glb", tmp_path / "out" / "a.glb")
    assert (found[0].size, first.command, first.chosen.bake.rays) == (8, "vertex", 256)


def test_a_folder_without_assets_is_an_empty_batch(tmp_path: Path) -> None:
    assets(tmp_path, "readme.md")
    assert planned(tmp_path) == []


def test_what_begins_with_a_dot_is_no_asset(tmp_path: Path) -> None:
    assets(tmp_path, ".git/a.glb", "x/.aobake/b.glb", "._c.glb", "x/d.glb")
    assert list(targets(tmp_path)) == ["x/d.glb"]


def test_assets_are_included_and_excluded_by_pattern(tmp_path: Path) -> None:
    assets(tmp_path, "a.glb", "props/b.glb", "props/b_old.glb", "props/old/c.glb", "props/d.obj")
    chosen = BatchSettings(only=("props/**/*.glb", "a.*"), skip=("*_old.*", "old/"))
    assert list(targets(tmp_path, chosen)) == ["a.glb", "props/b.glb"]


@pytest.mark.parametrize(
    ("name", "vertex", "texture"),
    [
        ("a.glb", "a.glb", "a.glb"),
        ("a.GLTF", "a.GLTF", "a.GLTF"),
        ("a.ply", "a.ply", "a.glb"),
        ("a.usda", "a.usda", "a.glb"),
        ("a.usdz", "a.glb", "a.glb"),
        ("a.stl", "a.glb", "a.glb"),
        ("a.b.3mf", "a.b.glb", "a.b.glb"),
    ],
)
def test_an_output_keeps_the_ending_where_it_can_hold_the_result(
    tmp_path: Path, name: str, vertex: str, texture: str
) -> None:
    assets(tmp_path, name)
    assert targets(tmp_path) == {vertex: "vertex"}
    assert targets(tmp_path, BatchSettings(bake=("texture",))) == {texture: "texture"}


def test_a_format_that_is_asked_for_is_taken(tmp_path: Path) -> None:
    assets(tmp_path, "a.obj", "b.PLY")
    assert list(targets(tmp_path, BatchSettings(format=".ply"))) == ["a.ply", "b.PLY"]
    images = BatchSettings(format="png", bake=("texture",))
    assert list(targets(tmp_path, images)) == ["a.png", "b.png"]


def test_both_commands_give_two_outputs(tmp_path: Path) -> None:
    assets(tmp_path, "props/a.ply")
    assert targets(tmp_path, BatchSettings(bake=("texture", "vertex"))) == {
        "props/a_vertex.ply": "vertex",
        "props/a_texture.glb": "texture",
    }


def test_a_file_of_settings_says_what_becomes_of_which_asset(tmp_path: Path) -> None:
    assets(tmp_path, "a.obj", "b_lod2.glb", "walls/c.glb", "props/d.glb")
    toml(
        tmp_path,
        '[files."*_lod2.*"]\nskip = true\n'
        '[files."walls/*"]\nbake = ["vertex", "texture"]\nrays = 32\n'
        '[files."*.obj"]\nformat = "glb"\n',
    )
    toml(tmp_path, '[files."d.glb"]\nbake = "texture"\n', under="props")
    assert targets(tmp_path) == {
        "a.glb": "vertex",
        "props/d.glb": "texture",
        "walls/c_vertex.glb": "vertex",
        "walls/c_texture.glb": "texture",
    }
    chosen = BatchSettings(bake=("texture",), format="gltf")
    assert targets(tmp_path, chosen) == {
        "a.glb": "texture",
        "props/d.gltf": "texture",
        "walls/c_vertex.gltf": "vertex",
        "walls/c_texture.gltf": "texture",
    }


def test_files_above_the_folder_count_as_well(tmp_path: Path) -> None:
    assets(tmp_path, "a.glb")
    (tmp_path / "aobake.toml").write_text("rays = 3\n", encoding="utf-8")
    assert planned(tmp_path)[0].job.chosen.files == (tmp_path / "aobake.toml",)


TABLES = st.sampled_from(
    [
        "rays = 3\n",
        "root = true\nseed = 4\n",
        '[preset.hero]\nrays = 5\nground = "+y"\n',
        '[files."*.glb"]\nseed = 6\n',
        '[preset.hero]\nseed = 7\n[files."a*"]\npreset = "hero"\nmax_rays = 99\n',
        '[preset.far]\nrays = 8\n[files."x/**"]\npreset = "far"\n[files."**/b.*"]\nsize = 9\n',
    ]
)


def outcome(act: Callable[[], list[Configured]]) -> list[Configured] | str:
    """What comes of it, or why nothing does."""
    try:
        return act()
    except SettingsError as error:
        return str(error)


@hypothesis_settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    files=st.dictionaries(st.sampled_from(["", "x", "x/y"]), TABLES),
    preset=st.sampled_from([None, "hero", "far"]),
    flags=st.sampled_from([{}, {"rays": 11}]),
)
def test_an_asset_is_baked_as_it_would_be_alone(
    tmp_path: Path, files: Mapping[str, str], preset: str | None, flags: Mapping[str, object]
) -> None:
    for under in ("", "x", "x/y"):
        toml(tmp_path, files.get(under, ""), under)
    assets(tmp_path, "a.glb", "x/a.glb", "x/b.obj", "x/y/a.glb", "x/y/b.glb")
    names = ["a.glb", "x/a.glb", "x/b.obj", "x/y/a.glb", "x/y/b.glb"]

    def alone() -> list[Configured]:
        return [configured(tmp_path / "in" / name, flags, preset=preset) for name in names]

    def together() -> list[Configured]:
        found = planned(tmp_path, BatchSettings(preset=preset), flags)
        return [one.job.chosen for one in found]

    assert outcome(together) == outcome(alone)


@dataclass(frozen=True)
class Elsewhere:
    """A place that is not on this machine: names and contents.

    What raises NotImplementedError costs a store a request for each file: a plan must not come to ask for it.
    """

    name: str
    contents: Mapping[str, str]
    lists_all: bool = True

    def files(self, enters: Callable[[str], bool]) -> Iterator[Found]:
        for name in sorted(self.contents):
            folders = name.split("/")[:-1]
            if all(enters("/".join(folders[: n + 1])) for n in range(len(folders))):
                yield Found(name=name, stamp=Stamp(len(self.contents[name]), ""))

    def stamp(self, name: str) -> Stamp | None:
        raise NotImplementedError(name)

    def read(self, name: str, most: int) -> bytes:
        return self.contents[name].encode()[:most]

    def digest(self, name: str) -> str:
        raise NotImplementedError(name)

    def path(self, name: str) -> Path:
        return Path(name)

    def copy(self, name: str, to: str) -> None:
        raise NotImplementedError(name, to)

    def remove(self, name: str) -> None:
        raise NotImplementedError(name)


def test_files_of_settings_are_read_where_the_assets_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "aobake.toml").write_text("rays = 3\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)  # where nothing is looked for
    contents = {
        "a.glb": "",
        "aobake.toml": 'seed = 4\n[files."props/b.*"]\nsize = 64\n',
        "props/aobake.toml": '[files."b.*"]\npadding = 1\n[files."c.*"]\nskip = true\n',
        "props/b.glb": "",
        "props/c.glb": "",
        "worse/aobake.toml": "x" * 100_000,
        "worse/d.glb": "",
    }
    source: Place = Elsewhere("memory://assets", contents)
    found = plan_batch(source, Elsewhere("memory://baked", {}), BatchSettings())
    chosen = {one.source: one.job.chosen for one in found if not one.refused}
    assert list(chosen) == ["a.glb", "props/b.glb"]
    assert (chosen["a.glb"].bake.rays, chosen["a.glb"].bake.seed) == (256, 4)
    props = chosen["props/b.glb"]
    assert (props.bake.seed, props.bake.size, props.bake.padding) == (4, 64, 1)
    assert props.files == (Path("aobake.toml"), Path("props/aobake.toml"))
    assert [one.refused.partition(":")[0] for one in found if one.refused] == ["worse/aobake.toml"]
    with pytest.raises(SettingsError, match="would be baked again"):
        plan_batch(source, Elsewhere("memory://assets/out/", {}), BatchSettings())

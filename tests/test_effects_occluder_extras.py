"""Who occludes, by what applications have noted in glTF extras: bake groups."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from aobake import (
    BakeSettings,
    Instance,
    Material,
    Scene,
    SettingsError,
    bake_vertices,
    load,
    save,
)
from aobake.occluders import occluding
from tests.conftest import Run
from tests.scenes import floor, mesh_of
from tests.support import one_line

NODES = [
    {"bake_group": "left", "lod": 0, "hidden": False},
    {"bake_group": "right", "lod": 1.0, "hidden": True},
    {"bake_group": ["left", "right"]},
    {},
]


@pytest.fixture
def asset(tmp_path: Path) -> Path:
    """Four sheets over each other, with extras at nodes, a mesh and a material."""
    sheets = [floor(1.0, 0.25 * number, 2) for number in range(4)]
    names = ["a", "b", "c", "extras:odd"]
    meshes = tuple(
        mesh_of(sheet, name=name, material=number % 2)
        for number, (sheet, name) in enumerate(zip(sheets, names, strict=True))
    )
    scene = Scene(
        meshes=meshes,
        instances=tuple(Instance(mesh=number, name=name) for number, name in enumerate(names)),
        materials=(Material(name="stone:wet"), Material(name="leaf")),
    )
    path = tmp_path / "sheets.gltf"
    save(bake_vertices(scene, BakeSettings(rays=1)), path)
    document = json.loads(path.read_text())
    for node, extras in zip(document["nodes"], NODES, strict=True):
        node["extras"] = extras
    document["meshes"][3]["extras"] = {"proxy": True}
    document["meshes"][3]["primitives"][0]["extras"] = "no object, which glTF allows"
    document["materials"][1]["extras"] = {"kind": "card", "weights": {"no": "value"}}
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize(
    ("word", "which"),
    [
        ("extras:bake_group", "012"),
        ("extras:bake_group=left", "02"),
        ("extras:bake_group=*", "012"),
        ("extras:bake_gr*=right", "12"),
        ("extras:lod", "01"),
        ("extras:lod=1", "1"),
        ("extras:hidden", "1"),
        ("extras:hidden=false", "0"),
        ("extras:proxy", "3"),
        ("extras:kind=card", "13"),
        ("extras:weights", "13"),
        ("extras:odd", "3"),
        ("stone:wet", "02"),
    ],
)
def test_an_extra_is_one_of_the_node_the_mesh_or_the_material(
    asset: Path, word: str, which: str
) -> None:
    """A switch that is off is none; a list holds several values; names with colons stay names."""
    scene = load(asset)
    found = occluding(scene, BakeSettings(occluders=(word,)))
    assert "".join(map(str, np.flatnonzero(found))) == which
    assert np.array_equal(occluding(scene, BakeSettings(exclude=(word,))), ~found)


def test_words_of_both_kinds_go_together(asset: Path) -> None:
    chosen = BakeSettings(occluders=("a", "extras:proxy"), exclude=("extras:lod=0",))
    assert occluding(load(asset), chosen).tolist() == [False, False, False, True]


def test_what_occludes_by_an_extra_is_what_occludes_by_its_names(asset: Path) -> None:
    scene = load(asset)
    by_extra = bake_vertices(scene, BakeSettings(rays=64, occluders=("extras:bake_group=left",)))
    by_name = bake_vertices(scene, BakeSettings(rays=64, occluders=("a", "c")))
    assert all(map(np.array_equal, by_extra.ao, by_name.ao))
    assert by_extra.ao[0].mean() < 0.9


@pytest.mark.parametrize(
    ("word", "cure"),
    [
        ("extras:bakegroup", 'Did you mean "extras:bake_group"?'),
        ("extras:bake_group=lft", 'Did you mean "extras:bake_group=left"?'),
        ("extras:", 'Did you mean "extras:lod"?'),
    ],
)
def test_an_unknown_extra_is_refused_with_the_nearest_one(
    asset: Path, run: Run, word: str, cure: str
) -> None:
    ran = run("vertex", asset, "-o", asset.with_name("out.glb"), "--occluders", word)
    assert ran.status == 2
    assert one_line(ran.err, f"occluders is '{word}'", "has this extra", cure), ran.err


def test_an_asset_without_extras_says_so() -> None:
    sheet = Scene.from_arrays(*floor(1.0), name="sheet")
    with pytest.raises(SettingsError, match="no node, mesh or material has extras"):
        occluding(sheet, BakeSettings(exclude=("extras:bake_group",)))

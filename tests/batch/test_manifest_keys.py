"""What the bytes of an output depend on: held against the writers themselves."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from aobake.batch.keys import difference, fingerprint, follows_content, recipe
from aobake.config import Configured
from aobake.jobs import Command, Job, Reading
from aobake.meshes.formats import load, write_texture_ao, write_vertex_ao
from aobake.meshes.scene import Scene
from aobake.settings import BakeSettings, ImageSettings, StoreSettings
from tests.meshes.formats.lightmaps import explode_all
from tests.scenes import box

OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def job(asset: str, output: str, command: Command = "vertex", **bake: object) -> Job:
    settings = BakeSettings(**bake)  # type: ignore[arg-type]
    chosen = Configured(bake=settings, store=StoreSettings(), image=ImageSettings())
    return Job(command=command, input=Path(asset), output=Path(output), chosen=chosen)


def asset(folder: Path, ending: str) -> bytes:
    """A box, or a triangle, as it is written where it has no name of its own."""
    if ending == ".obj":
        return OBJ
    scene = Scene.from_arrays(*box())
    path = folder / f"made{ending}"
    write_vertex_ao(scene, [np.ones(8, np.float32)], path, StoreSettings())
    return path.read_bytes()


def outputs(folder: Path, content: bytes, ending: str, output: str, command: Command) -> set[bytes]:
    """The outputs of assets with the same content and other names, in folders of their own."""
    found = set()
    for name in ("chair", "table"):
        home = folder / name
        home.mkdir()
        path, target = home / f"{name}{ending}", home / f"{name}_out{output}"
        path.write_bytes(content)
        scene = load(path)
        if command == "vertex":
            values = [np.full(len(mesh.vertices), 0.5, np.float32) for _, mesh in scene.placed()]
            written = write_vertex_ao(scene, values, target, StoreSettings())
        else:
            written = write_texture_ao(scene, explode_all(scene), target, ImageSettings())
        assert written[0] == target
        found.update({target.read_bytes()} if len(written) == 1 else {b"a", b"b"})
    return found


@pytest.mark.parametrize("command", ["vertex", "texture"])
@pytest.mark.parametrize(
    ("ending", "output"),
    [(".glb", ".glb"), (".ply", ".ply"), (".ply", ".glb"), (".obj", ".glb"), (".obj", ".obj")],
)
def test_an_output_follows_the_content_alone_where_that_is_claimed(
    tmp_path: Path, command: Command, ending: str, output: str
) -> None:
    if command == "texture" and output == ".ply":
        pytest.skip("PLY holds no lightmap")
    found = outputs(tmp_path, asset(tmp_path, ending), ending, output, command)
    if follows_content(job(f"a{ending}", f"b{output}", command)):
        assert len(found) == 1


def test_a_glb_of_an_obj_tells_the_name_of_the_file(tmp_path: Path) -> None:
    """The reason for the claim to be narrow."""
    assert len(outputs(tmp_path, OBJ, ".obj", ".glb", "vertex")) == 2
    assert not follows_content(job("a.obj", "a.glb"))
    assert follows_content(job("a.glb", "a.GLB"))


VERTEX = {"method": "lsq"}
TEXTURE = {"size": 64, "padding": 3, "uv": "unwrap", "supersample": 2, "normal_map": True}
BOTH = {"rays": 9, "seed": 3, "spread": 90.0, "exclude": ("x",), "strict": True, "ground": "+y"}
NEITHER = {"threads": 3}


@pytest.mark.parametrize("command", ["vertex", "texture"])
@pytest.mark.parametrize(("name", "value"), [*(VERTEX | TEXTURE | BOTH | NEITHER).items()])
def test_a_recipe_changes_with_the_settings_that_matter_and_no_others(
    command: Command, name: str, value: object
) -> None:
    matters = name in BOTH or name in (VERTEX if command == "vertex" else TEXTURE)
    before, now = (
        recipe(job("a.glb", "b.glb", command)),
        recipe(job("a.glb", "b.glb", command, **{name: value})),
    )
    assert (fingerprint(before) != fingerprint(now)) == matters
    assert difference(before, now).startswith(f"{name} ") == matters


def test_every_setting_of_a_bake_matters_to_one_command_or_is_named_as_idle() -> None:
    seen = set()
    for command in ("vertex", "texture"):
        seen |= json.loads(recipe(job("a.glb", "b.glb", command)))["settings"].keys()
    known = {
        field.name
        for part in (BakeSettings, StoreSettings, ImageSettings)
        for field in dataclasses.fields(part)
    }
    assert known - seen == {"threads", "quality"}


def test_a_quality_is_the_tolerance_that_it_stands_for() -> None:
    assert recipe(job("a.glb", "b.glb", quality="draft")) == recipe(
        job("a.glb", "b.glb", tolerance=0.02)
    )


def test_ending_and_command_and_reading_count() -> None:
    one = job("in/a.glb", "b.glb")
    others = [
        job("in/a.glb", "b.ply"),
        job("in/a.glb", "b.glb", "texture"),
        dataclasses.replace(one, reading=Reading(scene="2")),
        dataclasses.replace(one, reading=Reading(pose="walk@1")),
        dataclasses.replace(one, reading=Reading(root=Path("in"))),
    ]
    assert len({recipe(one), *map(recipe, others)}) == 6
    assert recipe(one) == recipe(job("in/a.glb", "c.GLB"))


def test_a_tree_that_moved_with_its_root_has_the_same_recipes() -> None:
    texts = {
        recipe(dataclasses.replace(job(f"{top}/a/b.glb", "c.glb"), reading=Reading(root=Path(top))))
        for top in ("here", "there/in")
    }
    assert len(texts) == 1

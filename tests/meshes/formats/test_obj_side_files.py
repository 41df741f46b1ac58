"""Material libraries and textures go along with an OBJ file, and never beyond its folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aobake.errors import OutputError
from aobake.meshes.formats import load, write_vertex_ao
from aobake.meshes.scene import Scene
from aobake.settings import StoreSettings

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
LIBRARY = """newmtl a
 map_Kd -s 2 2 -clamp on  wood grain.png
map_Ks -mm 0 1 -bm 0.5 sub/gloss.png
bump sub\\bump.png
norm missing.png
Kd 1 1 1
"""


def asset(tmp_path: Path, *libraries: str, texts: dict[str, str] | None = None) -> Path:
    """An OBJ file in a folder of its own, with these mtllib lines and files."""
    folder = tmp_path / "in"
    for name, text in {
        "a.mtl": LIBRARY,
        "wood grain.png": "W",
        "sub/gloss.png": "G",
        "sub/bump.png": "B",
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    for name, text in (texts or {}).items():
        (folder / name).write_text(text)
    lines = "".join(f"mtllib {library}\n" for library in libraries)
    (folder / "asset.obj").write_text(lines + TRIANGLE)
    return folder / "asset.obj"


def names(scene: Scene, folder: Path) -> list[str]:
    """The files of a scene, relative to a folder."""
    assert scene.source is not None
    return [file.resolve().relative_to(folder.resolve()).as_posix() for file in scene.source.files]


def write(scene: Scene, target: Path) -> tuple[Path, ...]:
    """Write the scene with all vertices open."""
    target.parent.mkdir(exist_ok=True)
    return write_vertex_ao(scene, [np.ones(3, np.float32)], target, StoreSettings())


def test_libraries_and_their_textures_belong_to_the_asset_and_are_copied(tmp_path: Path) -> None:
    path = asset(tmp_path, "a.mtl")
    scene = load(path)
    expected = ["asset.obj", "a.mtl", "wood grain.png", "sub/gloss.png", "sub/bump.png"]
    assert names(scene, path.parent) == expected
    assert not scene.warnings
    written = write(scene, tmp_path / "out" / "asset.obj")
    assert [file.relative_to(tmp_path / "out").as_posix() for file in written] == expected
    for name in expected[1:]:
        assert (tmp_path / "out" / name).read_bytes() == (path.parent / name).read_bytes()


def test_nothing_is_copied_within_the_same_folder(tmp_path: Path) -> None:
    path = asset(tmp_path, "a.mtl")
    assert write(load(path), path.parent / "baked.obj") == (path.parent / "baked.obj",)


def test_a_library_name_may_have_spaces_or_be_several_names(tmp_path: Path) -> None:
    texts = {"my lib.mtl": "map_Kd my lib.mtl\n", "b.mtl": "# none\n"}
    scene = load(asset(tmp_path, "my lib.mtl", "a.mtl b.mtl gone.mtl", texts=texts))
    assert names(scene, tmp_path / "in")[:2] == ["asset.obj", "my lib.mtl"]
    assert names(scene, tmp_path / "in")[2:] == [
        "a.mtl",
        "wood grain.png",
        "sub/gloss.png",
        "sub/bump.png",
        "b.mtl",
    ]


@pytest.mark.parametrize("way", ["../out.mtl", "sub/../../out.mtl", "ABSOLUTE", "link.mtl"])
def test_a_library_outside_of_the_folder_is_left_alone(tmp_path: Path, way: str) -> None:
    (tmp_path / "out.mtl").write_text("newmtl a\n")
    library = str(tmp_path / "out.mtl") if way == "ABSOLUTE" else way
    path = asset(tmp_path, library)
    (path.parent / "link.mtl").symlink_to(tmp_path / "out.mtl")
    scene = load(path)
    assert names(scene, path.parent) == ["asset.obj"]
    assert "outside of the folder" in scene.warnings[0]
    assert "--root" in scene.warnings[0]
    write(scene, tmp_path / "other" / "asset.obj")
    assert [file.name for file in (tmp_path / "other").iterdir()] == ["asset.obj"]


def test_a_root_widens_what_belongs_to_the_asset_but_not_where_it_is_written(
    tmp_path: Path,
) -> None:
    (tmp_path / "up.mtl").write_text("newmtl a\n")
    scene = load(asset(tmp_path, "../up.mtl"), root=tmp_path)
    assert names(scene, tmp_path) == ["in/asset.obj", "up.mtl"]
    written = write(scene, tmp_path / "deep" / "asset.obj")
    assert written == (tmp_path / "deep" / "asset.obj",)


def test_another_file_of_the_same_name_is_not_replaced(tmp_path: Path) -> None:
    scene = load(asset(tmp_path, "a.mtl"))
    target = tmp_path / "out" / "asset.obj"
    target.parent.mkdir()
    (tmp_path / "out" / "a.mtl").write_text("of somebody else")
    with pytest.raises(OutputError, match=r"a\.mtl: another file of this name"):
        write(scene, target)
    assert [file.name for file in target.parent.iterdir()] == ["a.mtl"]
    (tmp_path / "out" / "a.mtl").write_text(LIBRARY)
    assert (tmp_path / "out" / "a.mtl") not in write(scene, target)


@pytest.mark.parametrize("library", ["\0", "x" * 5000, "sub", ".", "/dev/null", "\ud800"])
def test_a_library_that_is_no_file_is_passed_over(tmp_path: Path, library: str) -> None:
    path = asset(tmp_path)
    text = f"mtllib {library}\n{TRIANGLE}".encode("utf-8", "surrogatepass")
    path.write_bytes(text.replace(b"\0", b"\x01"))
    assert names(load(path), path.parent) == ["asset.obj"]


def test_a_copy_of_an_earlier_bake_is_replaced_when_its_original_changed(tmp_path: Path) -> None:
    path, target = asset(tmp_path, "a.mtl"), tmp_path / "out" / "asset.obj"
    write(load(path), target)
    (path.parent / "a.mtl").write_text("newmtl a\nmap_Kd wood grain.png\nmap_Ks sub/gloss.png\n")
    (path.parent / "sub" / "gloss.png").write_text("H")
    written = write(load(path), target)
    assert [file.name for file in written] == ["asset.obj", "a.mtl", "gloss.png"]
    for name in ("a.mtl", "sub/gloss.png"):
        assert (target.parent / name).read_bytes() == (path.parent / name).read_bytes()


def test_what_the_earlier_bake_does_not_name_is_not_its_copy(tmp_path: Path) -> None:
    path, target = asset(tmp_path, "a.mtl"), tmp_path / "out" / "asset.obj"
    write(load(path), target)
    (target.parent / "stone.png").write_text("of somebody else")
    (path.parent / "a.mtl").write_text("newmtl a\nmap_Kd stone.png\n")
    (path.parent / "stone.png").write_text("S")
    with pytest.raises(OutputError, match=r"stone\.png: another file of this name"):
        write(load(path), target)
    assert (target.parent / "a.mtl").read_text() == LIBRARY

"""Lightmaps in OBJ files: faces with new coordinates, a library and an image of their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aobake.errors import OutputError
from aobake.images import decode
from aobake.meshes.formats import check_texture_target, load
from aobake.meshes.lightmap import Kept, Unwrapped
from aobake.meshes.scene import Instance, Material, Mesh, Scene
from aobake.settings import ImageSettings
from tests.meshes.formats.lightmaps import (
    explode_all,
    exploded,
    lightmap,
    page,
    smooth,
    steps,
    write,
)

QUAD = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
"""
TEXTURED = QUAD + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


def asset(tmp_path: Path, text: str, **libraries: str) -> Path:
    """An OBJ file in a folder of its own, with these material libraries."""
    folder = tmp_path / "in"
    folder.mkdir()
    for name, content in libraries.items():
        (folder / f"{name}.mtl").write_bytes(content.encode())
    (folder / "a.obj").write_bytes(text.encode())
    return folder / "a.obj"


def coordinates(path: Path) -> np.ndarray:
    found = load(path).meshes[0].at_corners("TEXCOORD_0")
    assert found is not None
    return found


def test_kept_coordinates_leave_every_line_but_the_library(tmp_path: Path) -> None:
    text = (
        f"# made by hand\r\nmtllib a.mtl\r\n{TEXTURED}usemtl wood\r\nf 1/1 2/2 3/3 4/4 # quad\r\n"
    )
    source = asset(tmp_path, text, a="newmtl wood\nKd 1 0 0\nmap_Ka old.png\n\nnewmtl glass\nd 0.5")
    written = write(load(source), lightmap(Kept(uv_set=0)), tmp_path / "in" / "b.obj")
    assert [path.name for path in written] == ["b.obj", "b.mtl", "b_ao.png"]
    assert written[0].read_bytes() == text.replace("a.mtl", "b.mtl").encode()
    assert written[1].read_text() == (
        "newmtl wood\nKd 1 0 0\nmap_Ka b_ao.png\nmap_ao b_ao.png\n\nnewmtl glass\nd 0.5"
    )
    image = decode(written[2].read_bytes(), "image")
    np.testing.assert_array_equal(steps(image[:, :, 0]), steps(page()))
    assert source.read_bytes() == text.encode()


def test_a_polygon_stays_one_where_its_triangles_agree(tmp_path: Path) -> None:
    source = asset(tmp_path, QUAD + "vn 0 0 1\nf 1//1 2//1 3//1 4//-1\n")
    scene = load(source)
    layout = smooth(scene.meshes[0])
    target = write(scene, lightmap(layout), tmp_path / "b.obj")[0]
    assert target.read_text().splitlines()[-1] == "f 1/1/1 2/2/1 3/3/1 4/4/-1"
    np.testing.assert_allclose(coordinates(target), layout.uv[layout.faces], atol=1e-7)


def test_a_polygon_becomes_triangles_where_they_differ(tmp_path: Path) -> None:
    concave = "v 0 0 0\nv 2 2 0\nv 0 4 0\nv 1 2 0\n"
    source = asset(tmp_path, concave + "g a\nf -4 -3 -2 -1 # arrow\ng b\nf 1 \\\n 2 3\n")
    scene = load(source)
    layout = exploded(scene.meshes[0])
    target = write(scene, lightmap(layout), tmp_path / "b.obj")[0]
    lines = target.read_text().splitlines()
    assert sum(line.startswith("f ") for line in lines) == 3
    assert any(line.endswith("# arrow") for line in lines)
    assert [line for line in lines if line.startswith("g")] == ["g a", "g b"]
    back = load(target)
    np.testing.assert_array_equal(back.meshes[0].faces, scene.meshes[0].faces)
    np.testing.assert_array_equal(back.meshes[0].vertices, scene.meshes[0].vertices)
    np.testing.assert_allclose(coordinates(target), layout.uv[layout.faces], atol=1e-7)


def test_old_coordinates_stay_and_are_counted(tmp_path: Path) -> None:
    """Some stand before the first face and some behind it, whose numbers no face uses any more."""
    source = asset(tmp_path, TEXTURED + "f 1/1 2/2 3/3\nvt 0.5 0.5\nf 1/-1 3/3 4/4\n")
    scene = load(source)
    layout = exploded(scene.meshes[0])
    target = write(scene, lightmap(layout), tmp_path / "b.obj")[0]
    assert target.read_text().count("vt 0.5 0.5") == 1
    np.testing.assert_allclose(coordinates(target), layout.uv[layout.faces], atol=1e-7)


def test_faces_without_a_material_get_one(tmp_path: Path) -> None:
    source = asset(tmp_path, TEXTURED + "f 1/1 2/2 3/3\nusemtl lost\nf 1/1 3/3 4/4\n")
    target = write(load(source), lightmap(Kept(uv_set=0)), tmp_path / "b.obj")[0]
    lines = target.read_text().splitlines()
    assert lines[0] == "mtllib b.mtl"
    assert lines[lines.index("f 1/1 2/2 3/3") - 1] == "usemtl ambient_occlusion"
    names = [material.name for material in load(target).materials]
    assert names == ["ambient_occlusion", "lost"]
    assert all(material.occlusion_texture for material in load(target).materials)


def test_several_libraries_become_one(tmp_path: Path) -> None:
    text = f"mtllib a.mtl\n{TEXTURED}mtllib b.mtl\nusemtl two\nf 1/1 2/2 3/3\n"
    source = asset(tmp_path, text, a="newmtl one", b="newmtl two\nKd 0 1 0\n")
    target = write(load(source), lightmap(Kept(uv_set=0)), tmp_path / "c.obj")[0]
    assert "mtllib c.mtl\n" in target.read_text()
    assert "# mtllib b.mtl\n" in target.read_text()
    (material,) = load(target).materials
    assert material.base_color[:3] == (0.0, 1.0, 0.0)
    assert material.occlusion_texture is not None
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c.mtl", "c.obj", "c_ao.png", "in"]


def test_textures_go_along_and_keep_their_coordinates(tmp_path: Path) -> None:
    text = f"mtllib a.mtl\n{TEXTURED}usemtl wood\nf 1/1 2/2 3/3\n"
    source = asset(tmp_path, text, a="newmtl wood\nmap_Kd grain.png\n")
    (source.parent / "grain.png").write_bytes(b"grain")
    scene = load(source)
    with pytest.raises(OutputError, match="one set of texture coordinates") as caught:
        check_texture_target(scene, tmp_path / "b.obj", ImageSettings(), explode_all(scene))
    assert "\n" not in str(caught.value)
    write(scene, lightmap(Kept(uv_set=0)), tmp_path / "b.obj")
    assert (tmp_path / "grain.png").read_bytes() == b"grain"
    assert not (tmp_path / "a.mtl").exists()


def test_names_are_single_words_and_never_those_of_other_files(tmp_path: Path) -> None:
    scene = load(asset(tmp_path, TEXTURED + "f 1/1 2/2 3/3\n"))
    (tmp_path / "my_chair.mtl").write_text("newmtl mine\n")
    for _ in range(2):  # the second time, my_chair2.mtl belongs to the target
        written = write(scene, lightmap(Kept(uv_set=0)), tmp_path / "my chair.obj")
        assert [path.name for path in written] == [
            "my chair.obj",
            "my_chair2.mtl",
            "my_chair_ao.png",
        ]
    assert (tmp_path / "my_chair.mtl").read_text() == "newmtl mine\n"


def test_a_second_bake_replaces_the_first_one(tmp_path: Path) -> None:
    source = asset(tmp_path, TEXTURED + "f 1/1 2/2 3/3\n")
    first = write(load(source), lightmap(Kept(uv_set=0)), tmp_path / "b.obj")
    second = write(load(first[0]), lightmap(Kept(uv_set=0)), tmp_path / "c.obj")
    assert second[1].read_text() == first[1].read_text().replace("b_ao.png", "c_ao.png")


@pytest.mark.parametrize("encoding", ["half", "float"])
def test_floating_point_goes_into_exr(tmp_path: Path, encoding: Any) -> None:
    scene = load(asset(tmp_path, TEXTURED + "f 1/1 2/2 3/3\n"))
    settings = ImageSettings(encoding=encoding)
    written = write(scene, lightmap(Kept(uv_set=0)), tmp_path / "b.obj", settings)
    assert written[2].name == "b_ao.exr"
    np.testing.assert_allclose(
        decode(written[2].read_bytes(), "image")[:, :, 0], page(), atol=2.0**-11
    )


def test_lines_with_coordinates_are_refused(tmp_path: Path) -> None:
    scene = load(asset(tmp_path, TEXTURED + "f 1/1 2/2 3/3\nl 1/1 2/2\n"))
    with pytest.raises(OutputError, match=r"lines \(l\) have texture coordinates"):
        write(scene, explode_all(scene), tmp_path / "b.obj")
    assert not (tmp_path / "b.obj").exists()


def test_a_layout_of_other_faces_is_refused(tmp_path: Path) -> None:
    scene = load(asset(tmp_path, QUAD + "f 1 2 3 4\n"))
    good = exploded(scene.meshes[0])
    turned = Unwrapped(source=good.source, faces=good.faces[:, ::-1], uv=good.uv)
    with pytest.raises(OutputError, match="the layout is one of other faces"):
        write(scene, lightmap(turned), tmp_path / "b.obj")


def test_any_scene_becomes_an_obj_file(tmp_path: Path) -> None:
    """Two instances on two images, one of them mirrored, with a material of one name and a bare one."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0.1]])
    sheet = Mesh(vertices=vertices, faces=np.array([[0, 1, 2]]), material=0, name="a sheet")
    bare = Mesh(vertices=vertices, faces=np.array([[0, 1, 2]]), normals=vertices + 1)
    mirrored = np.diag([-1.0, 1, 1, 1])
    scene = Scene(
        meshes=(sheet, bare),
        instances=(Instance(mesh=0), Instance(mesh=0, transform=mirrored), Instance(mesh=1)),
        materials=(Material(name="red paint", base_color=(1, 0, 0, 1)),),
    )
    found = explode_all(scene, (page(0), page(1)))
    written = write(scene, found, tmp_path / "b.obj")
    assert [path.name for path in written] == ["b.obj", "b.mtl", "b_ao.png", "b_ao2.png"]
    back = load(written[0])
    names = [material.name for material in back.materials]
    assert names == ["red_paint", "red_paint_2", "ambient_occlusion_2"]
    layouts = [placing.layout for placing in found.placings if placing]
    expected = [layout.uv[layout.faces] for layout in layouts if isinstance(layout, Unwrapped)]
    expected[1] = expected[1][:, ::-1]  # with its face
    np.testing.assert_allclose(coordinates(written[0]), np.concatenate(expected), atol=1e-7)
    corners = back.meshes[0].vertices[back.meshes[0].faces]
    np.testing.assert_array_equal(corners[1], (vertices * (-1, 1, 1))[::-1])

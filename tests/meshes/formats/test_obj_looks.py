"""What an OBJ file says beyond its geometry: texture coordinates by corner, colours, materials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from aobake.errors import InputError
from aobake.meshes.formats import obj
from aobake.meshes.materials import Material
from aobake.meshes.scene import Scene

# A square, and an arrowhead whose fan from its first corner would leave it.
POINTS = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 1 9 0\n"
ARROW = "v 0 0 1\nv 4 2 1\nv 0 4 1\nv 1 2 1\n"


def read(folder: Path, text: str, library: str | None = None) -> Scene:
    """The scene in an OBJ file, with a material library beside it."""
    if library is not None:
        (folder / "a.mtl").write_text(library, encoding="utf-8")
        text = "mtllib a.mtl\n" + text
    (folder / "a.obj").write_text(text, encoding="utf-8")
    return obj.read(folder / "a.obj", root=None, scene=None)


def corner_values(scene: Scene, name: str) -> np.ndarray:
    found = scene.meshes[0].at_corners(name)
    assert found is not None
    return found


def test_every_corner_of_a_polygon_keeps_its_own_texture_coordinates(tmp_path: Path) -> None:
    """vt repeats x and y, except at the vertex that two polygons share: there each has its own."""
    vt = "".join(f"vt {x} {y}\n" for x, y in ((0, 0), (2, 0), (2, 2), (0, 2), (1, 9), (7, 7)))
    scene = read(tmp_path, POINTS + vt + "f 1/1 2/2 3/3 4/4\nf 4/4 3/6 5/5\n")
    mesh = scene.meshes[0]
    assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3], [3, 2, 4]])
    expected = mesh.vertices[mesh.faces][..., :2].copy()
    expected[2, 1] = (7, 7)
    assert_array_equal(corner_values(scene, "TEXCOORD_0"), expected * (1, -1) + (0, 1))


def test_a_polygon_that_is_cut_along_its_ears_keeps_them_as_well(tmp_path: Path) -> None:
    vt = "".join(f"vt {x} {y}\n" for x, y in ((0, 0), (4, 2), (0, 4), (1, 2)))
    for first in range(4):
        order = [(first + k) % 4 + 1 for k in range(4)]
        faces = "f " + " ".join(f"{k}/{k}" for k in order) + "\n"
        scene = read(tmp_path, ARROW + vt + faces)
        mesh = scene.meshes[0]
        expected = mesh.vertices[mesh.faces][..., :2] * (1, -1) + (0, 1)
        assert_array_equal(corner_values(scene, "TEXCOORD_0"), expected)


def test_relative_numbers_blocks_and_single_coordinates_mean_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = POINTS + "vt 0.5\nvt 0.25 0.5 0\nf 1/1 2/2 3/1\nf 1/2 3/2 4/1\n"
    turned = POINTS + "vt 0.5\nvt 0.25 0.5 0\nf 1/-2 2/-1/ 3/-2\nf 1/-1 3/-1 4/-2\n"
    expected = corner_values(read(tmp_path, plain), "TEXCOORD_0")
    assert_array_equal(expected[0], [[0.5, 1.0], [0.25, 0.5], [0.5, 1.0]])
    assert_array_equal(corner_values(read(tmp_path, turned), "TEXCOORD_0"), expected)
    monkeypatch.setattr("aobake.meshes.formats.obj.statements.BLOCK_BYTES", 3)
    assert_array_equal(corner_values(read(tmp_path, turned), "TEXCOORD_0"), expected)


def test_a_corner_without_texture_coordinates_has_those_of_the_origin(tmp_path: Path) -> None:
    scene = read(tmp_path, POINTS + "vt 0.5 0.5\nf 1/1 2 3/1\nf 1 3 4\n")
    found = corner_values(scene, "TEXCOORD_0")
    assert_array_equal(found[0], [[0.5, 0.5], [0, 1], [0.5, 0.5]])
    assert_array_equal(found[1], [[0, 1]] * 3)


@pytest.mark.parametrize("text", ["f 1 2 3\n", "vt 0 0\nf 1 2 3\n", "vn 0 0 1\nf 1//1 2//1 3//1\n"])
def test_a_file_whose_faces_have_none_has_no_attribute(tmp_path: Path, text: str) -> None:
    mesh = read(tmp_path, POINTS + text).meshes[0]
    assert "TEXCOORD_0" not in mesh.attributes
    assert len(mesh.attributes) == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("vt 0 zwei\nf 1/1 2/1 3/1\n", "line 6: 'zwei' is no number"),
        ("vt 0 0\nf 1/1 2/2 3/1\n", "texture coordinates 2, and the file has 1"),
        ("vt 0 0\nf 1/1 2/-2 3/1\n", "before the first, and the file has 1"),
        ("vt 0 0\nf 1/1 2/4294967297 3/1\n", "and the file has 1"),
        ("f 1/1 2/1 3/1\n", "texture coordinates 1, and the file has 0"),
    ],
)
def test_broken_texture_coordinates_stop_no_load_and_are_one_line_when_wanted(
    tmp_path: Path, text: str, said: str
) -> None:
    mesh = read(tmp_path, POINTS + text).meshes[0]
    with pytest.raises(InputError) as caught:
        mesh.at_corners("TEXCOORD_0")
    assert said in str(caught.value)
    assert "a.obj" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_colors_of_vertex_lines_are_linear_and_white_where_there_are_none(tmp_path: Path) -> None:
    text = "v 0 0 0 1 0.5 0\nv 1 0 0 0.25\nv 0 1 0\nv 1 1 0 0 0 1 0.5\nf 1 2 3\n"
    found = read(tmp_path, text).meshes[0].attributes["COLOR_0"].values
    assert_array_equal(found, [[1, 0.5, 0], [1, 1, 1], [1, 1, 1], [0, 0, 1]])


def test_colors_counted_in_bytes_are_scaled(tmp_path: Path) -> None:
    text = "v 0 0 0 255 51 0\nv 1 0 0\nv 0 1 0 0 0 102\nf 1 2 3\n"
    found = read(tmp_path, text).meshes[0].attributes["COLOR_0"].values
    assert_allclose(found, [[1.0, 0.2, 0.0], [1.0, 1.0, 1.0], [0.0, 0.0, 0.4]])


def test_a_fourth_number_alone_is_no_color(tmp_path: Path) -> None:
    assert not read(tmp_path, "v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").meshes[0].attributes


USED = POINTS + "usemtl wood oak\nf 1 2 3\nf 1 3 4\n"


def wood(folder: Path, *lines: str) -> Material:
    scene = read(folder, USED, "\n".join(["newmtl wood oak", *lines]))
    assert scene.meshes[0].material == 0
    return scene.materials[0]


def test_a_material_that_all_faces_use_is_that_of_the_mesh(tmp_path: Path) -> None:
    found = wood(tmp_path, "Kd 0.5 0.25 0.125", "\tNs 30", "Ke 1 2 3 # lamp", "d 0.5", "Tr 0.5")
    assert (found.name, found.base_color) == ("wood oak", (0.5, 0.25, 0.125, 0.5))
    assert (found.emissive, found.alpha_mode, found.metallic) == ((1, 2, 3), "BLEND", 0)
    assert found.roughness == pytest.approx((2 / 32) ** 0.25)


@pytest.mark.parametrize(
    ("lines", "alpha"),
    [((), 1), (("Tr 0.25",), 0.75), (("Tr 1.0",), 1), (("Tr 1.0", "d 1.0"), 1), (("d nan",), 1)],
)
def test_opacity_is_what_exporters_mean_by_it(
    tmp_path: Path, lines: tuple[str, ...], alpha: float
) -> None:
    assert wood(tmp_path, *lines).base_color[3] == alpha


def test_a_map_beside_a_black_color_is_meant_alone(tmp_path: Path) -> None:
    assert wood(tmp_path, "Kd 0 0 0", "map_Kd a.png").base_color[:3] == (1, 1, 1)
    assert wood(tmp_path, "Kd 0 0 0").base_color[:3] == (0, 0, 0)
    assert wood(tmp_path, "map_Kd a.png", "map_d a.png").alpha_mode == "MASK"


def test_textures_are_read_with_their_options(tmp_path: Path) -> None:
    """Options are for a v that runs up; (u, v) and its look-up are compared from both ends."""
    (tmp_path / "the image.png").write_bytes(b"a picture")
    scene = read(
        tmp_path,
        USED,
        "newmtl wood oak\nmap_Kd -s 2 3 1 -o 0.5 0.25 0 -clamp on the image.png\nmap_ao the image.png\n",
    )
    found = scene.materials[0]
    assert found.base_color_texture is not None
    assert found.occlusion_texture is not None
    assert [found.base_color_texture.image, found.occlusion_texture.image, len(scene.images)] == [
        0,
        0,
        1,
    ]
    assert found.base_color_texture.wrap == ("clamp", "clamp")
    assert found.occlusion_texture.transform is None
    assert found.base_color_texture.transform is not None
    u, up = 0.125, 0.375
    looked = found.base_color_texture.transform @ (u, 1 - up, 1)
    assert_allclose(looked, [2 * u + 0.5, 1 - (3 * up + 0.25)])
    assert scene.images[0].data() == b"a picture"


def test_a_texture_that_is_missing_or_outside_is_one_line_when_wanted(tmp_path: Path) -> None:
    (tmp_path / "above.png").write_bytes(b"")
    folder = tmp_path / "inner"
    folder.mkdir()
    library = "newmtl wood oak\nmap_Kd missing.png\nmap_Ke ../above.png\n"
    for image, said in zip(
        read(folder, USED, library).images, ("no such file", "--root"), strict=True
    ):
        with pytest.raises(InputError) as caught:
            image.data()
        assert said in str(caught.value)
        assert "a.obj" in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("faces", "names"),
    [
        ("usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n", ["a", "b"]),
        ("f 1 2 3\nusemtl a\nf 1 3 4\n", ["a"]),
        ("usemtl a\nf 1 2 3\nusemtl unheard\nf 1 3 4\n", ["a"]),
        ("usemtl unheard\nf 1 2 3\n", []),
    ],
)
def test_several_materials_are_listed_and_none_is_that_of_the_mesh(
    tmp_path: Path, faces: str, names: list[str]
) -> None:
    scene = read(tmp_path, POINTS + faces, "newmtl b\nnewmtl c\nnewmtl a\n")
    assert [material.name for material in scene.materials] == names
    assert scene.meshes[0].material is None


def test_a_material_named_without_a_face_of_its_own_does_not_count(tmp_path: Path) -> None:
    faces = "usemtl b\nusemtl a\nf 1 2 3\nusemtl a\nf 1 3 4\nusemtl b\n"
    scene = read(tmp_path, POINTS + faces, "newmtl b\nnewmtl a\n")
    assert ([material.name for material in scene.materials], scene.meshes[0].material) == (["a"], 0)

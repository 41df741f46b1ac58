"""Lightmaps of scenes that were read from no glTF file: a new one is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aobake.errors import OutputError
from aobake.meshes.formats import check_texture_target, gltf
from aobake.meshes.lightmap import Kept, Unwrapped
from aobake.meshes.scene import Attribute, Mesh, Scene
from aobake.settings import ImageSettings, StoreSettings
from tests.meshes.formats.gltf.build import (
    SQUARE,
    TWO_TRIANGLES,
    UV,
    attribute,
    ramp,
)
from tests.meshes.formats.lightmaps import (
    at_corners,
    explode_all,
    lightmap,
    write,
)


@pytest.mark.parametrize("ending", [".glb", ".gltf"])
def test_a_scene_from_arrays_gets_a_lightmap(tmp_path: Path, ending: str) -> None:
    """A face that is not finite is left out of the file, though the layout has it."""
    vertices = [*SQUARE, [np.nan, 0, 0]]
    faces = [[0, 1, 2], [4, 0, 1], [0, 2, 3]]
    scene = Scene.from_arrays(vertices, faces)
    found = explode_all(scene)
    target = tmp_path / f"new{ending}"
    write(scene, found, target)
    layout = found.placings[0].layout if found.placings[0] else None
    assert isinstance(layout, Unwrapped)
    corners = at_corners(target)
    np.testing.assert_array_equal(corners["TEXCOORD_0"], layout.uv[layout.faces[[0, 2]]])
    np.testing.assert_array_equal(corners["POSITION"], np.array(SQUARE)[np.array(faces)[[0, 2]]])


def test_coordinates_and_colours_of_vertices_come_along(tmp_path: Path) -> None:
    colors = np.array([[0.25, 0.5, 0.75]] * 4)
    mesh = Mesh(
        vertices=np.array(SQUARE),
        faces=np.reshape(TWO_TRIANGLES, (2, 3)),
        attributes={
            "TEXCOORD_0": Attribute(values=np.array(UV)),
            "COLOR_0": Attribute(values=colors),
        },
    )
    scene = Scene.from_meshes([mesh])
    write(scene, lightmap(Kept(uv_set=0)), tmp_path / "a.glb")
    corners = at_corners(tmp_path / "a.glb")
    np.testing.assert_array_equal(corners["TEXCOORD_0"], np.array(UV)[mesh.faces])
    np.testing.assert_array_equal(corners["COLOR_0"], colors[mesh.faces])
    values = ramp(scene)
    gltf.write(scene, values, tmp_path / "b.glb", StoreSettings())
    np.testing.assert_allclose(
        attribute(tmp_path / "b.glb", "COLOR_0"), colors * values[0][:, None], rtol=1e-6
    )


def test_coordinates_of_corners_split_the_vertices(tmp_path: Path) -> None:
    """As OBJ has them: vertex 0 has two coordinates, vertex 2 one that both faces share."""
    corners = np.array([[0, 1, 2], [3, 2, 4]], np.int32)
    uv = np.arange(10.0).reshape(5, 2) / 16
    mesh = Mesh(
        vertices=np.array(SQUARE),
        faces=np.reshape(TWO_TRIANGLES, (2, 3)),
        attributes={"TEXCOORD_0": Attribute(values=uv, corners=corners)},
    )
    write(Scene.from_meshes([mesh]), lightmap(Kept(uv_set=0)), tmp_path / "a.glb")
    found = at_corners(tmp_path / "a.glb")
    np.testing.assert_array_equal(found["TEXCOORD_0"], uv[corners])
    np.testing.assert_array_equal(found["POSITION"], mesh.vertices[mesh.faces])
    assert len(attribute(tmp_path / "a.glb", "POSITION")) == 5


@pytest.mark.parametrize("name", ["a.ply", "a.stl", "a.usda", "a.fbx"])
def test_formats_without_textures_are_refused_in_one_line(tmp_path: Path, name: str) -> None:
    scene = Scene.from_arrays(SQUARE, np.reshape(TWO_TRIANGLES, (2, 3)))
    with pytest.raises(OutputError, match=r"cannot hold a lightmap.*GLB or OBJ") as caught:
        check_texture_target(scene, tmp_path / name, ImageSettings())
    assert "\n" not in str(caught.value)

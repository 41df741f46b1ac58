"""Primvars of USD meshes at the corners of their triangles, however they are authored."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from aobake.meshes.formats import load
from aobake.meshes.scene import Scene

pytest.importorskip("pxr", reason="usd-core is the extra usd")

# A square, a hole, and a triangle that shares an edge with the square.
BODY = """
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0)]
        int[] faceVertexCounts = [4, 3, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 0, 2, 4, 1, 4, 2]
        int[] holeIndices = [1]
"""
POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0]], np.float64)
CORNERS = [0, 1, 2, 3, 0, 2, 4, 1, 4, 2]


def read(path: Path, *more: str) -> Scene:
    text = '#usda 1.0\ndef Mesh "part"\n{\n' + BODY + "\n".join(more) + "\n}\n"
    path.write_text(text, encoding="utf-8")
    return load(path)


def primvar(name: str, kind: str, values: object, interpolation: str, more: str = "") -> str:
    return f'{kind}[] primvars:{name} = {values} (interpolation = "{interpolation}")\n{more}'


def pairs(rows: np.ndarray) -> list[tuple[float, ...]]:
    return [tuple(row) for row in rows.tolist()]


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize("way", ["vertex", "varying", "faceVarying", "indexed"])
def test_texture_coordinates_stay_with_their_points_and_run_down(
    tmp_path: Path, way: str, orientation: str
) -> None:
    """st is the position, so that every corner tells whether it got its own."""
    turn = f'uniform token orientation = "{orientation}"'
    if way == "indexed":
        indices = f"int[] primvars:st:indices = {CORNERS}"
        st = primvar("st", "texCoord2f", pairs(POINTS), "faceVarying", indices)
    else:
        rows = POINTS[CORNERS] if way == "faceVarying" else POINTS
        st = primvar("st", "texCoord2f", pairs(rows), way)
    mesh = read(tmp_path / "a.usda", turn, st).meshes[0]
    found = mesh.at_corners("TEXCOORD_0")
    assert found is not None
    assert len(mesh.faces) == 3
    assert_array_equal(found, mesh.vertices[mesh.faces][..., :2] * (1, -1) + (0, 1))


def test_st_comes_first_and_any_texture_coordinates_else(tmp_path: Path) -> None:
    ones, twos = pairs(np.ones((5, 2))), pairs(np.full((5, 2), 2.0))
    other = primvar("map1", "texCoord2f", ones, "vertex")
    both = read(tmp_path / "a.usda", other, primvar("st", "float2", twos, "vertex")).meshes[0]
    alone = read(tmp_path / "b.usda", other).meshes[0]
    assert_array_equal(both.attributes["TEXCOORD_0"].values, [[2, -1]] * 5)
    assert_array_equal(alone.attributes["TEXCOORD_0"].values, [[1, 0]] * 5)


def test_colors_of_faces_and_of_the_whole(tmp_path: Path) -> None:
    by_face = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    faces = read(tmp_path / "a.usda", primvar("displayColor", "color3f", by_face, "uniform"))
    found = faces.meshes[0].at_corners("COLOR_0")
    assert found is not None
    assert_array_equal(found, np.repeat(np.array(by_face)[[0, 0, 2]][:, None], 3, axis=1))
    whole = read(tmp_path / "b.usda", primvar("displayColor", "color3f", by_face[1:2], "constant"))
    found = whole.meshes[0].at_corners("COLOR_0")
    assert found is not None
    assert_array_equal(found, np.broadcast_to((0, 1, 0), (3, 3, 3)))


def test_occlusion_of_an_earlier_bake_is_an_attribute(tmp_path: Path) -> None:
    values = [0.125, 0.25, 0.5, 0.75, 1.0]
    mesh = read(tmp_path / "a.usda", primvar("ao", "float", values, "vertex")).meshes[0]
    assert_array_equal(mesh.attributes["_AO"].values[:, 0], values)


@pytest.mark.parametrize(
    "broken",
    [
        primvar("st", "texCoord2f", [(0, 0)], "vertex"),
        primvar("st", "texCoord3f", [(0, 0, 0)] * 5, "vertex"),
        primvar("st", "float", [0.0] * 5, "vertex"),
        'string primvars:st = "map1"',
    ],
)
def test_primvars_that_do_not_fit_are_left_aside(tmp_path: Path, broken: str) -> None:
    assert len(read(tmp_path / "a.usda", broken).meshes[0].attributes) == 0


def test_copies_of_a_point_instancer_are_stored_together(tmp_path: Path) -> None:
    text = (
        '#usda 1.0\ndef PointInstancer "crowd"\n{\n rel prototypes = [</crowd/part>]\n'
        " int[] protoIndices = [0, 0, 0]\n point3f[] positions = [(0, 0, 0), (5, 0, 0), (9, 0, 0)]\n"
        ' def Mesh "part"\n {\n' + BODY + ' }\n}\ndef Mesh "alone"\n{\n' + BODY + "}\n"
    )
    path = tmp_path / "a.usda"
    path.write_text(text, encoding="utf-8")
    scene = load(path)
    shared = [number for number, i in enumerate(scene.instances) if i.stored_with is not None]
    assert len(shared) == 3
    assert {scene.instances[number].stored_with for number in shared} == {shared[0]}
    assert_allclose([scene.instances[n].transform[0, 3] for n in shared], [0, 5, 9])

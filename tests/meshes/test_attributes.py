"""Attributes of meshes: read once, when they are wanted, and looked up at the corners of faces."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from aobake.errors import InputError
from aobake.meshes.attributes import DeferredAttributes
from aobake.meshes.scene import Attribute, Camera, Light, Mesh

VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
FACES = np.array([[0, 1, 2], [1, 3, 2]])
ROWS = np.arange(8.0).reshape(4, 2)


def mesh_with(attribute: Attribute) -> Mesh:
    return Mesh(vertices=VERTICES, faces=FACES, name="m", attributes={"TEXCOORD_0": attribute})


def test_an_attribute_is_read_when_it_is_asked_for_and_once() -> None:
    read: list[str] = []

    def values() -> Attribute:
        read.append("COLOR_0")
        return Attribute(values=ROWS)

    found = DeferredAttributes({"COLOR_0": values})
    assert ("COLOR_0" in found, "COLOR_1" in found, list(found), len(found)) == (
        True,
        False,
        ["COLOR_0"],
        1,
    )
    assert read == []
    assert found["COLOR_0"] is found["COLOR_0"]
    assert found.get("COLOR_1") is None
    assert read == ["COLOR_0"]
    with pytest.raises(KeyError):
        found["COLOR_1"]


def test_values_of_vertices_and_of_corners_are_looked_up() -> None:
    by_vertex = mesh_with(Attribute(values=ROWS)).at_corners("TEXCOORD_0")
    assert by_vertex is not None
    assert_array_equal(by_vertex, ROWS[FACES])
    corners = np.array([[3, 2, 1], [0, 0, 3]], np.int32)
    by_corner = mesh_with(Attribute(values=ROWS, corners=corners)).at_corners("TEXCOORD_0")
    assert by_corner is not None
    assert_array_equal(by_corner, ROWS[corners])
    assert mesh_with(Attribute(values=ROWS)).at_corners("COLOR_0") is None


def test_values_that_do_not_fit_are_refused_in_one_line() -> None:
    for misfit in (
        Attribute(values=ROWS[:3]),
        Attribute(values=ROWS, corners=np.zeros((1, 3), np.int32)),
    ):
        with pytest.raises(InputError, match="mesh 'm': TEXCOORD_0 is for"):
            mesh_with(misfit).at_corners("TEXCOORD_0")
    with pytest.raises(InputError, match="points at"):
        Attribute(values=ROWS, corners=np.array([[0, 1, 4]], np.int32))
    with pytest.raises(InputError, match=r"\(N, k\)"):
        Attribute(values=np.zeros(4))


def test_nothing_of_a_scene_can_be_changed() -> None:
    attribute = Attribute(values=ROWS, corners=FACES.astype(np.int32))
    place = np.eye(4)
    camera, light = Camera(transform=place, yfov_rad=1.0), Light(kind="point", transform=place)
    for array in (attribute.values, attribute.corners, camera.transform, light.transform):
        assert array is not None
        assert not array.flags.writeable
    assert ROWS.flags.writeable
    assert place.flags.writeable
    with pytest.raises(InputError, match=r"\(4, 4\)"):
        Camera(transform=np.eye(3), yfov_rad=1.0)

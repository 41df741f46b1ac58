"""What a trimesh object has on its surface comes along."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial, SimpleMaterial

from aobake import Scene

# trimesh's visuals are not typed.
Textured: Any = TextureVisuals
Pbr: Any = PBRMaterial
Simple: Any = SimpleMaterial


def box(visual: Any = None) -> Any:
    mesh = trimesh.creation.box()
    if visual is not None:
        mesh.visual = visual
    return mesh


UV = np.random.default_rng(3).random((8, 2))


class Picture:
    """What is needed of a PIL image."""

    def save(self, stream: io.BytesIO, format: str) -> None:
        stream.write(f"encoded as {format}".encode())


def test_texture_coordinates_run_down() -> None:
    mesh = Scene.from_trimesh(box(Textured(uv=UV))).meshes[0]
    assert_allclose(mesh.attributes["TEXCOORD_0"].values, np.stack([UV[:, 0], 1 - UV[:, 1]], 1))


def test_colors_of_vertices_and_of_faces() -> None:
    by_vertex = box()
    by_vertex.visual.vertex_colors = np.arange(32, dtype=np.uint8).reshape(8, 4)
    found = Scene.from_trimesh(by_vertex).meshes[0].attributes["COLOR_0"]
    assert_allclose(found.values, np.arange(32).reshape(8, 4) / 255)
    by_face = box()
    by_face.visual.face_colors = np.arange(48, dtype=np.uint8).reshape(12, 4)
    at_corners = Scene.from_trimesh(by_face).meshes[0].at_corners("COLOR_0")
    assert at_corners is not None
    assert_allclose(at_corners, np.repeat(np.arange(48).reshape(12, 1, 4) / 255, 3, axis=1))


def test_a_plain_mesh_has_nothing_more() -> None:
    scene = Scene.from_trimesh(box())
    assert (scene.meshes[0].material, scene.materials, scene.images) == (None, (), ())
    assert len(scene.meshes[0].attributes) == 0


def test_a_material_is_shared_by_the_meshes_that_share_it() -> None:
    wood = Pbr(
        name="wood",
        baseColorFactor=[51, 102, 0, 255],
        metallicFactor=0.25,
        roughnessFactor=0.5,
        alphaMode="MASK",
        alphaCutoff=0.75,
        doubleSided=True,
    )
    paint = Simple(diffuse=[255, 0, 51, 255])
    visuals = [Textured(uv=UV, material=material) for material in (wood, paint, wood)]
    scene = Scene.from_trimesh(trimesh.Scene([box(visual) for visual in visuals]))
    first, second = scene.materials
    assert [mesh.material for mesh in scene.meshes] == [0, 1, 0]
    assert_allclose(first.base_color, (0.2, 0.4, 0, 1))
    assert (first.name, first.metallic, first.roughness) == ("wood", 0.25, 0.5)
    assert (first.alpha_mode, first.alpha_cutoff, first.double_sided) == ("MASK", 0.75, True)
    assert_allclose(second.base_color, (1, 0, 0.2, 1))
    assert (second.metallic, second.roughness, second.alpha_mode) == (0, 1, "OPAQUE")


@pytest.mark.parametrize("kind", [Pbr, Simple])
def test_a_picture_is_encoded_when_it_is_wanted(kind: Any) -> None:
    key = "baseColorTexture" if kind is Pbr else "image"
    scene = Scene.from_trimesh(box(Textured(uv=UV, material=kind(**{key: Picture()}))))
    texture = scene.materials[0].base_color_texture
    assert texture is not None
    assert (texture.image, scene.images[0].data()) == (0, b"encoded as PNG")
    assert_array_equal(scene.materials[0].base_color, [1, 1, 1, 1])

"""What a page shows of assets of other formats: all of it, as GLB."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

import aobake
from aobake.images import decode, encode
from aobake.meshes.materials import Image, Texture
from aobake.meshes.scene import Attribute
from aobake.viewer import packed_glb

PNG = encode(np.full((2, 2, 3), 0.5, np.float32), "png")


def square(**more: Any) -> aobake.Mesh:
    """Two triangles in a plane."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)
    return aobake.Mesh(vertices=vertices, faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32), **more)


def read_back(scene: aobake.Scene, tmp_path: Path) -> aobake.Scene:
    path = tmp_path / "packed.glb"
    path.write_bytes(packed_glb(scene).glb)
    return aobake.load(path)


def test_occlusion_and_corner_values_of_other_formats_come_along(tmp_path: Path) -> None:
    uv = Attribute(
        values=np.arange(12, dtype=np.float64).reshape(6, 2) / 16,
        corners=np.arange(6, dtype=np.int32).reshape(2, 3),
    )
    ao = Attribute(values=np.array([[0.25], [0.5], [0.75], [1.0]]))
    scene = aobake.Scene.from_meshes([square(attributes={"TEXCOORD_0": uv, "_AO": ao})])
    mesh = read_back(scene, tmp_path).meshes[0]
    for name in ("TEXCOORD_0", "_AO"):
        before, after = scene.meshes[0].at_corners(name), mesh.at_corners(name)
        assert before is not None
        assert after is not None
        np.testing.assert_array_equal(after, before)
    np.testing.assert_array_equal(
        mesh.vertices[mesh.faces], scene.meshes[0].vertices[scene.meshes[0].faces]
    )


def test_creases_of_meshes_without_normals_stay_sharp(tmp_path: Path) -> None:
    fold = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]], np.float64)
    faces = np.array([[0, 2, 1], [0, 1, 3]], np.int32)
    mesh = read_back(aobake.Scene.from_arrays(fold, faces), tmp_path).meshes[0]
    assert mesh.normals is not None
    assert len(mesh.vertices) == 6
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    facets = np.cross(b - a, c - a)
    np.testing.assert_allclose(mesh.normals[mesh.faces], np.repeat(facets[:, None], 3, axis=1))
    flat = read_back(aobake.Scene.from_meshes([square()]), tmp_path).meshes[0]
    assert len(flat.vertices) == 4, "nothing to split in a plane"


def test_textures_of_other_formats_come_along(tmp_path: Path) -> None:
    turn = np.array([[0.0, 3.0, 0.25], [-2.0, 0.0, 0.5]])
    texture = Texture(image=0, transform=turn, wrap=("clamp", "mirror"), nearest=True)
    tiff = encode(np.full((2, 2, 1), 0.25, np.float32), "tiff")
    material = aobake.Material(
        base_color_texture=texture,
        occlusion_texture=Texture(image=1),
        occlusion_strength=0.5,
        emissive_texture=Texture(image=2),
        emissive=(0.0, 2.0, 0.5),
    )

    def gone() -> bytes:
        raise aobake.InputError("gone.png: there is no such file.")

    uv = Attribute(values=np.zeros((4, 2)))
    scene = dataclasses.replace(
        aobake.Scene.from_meshes([square(attributes={"TEXCOORD_0": uv})]), materials=(material,)
    )
    images = tuple(
        Image(name=name, data=data)
        for name, data in (("a.png", lambda: PNG), ("b.tif", lambda: tiff), ("c.png", gone))
    )
    scene = dataclasses.replace(
        scene,
        images=images,
        meshes=(dataclasses.replace(scene.meshes[0], material=0),),
    )
    packed = packed_glb(scene)
    assert packed.warnings == ("gone.png: there is no such file.",)
    found = read_back(scene, tmp_path)
    shown = found.materials[0]
    assert shown.emissive == (0.0, 1.0, 0.5)
    assert shown.emissive_texture is None
    assert shown.occlusion_strength == 0.5
    assert shown.occlusion_texture is not None
    converted = decode(found.images[shown.occlusion_texture.image].data(), "x.png")
    np.testing.assert_allclose(converted, 0.25, atol=0.003)
    assert shown.base_color_texture is not None
    assert shown.base_color_texture.wrap == ("clamp", "mirror")
    assert shown.base_color_texture.nearest
    assert shown.base_color_texture.transform is not None
    np.testing.assert_allclose(shown.base_color_texture.transform, turn, atol=1e-12)
    assert found.images[shown.base_color_texture.image].data() == PNG

"""Pictures before and after a bake: the same view, darker where it is occluded, small, and of anything."""

from __future__ import annotations

import dataclasses
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import aobake
from aobake import report
from aobake.batch.palette import png_of
from aobake.batch.pictures import HEIGHT_PX, WIDTH_PX, pictures_of, thumbnails
from aobake.images import decode
from aobake.jobs import Done
from aobake.results import BakedTexture, BakedVertices
from aobake.settings import StoreSettings

FEW = aobake.BakeSettings(rays=16)


def shown(png: bytes) -> NDArray[np.float32]:
    """(H, W) brightness, as stored."""
    return np.asarray(decode(png, "x.png")[..., :3].mean(axis=2))


def done(baked: BakedVertices | BakedTexture, *outputs: Path) -> Done:
    told = report.of_bake(
        baked,
        command="vertex",
        inputs=(),
        outputs=report.digests(outputs),
        store=StoreSettings(),
    )
    return Done(baked=baked, report=told)


def test_occlusion_darkens_the_corner_and_nothing_else_changes(corner: Path) -> None:
    pictures = thumbnails(aobake.bake_vertices(aobake.load(corner), FEW))
    before, after = shown(pictures["before"]), shown(pictures["after"])
    assert before.shape == after.shape == (HEIGHT_PX, WIDTH_PX)
    background = before == before[0, 0]
    step = 2.5 / 255.0  # colours that are nearly the same are one colour
    assert np.abs(after - before)[background].max() <= step
    assert (after <= before + step).all()
    assert (before - after).max() > 0.1


def test_a_surface_that_is_open_looks_the_same_after(tmp_path: Path) -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], np.float64)
    scene = aobake.Scene.from_arrays(square, np.array([[0, 2, 1], [0, 3, 2]]))
    pictures = thumbnails(aobake.bake_vertices(scene, FEW))
    assert pictures["before"] == pictures["after"]
    assert np.ptp(shown(pictures["before"])) > 0.1, "and it is seen"


def test_a_texture_is_shown_by_its_texels_and_looks_as_the_vertices_do(corner: Path) -> None:
    """The corner is finely divided, so that values at vertices show the same."""
    scene = aobake.load(corner)
    settings = aobake.BakeSettings(rays=64, size=128)
    by_vertices = shown(thumbnails(aobake.bake_vertices(scene, settings))["after"])
    by_texels = shown(thumbnails(aobake.bake_texture(scene, settings))["after"])
    assert np.abs(by_vertices - by_texels).mean() < 0.01
    assert np.quantile(np.abs(by_vertices - by_texels), 0.99) < 0.06


def test_texels_show_what_vertices_cannot() -> None:
    """A plate over the middle of one large square darkens none of its corners."""
    floor = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], np.float64)
    plate = floor * 0.4 + [0.0, 0.3, 0.0]
    faces = np.array([[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]])
    scene = aobake.Scene.from_arrays(np.concatenate([floor, plate]), faces)
    settings = aobake.BakeSettings(rays=64, size=128)
    darkened = []
    for baked in (aobake.bake_vertices(scene, settings), aobake.bake_texture(scene, settings)):
        pictures = thumbnails(baked)
        darkened.append(float((shown(pictures["before"]) - shown(pictures["after"])).max()))
    by_vertices, by_texels = darkened
    assert by_vertices < 0.05
    assert by_texels > 0.15


def test_the_same_bake_gives_the_same_small_files(corner: Path) -> None:
    scene = aobake.load(corner)
    first, second = (thumbnails(aobake.bake_vertices(scene, FEW)) for _ in range(2))
    assert first == second
    assert max(map(len, first.values())) < 10_000


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (np.empty((0, 3)), np.empty((0, 3), int)),
        (np.full((3, 3), np.nan), [[0, 1, 2]]),
        (np.zeros((3, 3)), [[0, 1, 2]]),
        (np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], float), [[0, 1, 2]]),
        (np.array([[0, 0, 0], [1, 0, 0], [0, 1, np.inf]], float), [[0, 1, 2]]),
        (np.eye(3) * 1e-30, [[0, 1, 2]]),
        (np.eye(3) * 1e30, [[0, 1, 2]]),
        (np.eye(3) * 1e300, [[0, 1, 2]]),
        (np.eye(3) + 1e12, [[0, 1, 2]]),
    ],
    ids=["empty", "nan", "a point", "a line", "infinite", "tiny", "huge", "vast", "far"],
)
def test_odd_assets_give_two_pictures_or_none(
    vertices: NDArray[np.float64], faces: list[list[int]]
) -> None:
    scene = aobake.Scene.from_arrays(vertices, np.asarray(faces, np.int32))
    baked = BakedVertices(
        scene=scene,
        settings=FEW,
        plan=aobake.plan(scene),
        ao=[np.ones(len(vertices), np.float32)],
        standard_error=[np.zeros(len(vertices), np.float32)],
        rays=0,
        seconds={},
        findings=(),
        warnings=(),
    )
    found, trouble = pictures_of(done(baked), "thumbnails")
    assert set(found) in (set(), {"before", "after"})
    assert not trouble


def test_holes_of_a_cut_out_are_looked_through(tmp_path: Path) -> None:
    """A material that is cut out everywhere shows nothing of its own."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)
    mesh = aobake.Mesh(vertices=square, faces=np.array([[0, 1, 2], [0, 2, 3]]), material=0)
    gone = aobake.Material(alpha_mode="MASK", base_color=(1.0, 1.0, 1.0, 0.0))
    scene = dataclasses.replace(
        aobake.Scene.from_arrays(square, mesh.faces), materials=(gone,), meshes=(mesh,)
    )
    pictures = thumbnails(aobake.bake_vertices(scene, FEW))
    assert np.ptp(shown(pictures["before"])) == 0.0


def test_light_that_is_no_number_spoils_no_picture(corner: Path) -> None:
    scene = aobake.load(corner)
    glowing = aobake.Material(emissive=(np.nan, np.inf, -1.0))
    meshes = tuple(dataclasses.replace(mesh, material=0) for mesh in scene.meshes)
    odd = dataclasses.replace(scene, meshes=meshes, materials=(glowing,))
    assert set(thumbnails(aobake.bake_vertices(odd, FEW))) == {"before", "after"}


def test_nothing_is_drawn_where_nothing_is_asked_for(corner: Path) -> None:
    assert pictures_of(done(aobake.bake_vertices(aobake.load(corner), FEW)), "none") == ({}, ())


def test_a_viewer_shows_the_output_and_shares_its_script(corner: Path, tmp_path: Path) -> None:
    baked = aobake.bake_vertices(aobake.load(corner), FEW)
    output = tmp_path / "corner.glb"
    aobake.save(baked, output)
    found, trouble = pictures_of(done(baked, output), "viewers")
    assert not trouble
    assert set(found) == {"before", "after", "viewer"}
    assert b'<script src="viewer.min.js">' in found["viewer"]
    assert len(found["viewer"]) < 40_000 + 2 * output.stat().st_size
    output.unlink()
    found, trouble = pictures_of(done_without(baked, output), "viewers")
    assert set(found) == {"before", "after"}
    assert len(trouble) == 1
    assert trouble[0].startswith("no viewer was made: ")
    assert "corner.glb" in trouble[0]


def done_without(baked: BakedVertices, output: Path) -> Done:
    """A job whose output is gone."""
    made = done(baked)
    record = report.FileRecord(path=str(output), sha256="")
    return Done(baked=baked, report=dataclasses.replace(made.report, outputs=(record,)))


def test_a_palette_keeps_few_colours_as_they_are() -> None:
    colors = np.array([[0, 0, 0], [255, 255, 255], [255, 0, 0], [3, 200, 90]], np.uint8)
    pixels = colors[np.arange(35).reshape(5, 7) % 4]
    np.testing.assert_array_equal(np.rint(255 * decode(png_of(pixels), "x.png")), pixels)


def test_a_palette_comes_near_to_any_picture() -> None:
    y, x = np.mgrid[0:64, 0:64].astype(np.uint8) * np.uint8(4)
    pixels = np.stack([x, y, 255 - x // 2 - y // 2], axis=2)
    found = np.rint(255 * decode(png_of(pixels), "x.png"))
    assert np.sqrt(np.mean((found - pixels) ** 2)) < 8.0
    grey = np.repeat(x[:, :, None], 3, axis=2)
    assert np.abs(np.rint(255 * decode(png_of(grey), "x.png")) - grey).max() <= 4


def test_a_palette_png_is_whole() -> None:
    data = png_of(np.zeros((3, 4, 3), np.uint8))
    at, kinds = 8, []
    while at < len(data):
        (length,) = struct.unpack_from(">I", data, at)
        kind, end = data[at + 4 : at + 8], at + 8 + length
        assert struct.unpack_from(">I", data, end)[0] == zlib.crc32(data[at + 4 : end])
        kinds.append(kind)
        at = end + 4
    assert kinds == [b"IHDR", b"PLTE", b"IDAT", b"IEND"]

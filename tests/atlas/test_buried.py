"""Texels inside of something must not show as an outline around it."""

from __future__ import annotations

import numpy as np

from aobake import BakeSettings, Instance, Scene, bake_texture
from aobake.atlas.buried import lit_rims
from aobake.atlas.lookup import sample
from aobake.meshes.scene import Attribute, Mesh
from tests.scenes import box, mesh_of, patch

CHART = np.zeros((5, 5), np.int32)
ERROR = np.full((5, 5), 0.01, np.float32)


def page(*dark: tuple[int, int]) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    values = np.full((5, 5), 0.6, np.float32)
    for place in dark:
        values[place] = 0.0
    return values


def test_a_dark_texel_takes_the_mean_of_its_lit_neighbours() -> None:
    values = page((2, 2))
    values[1, 1] = 0.2
    found = lit_rims(values, ERROR, CHART)
    assert abs(found[2, 2] - (7 * 0.6 + 0.2) / 8) < 1e-6
    assert np.array_equal(np.delete(found.ravel(), 12), np.delete(values.ravel(), 12))


def test_what_is_deep_inside_stays_dark() -> None:
    values = page(*[(row, column) for row in range(4) for column in range(4)])
    found = lit_rims(values, ERROR, CHART)
    assert found[0, 0] == 0.0
    assert found[3, 3] > 0.5


def test_another_chart_lends_nothing() -> None:
    chart = CHART.copy()
    chart[2, 2] = 1
    assert lit_rims(page((2, 2)), ERROR, chart)[2, 2] == 0.0


def test_a_gradient_into_the_dark_stays() -> None:
    values = np.full((5, 5), 0.03, np.float32)
    values[2, 2] = 0.0
    assert lit_rims(values, ERROR, CHART)[2, 2] == 0.0


def test_a_box_that_is_sunk_into_the_floor_has_no_black_outline() -> None:
    """Beside a wall of the box the floor is half open at the least; its corners are more so."""
    floor = patch((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    uv = (floor.vertices[:, :2] + 1.0) / 2.0
    below = Mesh(
        vertices=floor.vertices, faces=floor.faces, attributes={"TEXCOORD_0": Attribute(values=uv)}
    )
    sunk = box((-0.49, -0.49, -0.4), (0.49, 0.49, 0.4))
    scene = Scene(
        meshes=(below, mesh_of(sunk)),
        instances=(Instance(mesh=0), Instance(mesh=1)),
    )
    baked = bake_texture(scene, BakeSettings(size=64, rays=256, atlas="mesh", denoise="off"))
    along = np.linspace(-0.45, 0.45, 201)
    beside = np.stack([along, np.full(201, 0.493)], axis=1)
    assert sample(baked.images[0], (beside + 1.0) / 2.0).min() > 0.4

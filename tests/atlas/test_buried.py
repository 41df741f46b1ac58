"""Texels inside of something must not show as an outline around it."""

from __future__ import annotations

import numpy as np

from aobake import BakeSettings, Instance, Scene, bake_texture
from aobake.atlas.buried import lit_rims
from aobake.atlas.lookup import sample
from aobake.meshes.scene import Attribute, Mesh
from tests.scenes import box, mesh_of, patch

SIZE = 9
MIDDLE = SIZE // 2
CHART = np.zeros((SIZE, SIZE), np.int32)
ERROR = np.full((SIZE, SIZE), 0.01, np.float32)


def page(*dark: tuple[int, int]) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    values = np.full((SIZE, SIZE), 0.6, np.float32)
    for place in dark:
        values[place] = 0.0
    return values


def test_a_dark_texel_among_even_ones_takes_their_value() -> None:
    values = page((MIDDLE, MIDDLE))
    found = lit_rims(values, ERROR, CHART)
    assert abs(found[MIDDLE, MIDDLE] - 0.6) < 1e-6
    found[MIDDLE, MIDDLE] = 0.0
    assert np.array_equal(found, values)


def test_a_dark_texel_takes_what_its_lit_neighbours_lead_to() -> None:
    """A slope from the right: 0.6, 0.5, and then 0.4; whatever is on the left is dark as well."""
    values = page()
    values[:, : MIDDLE + 1] = 0.0
    values[:, MIDDLE + 1] = 0.5
    assert abs(lit_rims(values, ERROR, CHART)[MIDDLE, MIDDLE] - 0.4) < 1e-6


def test_a_corner_that_is_dark_at_last_stays_dark() -> None:
    """Few rays meet nothing there, and the step to the texel beside it is large; but the slope leads to 0."""
    values = np.tile(np.linspace(-1.6, 1.6, SIZE, dtype=np.float32).clip(0.0, 1.0), (SIZE, 1))
    assert values[MIDDLE, MIDDLE] == 0.0
    assert values[MIDDLE, MIDDLE + 1] == 0.4
    assert np.array_equal(lit_rims(values, ERROR, CHART), values)


def test_one_lit_texel_leads_nowhere() -> None:
    values = np.zeros((SIZE, SIZE), np.float32)
    values[MIDDLE, MIDDLE] = 0.6
    assert np.array_equal(lit_rims(values, ERROR, CHART), values)


def test_what_is_deep_inside_stays_dark() -> None:
    values = page(*[(row, column) for row in range(4) for column in range(4)])
    found = lit_rims(values, ERROR, CHART)
    assert found[0, 0] == 0.0
    assert found[3, 3] > 0.5


def test_another_chart_lends_nothing() -> None:
    chart = CHART.copy()
    chart[MIDDLE, MIDDLE] = 1
    assert lit_rims(page((MIDDLE, MIDDLE)), ERROR, chart)[MIDDLE, MIDDLE] == 0.0


def test_a_gradient_into_the_dark_stays() -> None:
    values = np.full((SIZE, SIZE), 0.03, np.float32)
    values[MIDDLE, MIDDLE] = 0.0
    assert lit_rims(values, ERROR, CHART)[MIDDLE, MIDDLE] == 0.0


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

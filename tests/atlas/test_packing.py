"""Packing: exact size, padding between any two charts, one density, and a refusal that names a cure."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray

from aobake.atlas.packing import Packed, pack
from aobake.atlas.unwrap import Charts, unwrap
from aobake.errors import InputError
from aobake.meshes.scene import FloatArray
from aobake.settings import AtlasSettings
from tests.scenes import Triangles, box, icosphere, joined, mesh_of, moved, patch, tube

SLACK = 1e-5  # texels: what rounding may push a corner over a line


def charts_of(shape: Triangles) -> Charts:
    return unwrap([mesh_of(shape)], AtlasSettings(), threads=2)[0]


def cards(count: int, seed: int = 3) -> Triangles:
    """Rectangles of many shapes, none of which touches another."""
    rng = np.random.default_rng(seed)
    sides = rng.uniform(0.2, 1.0, (count, 2))
    return joined(
        *(
            patch((3 * n, 0, 0), (3 * n + w, 0, 0), (3 * n + w, h, 0), (3 * n, h, 0))
            for n, (w, h) in enumerate(sides)
        )
    )


def touched(triangle: FloatArray, size: int) -> NDArray[np.bool_]:
    """(size, size) the texels, as closed squares, that a triangle (3, 2) in texels meets: separating axes."""
    y, x = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5, indexing="ij")
    met = np.ones((size, size), bool)
    sides = np.roll(triangle, -1, axis=0) - triangle
    across = (np.array([-s[1], s[0]]) / np.linalg.norm(s) for s in sides if s.any())
    for axis in [*np.eye(2), *across]:
        half = 0.5 * np.abs(axis).sum()
        along, own = x * axis[0] + y * axis[1], triangle @ axis
        met &= (along + half > own.min() + SLACK) & (along - half < own.max() - SLACK)
    return met


def chart_masks(placed: list[Charts], packed: Packed, size: int) -> list[NDArray[np.bool_]]:
    """The texels of each chart, by brute force."""
    masks = []
    for charts, uv in zip(placed, packed.uv, strict=True):
        corners = uv[charts.faces] * size
        for chart in range(int(charts.chart.max()) + 1):
            own = [touched(triangle, size) for triangle in corners[charts.chart == chart]]
            masks.append(np.logical_or.reduce(own))
    return masks


def apart(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> int:
    """Texels that lie between two sets of texels, along a row or a column."""
    a, b = np.argwhere(one), np.argwhere(other)
    return int(np.abs(a[:, None] - b[None]).max(axis=2).min()) - 1


@pytest.mark.parametrize(("size", "padding"), [(64, 0), (64, 3), (97, 4), (128, 9)])
def test_charts_are_padded_from_each_other_and_from_the_border(size: int, padding: int) -> None:
    placed = [charts_of(box()), charts_of(tube(0.3, 0.0, 1.0, 12)), charts_of(icosphere(1))]
    packed = pack([(c, 1.0) for c in placed], AtlasSettings(size=size, padding=padding))
    masks = chart_masks(placed, packed, size)
    gaps = [apart(a, b) for n, a in enumerate(masks) for b in masks[:n]]
    border = max((padding + 1) // 2, 1)
    inner = np.zeros((size, size), bool)
    inner[border : size - border, border : size - border] = True
    assert packed.padding == padding
    assert min(gaps) == padding
    assert not np.logical_or.reduce(masks)[~inner].any()
    assert packed.filled == pytest.approx(sum(int(m.sum()) for m in masks) / size**2, abs=1e-3)


def test_all_charts_have_the_same_texels_per_unit_and_keep_their_shape() -> None:
    shape = box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    charts, scales = charts_of(shape), (1.0, 0.5, 2.0)
    packed = pack([(charts, s) for s in scales], AtlasSettings(size=256, padding=2))
    p = shape.vertices[shape.faces]
    lengths = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2)
    for uv, scale in zip(packed.uv, scales, strict=True):
        q = uv[charts.faces] * 256
        u, v = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
        found = np.linalg.norm(np.roll(q, -1, axis=1) - q, axis=2)
        np.testing.assert_allclose(found, lengths * scale * packed.texels_per_unit, rtol=1e-5)
        assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0.0).all()


@pytest.mark.parametrize("size", [256, 1024, 2048])
def test_hundreds_of_charts_fill_an_image(size: int) -> None:
    charts = charts_of(cards(300))
    packed = pack([(charts, 1.0)], AtlasSettings(size=size))
    assert packed.filled > (0.4 if size == 256 else 0.5)
    assert packed.padding >= 1
    assert packed.uv[0].min() > 0.0
    assert packed.uv[0].max() < 1.0


def test_few_charts_get_padding_for_four_mip_levels() -> None:
    charts = charts_of(box())
    assert pack([(charts, 1.0)], AtlasSettings(size=1024)).padding == 32
    assert pack([(charts, 1.0)], AtlasSettings(size=256)).padding == 8


def test_charts_on_large_images_are_padded_as_well() -> None:
    """Beyond 2,048 texels charts stand on cells of several texels."""
    charts = charts_of(cards(6))
    packed = pack([(charts, 1.0)], AtlasSettings(size=4096, padding=30))
    corners = packed.uv[0][charts.faces] * 4096
    boxes = [
        (own.min(axis=(0, 1)), own.max(axis=(0, 1)))
        for own in (corners[charts.chart == n] for n in range(6))
    ]
    for n, (low, high) in enumerate(boxes):
        assert low.min() >= 15.0 - SLACK
        assert high.max() <= 4096.0 - 15.0 + SLACK
        for other_low, other_high in boxes[:n]:
            assert max((low - other_high).max(), (other_low - high).max()) >= 30.0 - SLACK


def test_the_texels_per_unit_asked_for_come_out() -> None:
    charts = charts_of(box())
    packed = pack([(charts, 2.0)], AtlasSettings(size=128, padding=2, texels_per_unit=10.0))
    q = packed.uv[0][charts.faces] * 128
    assert packed.texels_per_unit == 10.0
    assert np.ptp(q[charts.chart == 0].reshape(-1, 2), axis=0) == pytest.approx([20.0, 20.0])


@pytest.mark.parametrize("asked", [{"padding": 20}, {"padding": 3, "texels_per_unit": 40.0}])
def test_an_image_that_is_too_small_is_refused_with_the_smallest_that_is_not(
    asked: dict[str, float],
) -> None:
    charts = charts_of(box())
    with pytest.raises(InputError, match="too small") as error:
        pack([(charts, 1.0)], AtlasSettings(size=32, **asked))  # type: ignore[arg-type]
    message = str(error.value)
    needed = int(re.search(r"A size of (\d+)", message)[1])  # type: ignore[index]
    assert "\n" not in message
    assert pack([(charts, 1.0)], AtlasSettings(size=needed, **asked)).filled > 0.0  # type: ignore[arg-type]
    with pytest.raises(InputError, match="too small"):
        pack([(charts, 1.0)], AtlasSettings(size=needed - 1, **asked))  # type: ignore[arg-type]


def test_charts_thinner_than_a_texel_have_texels_of_their_own() -> None:
    strips = joined(
        *(
            moved(patch((0, 0, 0), (1, 0, 0), (1, 1e-4, 0), (0, 1e-4, 0)), 1.0, (0, n, 0))
            for n in range(5)
        )
    )
    charts = charts_of(strips)
    packed = pack([(charts, 1.0)], AtlasSettings(size=32, padding=2))
    masks = chart_masks([charts], packed, 32)
    assert all(mask.any() for mask in masks)
    assert min(apart(a, b) for n, a in enumerate(masks) for b in masks[:n]) >= 2


def test_the_same_charts_get_the_same_layout() -> None:
    charts, settings = charts_of(cards(40)), AtlasSettings(size=200, padding=2)
    one, other = pack([(charts, 1.0)], settings), pack([(charts, 1.0)], settings)
    scaled = pack([(charts, 1024.0)], settings)
    assert one.uv[0].tobytes() == other.uv[0].tobytes()
    np.testing.assert_allclose(scaled.uv[0], one.uv[0], atol=1e-9)


def test_nothing_to_place_gives_zeros() -> None:
    speck = Triangles(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))
    packed = pack([(charts_of(speck), 1.0)], AtlasSettings(size=16))
    assert (packed.uv[0] == 0.0).all()
    assert packed.filled == 0.0
    assert pack([], AtlasSettings()).uv == ()

"""Packing: the charts of all instances of an image, turned, scaled alike and set apart, on exactly its size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.charts import counted
from aobake.atlas.packing_kernels import hull_arena, page_arena, place_charts, set_upright
from aobake.atlas.unwrap import Charts
from aobake.errors import InputError
from aobake.meshes.scene import FloatArray, IntArray
from aobake.settings import MOST_TEXELS_PER_SIDE, AtlasSettings

__all__ = ["Packed", "pack"]

CELLS = (
    1024  # along a side: beyond twice as many texels, charts stand on every second one, and so on
)
MIP_PADDING = 32  # two texels of mip level 4: what a bilinear lookup on level 3 reads beyond
LEAST_FILLED = 0.4  # share of the image that charts should reach before the padding is halved
PACKABLE = 0.8  # share of an image that charts and their padding are expected to fill
CLOSE = 1.004  # the largest scale is found to within this factor


@dataclass(frozen=True, eq=False, kw_only=True)
class Packed:
    """Where charts lie on an image.

    uv : per instance, (V', 2) float64 in [0, 1], v down, of Charts.source; zeros for what has no place
    texels_per_unit : along a line, the same for all charts
    padding : texels between charts
    filled : share of the image's texels that charts touch
    """

    uv: tuple[FloatArray, ...]
    texels_per_unit: float
    padding: int
    filled: float


@dataclass(frozen=True, eq=False)
class _Outlines:
    """Charts ready to be placed.

    points : (P, 2) float64, upright, each chart's box at the origin
    triangles, starts : (T, 3) int32 corners; where the triangles of each chart begin (charts + 1,)
    extent : (charts, 2) float64, of the boxes
    area : (charts,) float64
    sequence : (charts,) int64, the large ones first
    of : (P,) int32, the chart of each point
    """

    points: FloatArray
    triangles: IntArray
    starts: NDArray[np.int64]
    extent: FloatArray
    area: FloatArray
    sequence: NDArray[np.int64]
    of: IntArray


@dataclass(frozen=True, eq=False)
class _Places:
    """places : (charts, 3) int32 column, row, quarter turns; scale : cells per unit; cells that are covered."""

    places: IntArray
    scale: float
    covered: int


def pack(placed: Sequence[tuple[Charts, float]], settings: AtlasSettings) -> Packed:
    """Put the charts of instances onto one image of settings.size by settings.size texels.

    placed : per instance, its mesh's charts and what its transform multiplies lengths by, on the whole
    Any two charts touch texels that are at least `padding` texels apart along a row or a column, and
    every chart stays half as far, at least one texel, from the border. All charts have the same texels
    per scene unit: settings.texels_per_unit, or as many as fit. Without settings.padding it is 32 (size /
    32 for smaller images), halved, down to 1, while charts would fill less than 0.4 of the image.
    Nothing to place gives zeros. The same input gives the same layout, bit for bit.
    Raises InputError where the image is too small, with a size that is not.
    """
    outlines = _outlines(placed)
    count = len(outlines.extent)
    if not count:
        uv = tuple(np.zeros((len(charts.source), 2)) for charts, _ in placed)
        return Packed(uv=uv, texels_per_unit=0.0, padding=settings.padding or 0, filled=0.0)
    padding = _padding(outlines, settings)
    found = _found(outlines, settings.size, padding, settings.texels_per_unit)
    if found is None:
        raise InputError(_too_small(outlines, settings, padding))
    cell = _cell(settings.size)
    return Packed(
        uv=_on_image(outlines, found, placed, settings.size),
        texels_per_unit=found.scale * cell,
        padding=padding,
        filled=found.covered * (cell / settings.size) ** 2,
    )


def _outlines(placed: Sequence[tuple[Charts, float]]) -> _Outlines:
    """The charts of all instances, upright, numbered one after the other."""
    points, triangles, triangle_of, of = [np.zeros((0, 2))], [], [], [np.zeros(0, np.int32)]
    count = first = 0
    for charts, scale in placed:
        used = charts.chart >= 0
        own = np.full(len(charts.source), -1, np.int32)
        own[charts.faces[used]] = charts.chart[used, None] + count
        points.append(charts.uv * scale)
        of.append(own)
        triangles.append(charts.faces[used] + first)
        triangle_of.append(charts.chart[used] + count)
        first += len(charts.source)
        count += int(charts.chart.max(initial=-1)) + 1
    owner = np.concatenate(of)
    at = np.concatenate(points)
    order = np.lexsort((at[:, 1], at[:, 0], owner))
    order = order[np.searchsorted(owner[order], 0) :]
    starts = np.searchsorted(owner[order], np.arange(count + 1))
    upright, extent = at[order], np.zeros((count, 2))
    set_upright(hull_arena(int(np.diff(starts).max(initial=0))), upright, starts, extent)
    at[order] = upright
    corners = np.concatenate([np.zeros((0, 3), np.int32), *triangles]).astype(np.int32)
    chart = np.concatenate([np.zeros(0, np.int32), *triangle_of])
    order = np.argsort(chart, kind="stable")
    corners = np.ascontiguousarray(corners[order])
    u, v = (at[corners[:, k]] - at[corners[:, 0]] for k in (1, 2))
    area = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    return _Outlines(
        points=at,
        triangles=corners,
        starts=np.searchsorted(chart[order], np.arange(count + 1)),
        extent=extent,
        area=np.bincount(chart[order], area, minlength=count).astype(np.float64),
        sequence=np.argsort(-extent.sum(axis=1), kind="stable"),
        of=owner,
    )


def _cell(size: int) -> int:
    """Texels along a side of a cell."""
    return max(size // CELLS, 1)


def _padding(outlines: _Outlines, settings: AtlasSettings) -> int:
    if settings.padding is not None:
        return settings.padding
    padding = min(MIP_PADDING, max(settings.size // 32, 1))
    while padding > 1:
        scale = settings.texels_per_unit or _expected_scale(outlines, settings.size, padding)
        if scale**2 * outlines.area.sum() >= LEAST_FILLED * settings.size**2:
            break
        padding //= 2
    return padding


def _expected_scale(outlines: _Outlines, size: int, padding: int) -> float:
    """Texels per unit at which charts and padding would fill what can be filled; 0 where none would.

    A chart that grows by half of the padding covers area s^2 + (width + height) s padding + padding^2.
    """
    a = float(outlines.area.sum())
    b = float(outlines.extent.sum()) * padding
    c = len(outlines.extent) * padding**2 - PACKABLE * size**2
    return 0.0 if c >= 0.0 else 2.0 * -c / (b + math.sqrt(b * b - 4.0 * a * c))


def _found(
    outlines: _Outlines, size: int, padding: int, texels_per_unit: float | None
) -> _Places | None:
    """The layout at a scale, or at the largest at which one is found; None where there is none."""
    if texels_per_unit is not None:
        return _placed(outlines, size, padding, texels_per_unit / _cell(size))
    expected = max(_expected_scale(outlines, size, padding), 1e-3 * size / outlines.extent.max())
    scale = expected / _cell(size)
    best = _placed(outlines, size, padding, scale)
    step = 1.03
    while best is None:
        if scale * outlines.extent.max() <= 1.0:
            return None
        scale, step = scale / step, min(step * 1.02, 2.0)
        best = _placed(outlines, size, padding, scale)
    too_large = scale * (step if scale < expected / _cell(size) else math.inf)
    while too_large > CLOSE * best.scale:
        scale = math.sqrt(best.scale * too_large) if too_large < math.inf else 1.03 * best.scale
        better = _placed(outlines, size, padding, scale)
        if better is None:
            too_large = scale
        else:
            best = better
    return best


def _placed(outlines: _Outlines, size: int, padding: int, scale: float) -> _Places | None:
    cell = _cell(size)
    border = max(padding // 2 + padding % 2, 1)
    page = (size // cell, -(-padding // cell), -(-border // cell))
    places: IntArray = np.zeros((len(outlines.extent), 3), np.int32)
    covered = place_charts(
        page_arena(page), outlines.points, outlines.triangles, outlines.starts, outlines.extent,
        outlines.sequence, scale, page, places,
    )  # fmt: skip
    return None if covered < 0 else _Places(places, scale, covered)


def _on_image(
    outlines: _Outlines, found: _Places, placed: Sequence[tuple[Charts, float]], size: int
) -> tuple[FloatArray, ...]:
    """Points where their charts were placed, per instance, as shares of the image."""
    extent = outlines.extent * found.scale
    box = np.maximum(np.ceil(extent - 1e-7), 1.0)
    shown = outlines.of >= 0
    of = outlines.of[shown]
    at = outlines.points[shown] * found.scale + 0.5 * (box - extent)[of]
    x, y, (w, h), turn = at[:, 0], at[:, 1], box[of].T, found.places[of, 2]
    turned = np.stack(
        [
            np.choose(turn, [x, h - y, w - x, y]),
            np.choose(turn, [y, x, h - y, w - x]),
        ],
        axis=1,
    )
    uv = np.zeros((len(outlines.of), 2))
    uv[shown] = (found.places[of, :2] + turned) * (_cell(size) / size)
    ends = np.cumsum([len(charts.source) for charts, _ in placed])[:-1]
    return tuple(np.split(uv, ends))


def _too_small(outlines: _Outlines, settings: AtlasSettings, padding: int) -> str:
    """What was found, and the smallest size at which it is not."""
    what = f"{counted(len(outlines.extent))} with padding {padding}" + (
        f" at {settings.texels_per_unit:g} texels per unit" if settings.texels_per_unit else ""
    )
    size = _smallest_size(outlines, settings, padding)
    if size > MOST_TEXELS_PER_SIDE:
        cure = "Ask for fewer texels per unit, less padding, or an image per mesh (--atlas mesh)."
    else:
        cure = f"A size of {size} is needed."
    return f"the image is too small: {settings.size} x {settings.size} texels for {what}. {cure}"


def _smallest_size(outlines: _Outlines, settings: AtlasSettings, padding: int) -> int:
    too_small, size = settings.size, 2 * settings.size
    while _found(outlines, size, padding, settings.texels_per_unit) is None:
        too_small, size = size, 2 * size
    while size - too_small > 1:
        middle = (too_small + size) // 2
        if _found(outlines, middle, padding, settings.texels_per_unit) is None:
            too_small = middle
        else:
            size = middle
    return size

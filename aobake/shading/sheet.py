"""Sheets: labelled pictures in a grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aobake.errors import SettingsError
from aobake.render_settings import RenderSettings, size_of

__all__ = ["Sheet", "check_room", "sheet"]

Float32Array = NDArray[np.float32]

PAPER, INK = (1.0, 1.0, 1.0), (0.13, 0.15, 0.18)
BEST_ASPECT = 1.3  # of a picture in a grid
GAP_SHARE, TEXT_SHARE = 0.012, 0.028  # of the sheet's height
SMALLEST_TEXT_PX, LARGEST_TEXT_PX = 10, 40
LEGIBLE_PX = 8  # what the text may shrink to where pictures are narrow
SMALLEST_CELL_PX = 16


@dataclass(frozen=True, eq=False, kw_only=True)
class Sheet:
    """A sheet that is being filled.

    pixels : (H, W, 3 or 4) float32 in [0, 1], as a display takes them
    corners : of each cell, its left and top pixel; cell : its width and height
    """

    pixels: Float32Array
    corners: Sequence[tuple[int, int]]
    cell: tuple[int, int]

    @property
    def cell_size(self) -> str:
        """The size of a picture, as settings have it."""
        return f"{self.cell[0]}x{self.cell[1]}"

    def filled(self, number: int, picture: Float32Array) -> Sheet:
        """The sheet with one picture put in."""
        left, top = self.corners[number]
        pixels = self.pixels.copy()
        pixels[top : top + self.cell[1], left : left + self.cell[0]] = picture
        return replace(self, pixels=pixels)


def sheet(settings: RenderSettings, labels: Sequence[str]) -> Sheet:
    """An empty sheet of the settings' size, labels drawn under where their pictures go, all of one size.

    The size has been looked at by check_room.
    """
    from aobake.images import text_size, with_text

    grid = _grid(settings, labels)
    width, height = grid.cell
    pixels = _paper(settings)
    ink = INK if pixels.shape[2] == 3 else (*INK, 1.0)
    corners = []
    for number, label in enumerate(labels):
        row, column = divmod(number, grid.columns)
        in_row = min(grid.columns, len(labels) - row * grid.columns)  # the last row is centred
        indent = (grid.columns - in_row) * (width + grid.gap) // 2
        left = grid.gap + column * (width + grid.gap) + indent
        top = grid.gap + row * (height + grid.gap + grid.line)
        corners.append((left, top))
        middle = left + (width - text_size(label, grid.text_px)[0]) // 2
        below = top + height + grid.gap // 2
        pixels = with_text(pixels, label, middle, below, grid.text_px, ink)
    return Sheet(pixels=pixels, corners=corners, cell=grid.cell)


def check_room(settings: RenderSettings, labels: Sequence[str]) -> None:
    """Raise SettingsError where pictures with these labels do not fit on a sheet of the settings' size."""
    grid = _grid(settings, labels)
    if min(grid.cell) < SMALLEST_CELL_PX or grid.text_px < LEGIBLE_PX:
        raise SettingsError(
            f"size is {settings.size!r}, too small for {len(labels)} pictures with labels that can be read; "
            "give a larger one."
        )


@dataclass(frozen=True)
class _Grid:
    """Where pictures go: how many side by side, between them, what a label takes, width and height.

    text_px : size of all labels, for the longest not to be wider than its picture
    """

    columns: int
    gap: int
    line: int
    cell: tuple[int, int]
    text_px: int


def _grid(settings: RenderSettings, labels: Sequence[str]) -> _Grid:
    """The grid whose pictures are nearest to the best aspect, of those whose labels can be read, if any."""
    grids = [_with_columns(settings, labels, columns) for columns in range(1, len(labels) + 1)]
    legible = [grid for grid in grids if grid.text_px >= LEGIBLE_PX]
    return min(legible or grids, key=lambda grid: _badness(grid, len(labels)))


def _with_columns(settings: RenderSettings, labels: Sequence[str], columns: int) -> _Grid:
    width, height = size_of(settings)
    gap = max(1, round(GAP_SHARE * height))
    wanted = round(min(LARGEST_TEXT_PX, max(SMALLEST_TEXT_PX, TEXT_SHARE * height)))
    rows = math.ceil(len(labels) / columns)
    cell = (width - gap) // columns - gap, (height - gap) // rows - gap - (wanted + gap)
    return _Grid(columns, gap, wanted + gap, cell, _fitting(labels, wanted, cell[0]))


def _badness(grid: _Grid, count: int) -> float:
    width, height = (max(1, side) for side in grid.cell)
    return abs(math.log(width / height / BEST_ASPECT)) + 0.02 * (-count % grid.columns)


def _paper(settings: RenderSettings) -> Float32Array:
    width, height = size_of(settings)
    if settings.background == "transparent":
        return np.zeros((height, width, 4), np.float32)
    return np.broadcast_to(np.array(PAPER, np.float32), (height, width, 3)).copy()


def _fitting(labels: Sequence[str], wanted_px: int, width: int) -> int:
    """The largest size, up to the wanted one, at which no label is wider than this; 0 for none."""
    from aobake.images import text_size

    longest = max(labels, key=lambda label: text_size(label, wanted_px)[0])
    return next((px for px in range(wanted_px, 0, -1) if text_size(longest, px)[0] <= width), 0)

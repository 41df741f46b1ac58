"""Gutters: what stands between the charts of a page, for the sake of its mip levels.

Each texel between the charts takes the value of the nearest texel of a chart, and the page is white where
none is near. So a texel of a mip level is free of other charts as long as it is no wider than half of the
padding: padding 16 keeps levels 1 to 3 free, and bilinear lookups on levels 0 to 2; 32 keeps one more of each.

Push-pull over the whole page (OpenImageIO's fillholes_pushpull) was tried: it lets all charts that meet in a
coarse level into the gutters of each. Between charts of random brightness with padding 16, on levels 1, 2, 3
and 4, the root mean square error of bilinear lookups at the rims of charts was 0.0004, 0.0021, 0.0080 and
0.034 with it, and is 0, 0, 0.0021 and 0.029 this way; and it took ten times as long and as much memory.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.page_kernels import nearest_above_or_below, nearest_texel

__all__ = ["REACH_PX", "fill_gutters", "nearest_covered"]

REACH_PX = 32  # a bilinear lookup on mip level 4, whose texels are 16 wide, reads less far than two of them
OPEN = np.float32(1.0)


def fill_gutters(
    values: NDArray[np.float32], covered: NDArray[np.bool_], reach_px: int = REACH_PX
) -> NDArray[np.float32]:
    """A page with its gutters filled, and white where no chart is near.

    values : (H, W) float32; covered : (H, W) bool, the texels of charts; there the values stay
    reach_px : how far from a chart its values go on, in texels
    Returns (H, W) float32; all 1 where nothing is covered.
    """
    nearest = nearest_covered(covered, reach_px)
    filled = values.reshape(-1)[nearest]
    filled[nearest < 0] = OPEN
    return filled


def nearest_covered(covered: NDArray[np.bool_], reach_px: int) -> NDArray[np.int32]:
    """(H, W) int32: row * W + column of the nearest covered texel; -1 where none is within reach_px.

    covered : (H, W) bool. A covered texel is its own nearest.
    """
    offset = np.empty(covered.shape, np.int16)
    nearest = np.empty(covered.shape, np.int32)
    nearest_above_or_below(covered, reach_px, offset)
    nearest_texel(offset, reach_px, nearest)
    return nearest

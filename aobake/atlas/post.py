"""What becomes of a traced page before it is an image: the rims of what is buried lit, denoised, an old texture
taken in, seams made equal, gutters filled.

In this order: a denoiser would spread what is buried; what is in an old texture is no noise; noise would be
taken for seams; and gutters repeat what the charts have at their rims.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.buried import lit_rims
from aobake.atlas.gutter import REACH_PX, fill_gutters, nearest_covered
from aobake.atlas.seams import Seams, equalised
from aobake.stages import timed

__all__ = ["TracedPage", "finished", "finished_bent"]

Float32Array = NDArray[np.float32]
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class TracedPage:
    """A page of texels as it was traced, or some rows of one.

    values : (H, W) float32 in [0, 1]; texels of charts that are not finite count as gutters
    error : (H, W) float32, the standard error of each
    chart : (H, W) int32, the chart of each texel, numbered from 0; -1: none
    normal : (H, W, 3) float32, unit length, which guides the denoiser; or None
    before : (H, W) float32, what an occlusion texture held, which is multiplied in; None: nothing is
    bent : (H, W, 3) float32, unit length, the mean open direction in the space asked for; or None
    """

    values: Float32Array
    error: Float32Array
    chart: NDArray[np.int32]
    normal: Float32Array | None
    before: Float32Array | None = None
    bent: Float32Array | None = None

    @classmethod
    def blank(
        cls,
        shape: tuple[int, int],
        *,
        normal: bool = False,
        before: bool = False,
        bent: bool = False,
    ) -> TracedPage:
        """Rows and columns without a chart, open and sure. normal, before, bent : whether these are kept."""
        return cls(
            values=np.ones(shape, np.float32),
            error=np.zeros(shape, np.float32),
            chart=np.full(shape, -1, np.int32),
            normal=np.zeros((*shape, 3), np.float32) if normal else None,
            before=np.ones(shape, np.float32) if before else None,
            bent=np.zeros((*shape, 3), np.float32) if bent else None,
        )

    def blank_like(self, shape: tuple[int, int]) -> TracedPage:
        """Other rows and columns of which the same is kept, without a chart."""
        return TracedPage.blank(
            shape,
            normal=self.normal is not None,
            before=self.before is not None,
            bent=self.bent is not None,
        )

    def put(self, rows: range, part: TracedPage) -> None:
        """Take in successive rows, which have what the page has."""
        for mine, given in (
            (self.values, part.values),
            (self.error, part.error),
            (self.chart, part.chart),
            (self.normal, part.normal),
            (self.before, part.before),
            (self.bent, part.bent),
        ):
            if mine is not None and given is not None:
                mine[rows.start : rows.stop] = given


def finished(
    page: TracedPage,
    seams: Seams,
    *,
    denoise: bool,
    threads: int | None = None,
    seconds: dict[str, float] | None = None,
) -> Float32Array:
    """The lightmap of a page: (H, W) float32 in [0, 1], finite everywhere, and white where no chart is near.

    denoise : whether Open Image Denoise smooths it; needs pyoidn
    threads : for the denoiser; None: one per processor. The result does not depend on it
    seconds : stage -> seconds ("denoise", "finish"), added to
    A page without charts is white. Raises EngineError where the denoiser is missing.
    """
    spent = {} if seconds is None else seconds
    covered = (page.chart >= 0) & np.isfinite(page.values)
    chart = np.where(covered, page.chart, np.int32(-1))
    values = np.clip(np.where(covered, page.values, np.float32(1.0)), 0.0, 1.0)
    error = np.nan_to_num(page.error, nan=0.0, posinf=1.0)
    with timed(spent, "finish"):
        values = lit_rims(values, error, chart)
    if denoise:
        from aobake.atlas.denoise import denoised

        with timed(spent, "denoise"):
            values = denoised(values, error, chart, page.normal, threads=threads)
    with timed(spent, "finish"):
        if page.before is not None:
            values = values * np.where(covered, page.before, np.float32(1.0))
        values = equalised(values, error, covered, seams)
        return fill_gutters(values, covered)


def finished_bent(page: TracedPage) -> Float32Array:
    """The bent normals of a page, with its gutters filled: (H, W, 3) float32, straight up where no chart is near.

    They are neither denoised nor made equal at seams, where the space of a normal map changes. Raises
    ValueError for a page without any.
    """
    if page.bent is None:
        raise ValueError("the page was traced without bent normals")
    nearest = nearest_covered(page.chart >= 0, REACH_PX)
    filled = page.bent.reshape(-1, 3)[nearest]
    filled[nearest < 0] = UP
    return filled

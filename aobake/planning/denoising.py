"""Whether a page is worth denoising, which its layout tells: each chart takes the denoiser a while of its own.

What was measured, at 64 rays a texel: how many more rays take as much of the error away, and how many have the
processor seconds of denoising, at 0.13 us each.

    asset                    house   hall   figure   truck   building   hall     scan   soft body   scan
    size                     192     192    192      192     192        512      192    192         512
    texels a chart           33      52     112      133     300        261      690    1,047       4,630
    error that is left       0.96    0.92   0.88     0.91    0.82       0.72     0.77   0.57        0.54
    rays that it saves       4       7      11       9       19         36       27     71          83
    rays that it costs       104     179    182      225     120        173      104    100         62

Small charts are rims above all, of which the denoiser sees one side, and each takes it milliseconds. Texels are
those covered, of all charts; what decides is the mean area of those that are not too small to be denoised at all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aobake.atlas.denoise import FEWEST_TEXELS
from aobake.atlas.layout import Layout
from aobake.planning.effect import Plan
from aobake.settings import BakeSettings

__all__ = ["LEAST_CHART", "denoised_where_it_pays", "texels_a_chart"]

LEAST_CHART = 400.0  # texels


def denoised_where_it_pays(plan: Plan, layout: Layout, settings: BakeSettings) -> Plan:
    """The plan as the layout changes it: with denoise "auto", small charts are left as they were traced."""
    effect = plan.effects["denoise"]
    if settings.denoise != "auto" or not effect.on:
        return plan
    texels = texels_a_chart(layout, settings.size)
    if texels >= LEAST_CHART:
        return plan
    reason = f"Charts have {texels:,.0f} texels in the mean: rays cost less than smoothing from {LEAST_CHART:.0f} down."
    return replace(
        plan, effects={**plan.effects, "denoise": replace(effect, on=False, reason=reason)}
    )


def texels_a_chart(layout: Layout, size: int) -> float:
    """The mean area of the charts of pages of size x size texels that are not too small to be denoised; 0 without."""
    areas: list[NDArray[np.float64]] = [np.zeros(0)]
    for page in layout.pages:
        for corners, charts in zip(page.corners, page.charts, strict=True):
            own = charts >= 0
            u, v = np.moveaxis(corners[own][:, 1:] - corners[own][:, :1], -1, 0)
            with np.errstate(all="ignore"):
                area = np.nan_to_num(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))
            _, chart = np.unique(charts[own], return_inverse=True)
            areas.append(np.bincount(chart, 0.5 * size**2 * area).astype(np.float64))
    counted = np.concatenate(areas)
    counted = counted[counted >= FEWEST_TEXELS]
    return float(counted.mean()) if len(counted) else 0.0

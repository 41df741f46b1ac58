"""What accuracy costs in time, measured on one asset: at its vertices, or in its texture."""

from __future__ import annotations

from aobake.study.curves import Curve, Level, Study, needed, pareto
from aobake.study.folder import kept_reference, outputs, write_study
from aobake.study.measure import Extent, measure, study_extent
from aobake.study.pictures import Picture, level_pictures
from aobake.study.plots import check_plots
from aobake.study.summary import summary
from aobake.study.texture_measure import TextureExtent, measure_texture, texture_extent

__all__ = [
    "Curve",
    "Extent",
    "Level",
    "Picture",
    "Study",
    "TextureExtent",
    "check_plots",
    "kept_reference",
    "level_pictures",
    "measure",
    "measure_texture",
    "needed",
    "outputs",
    "pareto",
    "study_extent",
    "summary",
    "texture_extent",
    "write_study",
]

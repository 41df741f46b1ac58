"""What accuracy costs in time, measured on one asset."""

from __future__ import annotations

from aobake.study.curves import Curve, Level, Study, needed, pareto
from aobake.study.folder import kept_reference, outputs, write_study
from aobake.study.measure import Extent, measure, study_extent
from aobake.study.page import summary
from aobake.study.pictures import level_pictures
from aobake.study.plots import check_plots

__all__ = [
    "Curve",
    "Extent",
    "Level",
    "Study",
    "check_plots",
    "kept_reference",
    "level_pictures",
    "measure",
    "needed",
    "outputs",
    "pareto",
    "study_extent",
    "summary",
    "write_study",
]

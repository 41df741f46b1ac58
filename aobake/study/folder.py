"""A study on disk: the reference that is kept between runs, and what is written at the end."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake import files
from aobake.study.curves import Curve, Level, Study, pareto
from aobake.study.page import page
from aobake.study.pictures import Picture
from aobake.study.plots import plots
from aobake.study.reference import Find, Kept
from aobake.study.summary import summary

__all__ = ["kept_reference", "outputs", "write_study"]

FloatArray = NDArray[np.float64]

NAMES = (
    "study.json",
    "study.csv",
    "index.html",
    *(
        f"{name}.{kind}"
        for name in ("error-rays", "error-time", "directions", "methods", "honesty")
        for kind in ("svg", "png")
    ),
)


def outputs(folder: Path) -> tuple[Path, ...]:
    """The files that a study writes, besides the reference that it keeps."""
    return tuple(folder / name for name in NAMES)


def kept_reference(folder: Path) -> Kept:
    """What gives a reference from the folder where it is kept there, and keeps it there else."""

    def reference(digest: str, find: Find) -> FloatArray:
        path = folder / f"reference-{digest[:16]}.npy"
        if path.is_file():
            try:
                found = np.load(path, allow_pickle=False)
            except (OSError, ValueError):  # damaged: made anew
                found = np.zeros(0)
            if found.dtype == np.float64 and found.ndim == 1 and len(found):
                return np.asarray(found)
        values = find()
        stream = io.BytesIO()
        np.save(stream, values)
        files.write_files({path: stream.getvalue()})
        return values

    return reference


def write_study(
    folder: Path, study: Study, pictures: Sequence[Sequence[Picture]]
) -> tuple[Path, ...]:
    """Write everything, the page last, and remove plots of an earlier study that this one does not draw.

    pictures : rows of them. Returns the files. Raises OutputError.
    """
    drawings = plots(study)
    content: dict[Path, bytes] = {
        folder / "study.json": _json(study).encode(),
        folder / "study.csv": _csv(study).encode(),
        **{folder / name: data for name, data in drawings.items()},
        folder / "index.html": page(study, drawings, pictures).encode(),
    }
    files.write_files(content)
    for path in outputs(folder):
        if path not in content:
            path.unlink(missing_ok=True)
    return tuple(content)


def _json(study: Study) -> str:
    data = {
        "asset": study.asset,
        "what": study.what,
        "points": study.points,
        "whole": study.whole,
        "reference_rays": study.reference_rays,
        "summary": list(summary(study)),
        "curves": [_curve(curve) for curve in study.curves],
        "surface": [_curve(curve) for curve in study.surface],
        "pareto": [[name, level.setting] for name, level in pareto(study.ways)],
        "facts": dict(study.facts),
    }
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


def _curve(curve: Curve) -> Mapping[str, object]:
    return {**dataclasses.asdict(curve), "slope": curve.slope}


def _csv(study: Study) -> str:
    stream = io.StringIO()
    fields = [field.name for field in dataclasses.fields(Level)]
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["curve", "kind", "denoised", *fields])
    for curve in (*study.curves, *study.surface):
        for level in curve.levels:
            values = [getattr(level, name) for name in fields]
            writer.writerow([curve.name, curve.kind, int(curve.denoised), *values])
    return stream.getvalue()

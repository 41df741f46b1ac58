"""A study on disk: the reference that is kept between runs, and what is written at the end."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake import files
from aobake.meshes.scene import Scene
from aobake.settings import BakeSettings, TraceSettings
from aobake.study.curves import Curve, Level, Study, pareto
from aobake.study.measure import Extent
from aobake.study.page import page, summary
from aobake.study.pictures import LevelPictures
from aobake.study.plots import plots

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
VARIED = ("rays", "tolerance", "tolerance_of", "quality", "max_rays", "seed", "threads", "strict")


def outputs(folder: Path) -> tuple[Path, ...]:
    """The files that a study writes, besides the reference that it keeps."""
    return tuple(folder / name for name in NAMES)


def kept_reference(
    folder: Path, scene: Scene, settings: BakeSettings, extent: Extent
) -> Callable[[Callable[[], FloatArray]], FloatArray]:
    """What gives the reference from the folder where it is kept there, and keeps it there else.

    It is known by a digest of the scene, the settings that matter, and how it was made.
    """
    path = folder / f"reference-{_digest(scene, settings, extent)[:16]}.npy"

    def reference(find: Callable[[], FloatArray]) -> FloatArray:
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


def _digest(scene: Scene, settings: BakeSettings, extent: Extent) -> str:
    told = hashlib.sha256()
    matters = {f.name for f in dataclasses.fields(TraceSettings)} - set(VARIED)
    values = {name: getattr(settings, name) for name in sorted(matters)}
    told.update(json.dumps([values, extent.points, extent.reference]).encode())
    for instance, mesh in scene.placed():
        told.update(np.ascontiguousarray(instance.transform).tobytes())
        for array in (mesh.vertices, mesh.faces, mesh.normals):
            told.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
        sided = mesh.material is not None and scene.materials[mesh.material].double_sided
        told.update(bytes([mesh.flat_shaded, sided]))
    return told.hexdigest()


def write_study(folder: Path, study: Study, pictures: Sequence[LevelPictures]) -> tuple[Path, ...]:
    """Write everything, the page last. Raises OutputError."""
    drawings = plots(study)
    content: dict[Path, bytes] = {
        folder / "study.json": _json(study).encode(),
        folder / "study.csv": _csv(study).encode(),
        **{folder / name: data for name, data in drawings.items()},
        folder / "index.html": page(study, drawings, pictures).encode(),
    }
    files.write_files(content)
    return tuple(content)


def _json(study: Study) -> str:
    curves = [_curve(curve) for curve in study.curves]
    ways = [curve for curve in study.curves if curve.kind != "directions"]
    data = {
        "asset": study.asset,
        "points": study.points,
        "vertices": study.vertices,
        "reference_rays": study.reference_rays,
        "summary": list(summary(study)),
        "curves": curves,
        "surface": [_curve(curve) for curve in study.surface],
        "pareto": [[name, level.setting] for name, level in pareto(ways)],
        "facts": dict(study.facts),
    }
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


def _curve(curve: Curve) -> Mapping[str, object]:
    return {**dataclasses.asdict(curve), "slope": curve.slope}


def _csv(study: Study) -> str:
    stream = io.StringIO()
    fields = [field.name for field in dataclasses.fields(Level)]
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["curve", "kind", *fields])
    for curve in (*study.curves, *study.surface):
        for level in curve.levels:
            writer.writerow([curve.name, curve.kind, *(getattr(level, name) for name in fields)])
    return stream.getvalue()

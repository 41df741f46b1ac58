"""What was done, as data and as JSON. The keys are explained in docs/report.md, and stay."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aobake import environment, files
from aobake.errors import InputError
from aobake.findings import Finding
from aobake.plan import Plan
from aobake.results import BakedTexture, BakedVertices
from aobake.settings import ImageSettings, StoreSettings

__all__ = [
    "SCHEMA",
    "ErrorSummary",
    "FileRecord",
    "Report",
    "ToleranceSummary",
    "digests",
    "of_bake",
]

Float32Array = NDArray[np.float32]

READING = ("scene", "pose", "root")
SCHEMA = 2  # grows when a key changes its meaning or goes; new keys do not change it


@dataclass(frozen=True, kw_only=True)
class FileRecord:
    """A file that was read or written: its path as given, and the digest of its content."""

    path: str
    sha256: str


@dataclass(frozen=True, kw_only=True)
class ErrorSummary:
    """The standard error over all points that were traced; None throughout where there were none."""

    rms: float | None
    p50: float | None
    p90: float | None
    p99: float | None
    max: float | None


@dataclass(frozen=True, kw_only=True)
class ToleranceSummary:
    """What came of a tolerance.

    reached, missed : points whose standard error is, or is not, within it
    rays_saved : against the fixed number of rays that gives the same root mean square error, by the law of
        the standard error; negative where a fixed number would have done with fewer; None: not known
    """

    asked: float
    of: str
    reached: int
    missed: int
    rays_saved: int | None


@dataclass(frozen=True, kw_only=True)
class Report:
    """One bake.

    findings : what was passed over, mended or is in doubt; warnings : the same and more, for people

    settings : of the bake and of how it is stored; settings_files : those that some came from
    reading : how the asset was read: "scene", "pose" and "root", each None where it was left out
    layout : of a texture, one sentence for each image on where its texture coordinates come from
    points : vertices or texels that were given a value
    ao_mean : their mean, or None where there are none
    seconds : stage -> seconds; rays : rays traced; mrays_per_s : million rays per second of tracing
    """

    schema: int
    version: str
    command: str
    inputs: tuple[FileRecord, ...]
    outputs: tuple[FileRecord, ...]
    settings: Mapping[str, object]
    settings_files: tuple[str, ...]
    reading: Mapping[str, str | None]
    plan: Plan
    layout: tuple[str, ...]
    instances: int
    triangles: int
    points: int
    ao_mean: float | None
    seconds: Mapping[str, float]
    rays: int
    mrays_per_s: float | None
    error: ErrorSummary
    tolerance: ToleranceSummary | None
    findings: tuple[Finding, ...]
    warnings: tuple[str, ...]
    versions: Mapping[str, str]
    machine: str
    processors: int

    def to_json(self) -> str:
        """The report as JSON, keys in the order of the fields, ending with a line break."""
        data = dataclasses.asdict(dataclasses.replace(self, plan=Plan(dict(self.plan.effects))))
        data["seconds"] = {stage: round(spent, 6) for stage, spent in self.seconds.items()}
        return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def write(self, path: Path) -> None:
        """Write the JSON to a file that appears whole or not at all. Raises OutputError."""
        files.write_files({path: self.to_json().encode("utf-8", "backslashreplace")})


def of_bake(  # noqa: PLR0913 - what is to be said, part by part
    baked: BakedVertices | BakedTexture,
    *,
    command: str,
    inputs: Sequence[FileRecord],
    outputs: Sequence[FileRecord],
    store: StoreSettings | ImageSettings,
    settings_files: Sequence[Path] = (),
    reading: Mapping[str, object] | None = None,
    seconds: Mapping[str, float] | None = None,
    warnings: Sequence[str] = (),
) -> Report:
    """The report of a bake.

    seconds : stages that the bake itself knows nothing of, such as 'read' and 'write'
    warnings : what to say besides the bake's own warnings and the scene's
    """
    values, errors = _values(baked)
    all_seconds = dict(baked.seconds) | dict(seconds or {})
    traced_s = all_seconds.get("trace", 0.0)
    here = environment.versions()
    return Report(
        schema=SCHEMA,
        version=here["aobake"],
        command=command,
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        settings=dataclasses.asdict(baked.settings) | dataclasses.asdict(store),
        settings_files=tuple(map(str, settings_files)),
        reading=_words(dict.fromkeys(READING) | dict(reading or {})),
        plan=baked.plan,
        layout=baked.layout if isinstance(baked, BakedTexture) else (),
        instances=len(baked.scene.instances),
        triangles=baked.scene.triangles,
        points=len(values),
        ao_mean=float(values.mean(dtype=np.float64)) if len(values) else None,
        seconds={stage: all_seconds[stage] for stage in _in_order(all_seconds)},
        rays=baked.rays,
        mrays_per_s=baked.rays / traced_s / 1e6 if traced_s > 0.0 else None,
        error=error_summary(errors),
        tolerance=_tolerance_summary(baked, errors),
        findings=baked.findings,
        warnings=_each_once(
            baked.scene.warnings, baked.warnings, warnings, environment.cache_warnings()
        ),
        versions=here,
        machine=environment.machine(),
        processors=environment.processors(),
    )


def _each_once(*lines: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(line for some in lines for line in some))


def _words(values: Mapping[str, object]) -> dict[str, str | None]:
    return {name: None if value is None else str(value) for name, value in values.items()}


def _values(baked: BakedVertices | BakedTexture) -> tuple[Float32Array, Float32Array]:
    """All values, and the standard errors of all that were traced: vertices, or covered texels."""
    if isinstance(baked, BakedVertices):
        return _joined(baked.ao), _joined(baked.standard_error)
    shown = [image[on] for image, on in zip(baked.images, baked.coverages, strict=True)]
    return _joined(shown), _joined([error.reshape(-1) for error in baked.standard_errors])


def error_summary(standard_error: NDArray[np.float32]) -> ErrorSummary:
    """Root mean square, median, 99th percentile and maximum over the points that were traced.

    standard_error : (P,) float32; 0 marks a point where nothing was estimated
    """
    traced = standard_error[standard_error > 0.0].astype(np.float64)
    if not len(traced):
        return ErrorSummary(rms=None, p50=None, p90=None, p99=None, max=None)
    p50, p90, p99 = (float(p) for p in np.percentile(traced, (50, 90, 99)))
    rms = float(np.sqrt(np.mean(traced**2)))
    return ErrorSummary(rms=rms, p50=p50, p90=p90, p99=p99, max=float(traced.max()))


def _tolerance_summary(
    baked: BakedVertices | BakedTexture, standard_error: Float32Array
) -> ToleranceSummary | None:
    """None where no tolerance was asked for."""
    settings = baked.settings
    if settings.tolerance is None:
        return None
    traced = standard_error[standard_error > 0.0]
    within = int((traced <= settings.tolerance * (1.0 + 1e-6)).sum())
    fixed = baked.fixed_rays if isinstance(baked, BakedVertices) else None
    return ToleranceSummary(
        asked=settings.tolerance,
        of=settings.tolerance_of,
        reached=within,
        missed=len(traced) - within,
        rays_saved=None if fixed is None else fixed - baked.rays,
    )


def digests(paths: Sequence[Path]) -> tuple[FileRecord, ...]:
    """A record of each file. Raises InputError where one cannot be read."""
    records = []
    for path in paths:
        try:
            records.append(FileRecord(path=str(path), sha256=files.sha256(path)))
        except OSError as error:
            raise InputError(f"{path}: it cannot be read ({error.strerror or error}).") from error
    return tuple(records)


def _joined(arrays: Sequence[Float32Array]) -> Float32Array:
    return np.concatenate(arrays) if arrays else np.empty(0, np.float32)


def _in_order(seconds: Mapping[str, float]) -> list[str]:
    known = [
        "read", "prepare", "unwrap", "build", "compile", "texels", "trace", "denoise", "finish", "write",
    ]  # fmt: skip
    return [stage for stage in known if stage in seconds] + [s for s in seconds if s not in known]

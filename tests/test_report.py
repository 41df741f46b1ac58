"""The report: the keys that are relied on, numbers that are right, JSON that is valid."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from aobake import BakedVertices, BakeSettings, InputError, Scene, StoreSettings, plan
from aobake.report import Report, digests, error_summary, of_bake


def baked(standard_error: list[float], *, seconds: float = 2.0) -> BakedVertices:
    count = max(3, len(standard_error))
    vertices = np.eye(3)[np.arange(count) % 3]
    scene = Scene.from_arrays(vertices, [[0, 1, 2]])
    settings = BakeSettings(rays=64)
    error = np.array(standard_error + [0.0] * (count - len(standard_error)), np.float32)
    return BakedVertices(
        scene=scene,
        settings=settings,
        plan=plan(scene, settings),
        ao=[np.full(count, 0.25, np.float32)],
        standard_error=[error],
        rays=5_000_000,
        seconds={"trace": seconds, "prepare": 0.5},
        findings=(),
        warnings=("a vertex is odd.",),
    )


def reported(work: BakedVertices) -> Report:
    return of_bake(
        work, command="vertex", inputs=(), outputs=(), store=StoreSettings(), warnings=("late.",)
    )


def test_the_keys_that_others_rely_on_are_there() -> None:
    data = json.loads(reported(baked([0.01, 0.02, 0.03])).to_json())
    relied_on = {"version", "inputs", "outputs", "settings", "plan", "seconds", "rays"}
    assert relied_on | {"mrays_per_s", "error", "warnings", "schema"} <= data.keys()
    assert data["settings"]["rays"] == 64
    assert data["settings"]["store"] == "color"
    assert data["plan"]["effects"]["occlusion"]["on"] is True
    assert data["warnings"] == ["a vertex is odd.", "late."]


def test_the_rate_is_rays_over_the_seconds_of_tracing() -> None:
    assert reported(baked([0.01], seconds=2.0)).mrays_per_s == pytest.approx(2.5)
    assert reported(baked([0.01], seconds=0.0)).mrays_per_s is None


def test_stages_come_in_the_order_in_which_they_happen() -> None:
    done = of_bake(
        baked([0.1]),
        command="vertex",
        inputs=(),
        outputs=(),
        store=StoreSettings(),
        seconds={"write": 1.0, "read": 2.0},
    )
    assert list(done.seconds) == ["read", "prepare", "trace", "write"]


def test_points_where_nothing_was_estimated_do_not_flatter_the_error() -> None:
    summary = error_summary(np.array([0.3, 0.4, 0.0, 0.0], np.float32))
    assert summary.rms == pytest.approx(np.sqrt(0.125))
    assert summary.p50 == pytest.approx(0.35)
    assert summary.max == pytest.approx(0.4)


def test_an_asset_without_points_has_no_error_rather_than_nan() -> None:
    summary = error_summary(np.empty(0, np.float32))
    assert (summary.rms, summary.p50, summary.p99, summary.max) == (None, None, None, None)
    json.loads(reported(baked([])).to_json())


def test_digests_are_those_of_the_files(tmp_path: Path) -> None:
    path = tmp_path / "é.bin"
    path.write_bytes(b"123")
    (record,) = digests([path])
    assert record.sha256 == hashlib.sha256(b"123").hexdigest()
    assert record.path == str(path)
    with pytest.raises(InputError, match=r"gone\.bin"):
        digests([tmp_path / "gone.bin"])


def test_a_report_is_written_whole_and_in_utf8(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    done = reported(baked([0.01]))
    done.write(path)
    assert path.read_bytes().decode("utf-8") == done.to_json()
    assert path.read_text(encoding="utf-8").endswith("}\n")

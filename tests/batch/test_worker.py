"""One task in a worker: the outcome tells all, in the batch's own names, and the file is that of a single bake."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from aobake import files
from aobake.batch import pictures
from aobake.batch.processes import LocalExecutor
from aobake.batch.tasks import Task
from aobake.batch.worker import work
from aobake.config import Configured
from aobake.jobs import Job, run_job
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

CHOSEN = Configured(bake=BakeSettings(rays=16), store=StoreSettings(), image=ImageSettings())


def task(asset: Path, output: Path, *, threads: int = 1) -> Task:
    job = Job(command="vertex", input=asset, output=output, chosen=CHOSEN, force=True)
    return Task(
        number=7,
        job=job,
        threads=threads,
        pictures="thumbnails",
        source=asset.parent,
        target=output.parents[1],
    )


def test_a_process_bakes_what_a_single_bake_does(corner: Path, tmp_path: Path) -> None:
    alone, made = tmp_path / "alone.glb", tmp_path / "out" / "deep" / "corner.glb"
    run_job(Job(command="vertex", input=corner, output=alone, chosen=CHOSEN))
    with LocalExecutor(processes=1, threads=2) as executor:
        executor.start(task(corner, made, threads=2))
        (outcome,) = executor.finished(60.0)
    assert (outcome.number, outcome.status, outcome.reason) == (7, "done", "")
    assert made.read_bytes() == alone.read_bytes()
    assert outcome.inputs == (("corner.obj", files.sha256(corner)),)
    assert outcome.outputs == (("deep/corner.glb", files.sha256(made)),)
    assert set(outcome.pictures) == {"before", "after"}
    assert outcome.seconds > 0.0
    assert outcome.report is not None
    assert json.loads(json.dumps(outcome.report)) == outcome.report


def test_the_report_has_the_threads_that_were_asked_for(corner: Path, tmp_path: Path) -> None:
    outcome = work(task(corner, tmp_path / "out" / "deep" / "corner.glb", threads=1))
    assert outcome.report is not None
    settings = outcome.report["settings"]
    assert isinstance(settings, dict)
    assert settings["threads"] is None


def test_names_outside_of_the_folders_are_paths(corner: Path, tmp_path: Path) -> None:
    job = Job(command="vertex", input=corner, output=tmp_path / "corner.glb", chosen=CHOSEN)
    outcome = work(Task(number=0, job=job, threads=1, source=tmp_path / "elsewhere"))
    assert [name for name, _ in outcome.inputs + outcome.outputs] == [str(corner), str(job.output)]


def test_what_an_asset_refers_to_and_is_not_there_is_told(corner: Path, tmp_path: Path) -> None:
    """It is to be baked again once that appears; what lies outside of its folder is never read."""
    words = "mtllib here.mtl\nmtllib gone.mtl\nmtllib ../outside.mtl\n"
    corner.write_text(words + corner.read_text(encoding="ascii"), encoding="ascii")
    (tmp_path / "here.mtl").write_text("newmtl a\nmap_Kd wood.png\n", encoding="ascii")
    outcome = work(task(corner, tmp_path / "out" / "deep" / "corner.glb"))
    there = {name: sha256 != "" for name, sha256 in outcome.inputs}
    assert there == {"corner.obj": True, "here.mtl": True, "gone.mtl": False, "wood.png": False}


def test_a_picture_that_fails_is_a_warning(
    corner: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> dict[str, bytes]:
        raise ZeroDivisionError("no view")

    monkeypatch.setattr(pictures, "pictures_of", broken)
    outcome = work(task(corner, tmp_path / "out" / "deep" / "corner.glb"))
    assert (outcome.status, dict(outcome.pictures)) == ("done", {})
    assert outcome.report is not None
    warnings = outcome.report["warnings"]
    assert isinstance(warnings, list)
    assert any("no pictures were made" in warning and "no view" in warning for warning in warnings)


def test_what_aobake_refuses_is_told_in_its_own_line(tmp_path: Path) -> None:
    asset = tmp_path / "broken.glb"
    asset.write_bytes(b"glTF")
    outcome = work(task(asset, tmp_path / "out" / "deep" / "broken.glb"))
    assert outcome.status == "failed"
    assert outcome.reason.startswith(f"{asset}: ")
    assert outcome.report is None
    assert not list((tmp_path / "out" / "deep").iterdir())


def test_a_folder_that_cannot_be_made_is_told(corner: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_bytes(b"a file is in the way")
    outcome = work(task(corner, tmp_path / "out" / "deep" / "corner.glb"))
    assert outcome.status == "failed"
    assert outcome.reason.startswith(f"{tmp_path}/out/deep/corner.glb: its folder ")
    assert "cannot be made" in outcome.reason

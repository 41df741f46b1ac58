"""The command line of a job: read again, it is the same job."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, assume, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from aobake import SettingsError
from aobake.cli import main
from aobake.config import Command, configured
from aobake.flags import changed_settings, command_line
from aobake.jobs import Job, Reading

WORDS = st.lists(st.sampled_from(["wall*", "-x", "a b", "none", "é", "all"]), max_size=3)
NUMBERS = st.floats(0.001, 1e6)
TRACE = {
    "rays": st.integers(1, 5000),
    "tolerance": st.one_of(st.floats(0.001, 0.5), st.just("rms:0.01")),
    "quality": st.sampled_from(["draft", "final"]),
    "seed": st.integers(0, 2**64 - 1),
    "threads": st.integers(1, 8),
    "max_distance": st.one_of(NUMBERS, st.just("5%")),
    "ground": st.sampled_from(["+y", "+z"]),
    "spread": st.floats(1.0, 180.0),
    "occluders": WORDS.filter(bool),
    "exclude": WORDS,
    "bent_normals": st.booleans(),
    "effect": st.just(["open_sky=off"]),
    "strict": st.booleans(),
}
VERTEX = {"store": st.sampled_from(["color", "occlusion"]), "method": st.just("auto")}
TEXTURE = {
    "uv": st.sampled_from(["keep", "2"]),
    "size": st.integers(1, 4096),
    "padding": st.integers(0, 9),
    "normal_map": st.booleans(),
    "encoding": st.sampled_from(["8", "half"]),
    "pack": st.just("orm"),
}


def given_to(**known: st.SearchStrategy[object]) -> st.SearchStrategy[Mapping[str, object]]:
    return st.fixed_dictionaries({}, optional=known)


@pytest.fixture
def job(tmp_path: Path) -> Job:
    (tmp_path / "a b.glb").touch()
    return Job(
        command="vertex",
        input=tmp_path / "a b.glb",
        output=tmp_path / "out'put.glb",
        chosen=configured(None),
        force=True,
    )


def understood(line: list[str], monkeypatch: pytest.MonkeyPatch) -> Job:
    """The job that a command line is taken for."""
    seen: list[Job] = []
    with monkeypatch.context() as patched:
        patched.setattr("signal.signal", lambda *_: None)
        patched.setattr("aobake.cli.work._do", lambda job, _common: seen.append(job))
        assert line[0] == "aobake"
        assert main(shlex.split(shlex.join(line))[1:]) == 0
    return seen[0]


@pytest.mark.parametrize("command", ["vertex", "texture"])
@hypothesis_settings(
    max_examples=20,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_a_command_line_says_all_settings_of_the_job(
    data: st.DataObject, command: Command, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = VERTEX if command == "vertex" else TEXTURE
    try:
        chosen = configured(None, data.draw(given_to(**TRACE, **own)))
    except SettingsError:
        assume(False)
    work = replace(job, command=command, chosen=chosen)
    assert understood(command_line(work), monkeypatch) == work


def test_an_aobake_toml_does_not_change_what_a_command_line_means(
    job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    job.input.with_name("aobake.toml").write_text("rays = 3\nstrict = true\n", encoding="utf-8")
    assert understood(command_line(job), monkeypatch) == job


def test_it_says_how_the_asset_is_read(job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    read = replace(job, reading=Reading(scene="2", pose="Walk@0.5", root=job.input.parent))
    assert understood(command_line(read), monkeypatch) == read


def test_threads_may_be_given_by_who_runs_it(job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    own = replace(job, chosen=configured(None, {"threads": 5}))
    assert understood(command_line(own), monkeypatch).chosen.bake.threads == 5
    assert understood(command_line(own, 2), monkeypatch).chosen.bake.threads == 2
    assert command_line(own, 2).count("--threads=2") == 1


def test_settings_that_are_the_defaults_or_of_no_account_are_left_out(job: Job) -> None:
    assert changed_settings(job) == []
    chosen = configured(None, {"size": 64, "rays": 16, "max_distance": 2.0})
    assert changed_settings(replace(job, chosen=chosen)) == ["--rays=16", "--max-distance=2.0"]

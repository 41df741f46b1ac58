"""One batch at a time: real processes that want the same lock, are killed with it, or sit on other machines."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

import pytest

from aobake.batch import lock
from aobake.batch.leftovers import remove_leftovers
from aobake.batch.lock import STALE_S, Owner, hold
from aobake.errors import OutputError
from tests.support import ROOT

HOLDER = """
import sys
from pathlib import Path
from aobake.batch.lock import hold
with hold(Path(sys.argv[1]), command="aobake batch in -o out"):
    print("held", flush=True)
    sys.stdin.read()
"""

RACER = """
import sys, time
from pathlib import Path
from aobake.batch.lock import hold
from aobake.errors import OutputError
folder = Path(sys.argv[1])
sys.stdin.readline()
entered = 0
while entered < 10:
    try:
        with hold(folder / "lock", command="race"):
            with open(folder / "inside", "x"):
                pass
            time.sleep(0.001)
            (folder / "inside").unlink()
            entered += 1
    except OutputError:
        time.sleep(0.001)
"""


def started(code: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


def said(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def test_the_second_is_refused_and_told_who_is_first_until_that_ends(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with started(HOLDER, str(path)) as first:
        assert said(first) == "held"
        with pytest.raises(OutputError) as refusal, hold(path, command="second"):
            pass
        assert str(refusal.value).startswith(
            f"{path}: another batch is at work there: process {first.pid} on "
        )
        assert "(aobake batch in -o out), since " in str(refusal.value)
        assert "\n" not in str(refusal.value)
        first.communicate("")
    with hold(path, command="second"):
        pass


def test_a_lock_whose_owner_was_killed_is_free(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with started(HOLDER, str(path)) as first:
        assert said(first) == "held"
        first.kill()
    assert b"aobake batch in -o out" in path.read_bytes()
    with hold(path, command="second") as owner:
        assert Owner(**json.loads(path.read_text())) == owner
    assert path.read_bytes() == b""


def test_of_many_processes_one_at_a_time_is_inside(tmp_path: Path) -> None:
    racers = [started(RACER, str(tmp_path)) for _ in range(3)]
    for racer in racers:
        assert racer.stdin is not None
        racer.stdin.write("\n")
        racer.stdin.flush()
    for racer in racers:
        racer.communicate(timeout=60)
        assert racer.returncode == 0  # open(..., "x") would have failed where two were inside


def test_the_lock_is_given_back_when_the_work_fails(tmp_path: Path) -> None:
    with pytest.raises(KeyError), hold(tmp_path / "lock", command="x"):
        raise KeyError
    with hold(tmp_path / "lock", command="x"):
        pass


def foreign(
    path: Path, *, host: str, process: int = 1, begun: str = "", age_s: float = 0.0
) -> None:
    """A lock file as another process would have left it, last touched some seconds ago."""
    owner = Owner(process=process, host=host, started=begun, command="nightly\nbake", since="then")
    path.write_text(json.dumps(asdict(owner)))
    os.utime(path, (time.time() - age_s,) * 2)


def test_an_owner_on_another_machine_counts_as_long_as_it_shows_signs_of_life(
    tmp_path: Path,
) -> None:
    path = tmp_path / "lock"
    foreign(path, host="another", age_s=60.0)
    before = path.read_bytes()
    said = pytest.raises(OutputError, match=r"process 1 on another .*remove .*lock")
    with said as refusal, hold(path, command="x"):
        pass
    assert "\n" not in str(refusal.value)
    assert path.read_bytes() == before
    foreign(path, host="another", age_s=STALE_S + 60.0)
    with hold(path, command="x"):
        pass


def without_locks(handle: int, operation: int) -> None:
    raise OSError(errno.ENOLCK, "No locks available")


@pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="the start of a process is read from /proc"
)
@pytest.mark.parametrize("who", ["lives", "is gone", "has another start", "has no start"])
def test_where_the_system_has_no_locks_the_process_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, who: str
) -> None:
    import fcntl
    import platform

    monkeypatch.setattr(fcntl, "flock", without_locks)
    path = tmp_path / "lock"
    with started(HOLDER, str(tmp_path / "its own lock")) as process:
        assert said(process) == "held"
        begun = lock._started(process.pid)
        assert begun
        if who == "is gone":
            process.kill()
            process.wait(60)
        given = {"has another start": "boot/1", "has no start": ""}.get(who, begun)
        foreign(path, host=platform.node(), process=process.pid, begun=given)
        if who == "lives":
            with pytest.raises(OutputError, match=str(process.pid)), hold(path, command="x"):
                pass
        else:
            with hold(path, command="x"):
                pass
        process.kill()


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"process": 1}', b"\xff\xfe"])
def test_a_lock_file_without_a_readable_owner_is_free(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "lock").write_bytes(content)
    with hold(tmp_path / "lock", command="x"):
        pass


def test_the_owner_shows_signs_of_life_but_not_in_the_name_of_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lock, "BEAT_S", 0.01)
    path = tmp_path / "lock"
    with hold(path, command="x"):
        os.utime(path, (1, 1))
        until = time.monotonic() + 60.0
        while path.stat().st_mtime < 2.0:
            assert time.monotonic() < until
            time.sleep(0.01)
        foreign(path, host="another")
        taken = path.read_bytes()
    assert path.read_bytes() == taken


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match="nowhere"),
        hold(tmp_path / "nowhere" / "lock", command="x"),
    ):
        pass


def test_what_a_killed_run_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    leftovers = [".aobake-abc_1234.part", "props/.aobake-0a1b2c3d-q_rstuvw.part"]
    others = [
        ".aobake-abc_1234.glb", "aobake-abc_1234.part", ".aobake-.part", ".aobake-notes of mine.part",
        "props/x.part", ".aobake/batch.sqlite", "elsewhere.part",
    ]  # fmt: skip
    for name in (*leftovers, *others):
        (tmp_path / "out" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "out" / name).write_bytes(b"x")
    (tmp_path / "other").mkdir()
    outside = tmp_path / "other" / ".aobake-abc_1234.part"
    outside.write_bytes(b"x")
    (tmp_path / "out" / "linked").symlink_to(tmp_path / "other", target_is_directory=True)
    link = tmp_path / "out" / ".aobake-link1234.part"
    link.symlink_to(outside)
    (tmp_path / "out" / ".aobake-folder12.part").mkdir()
    assert remove_leftovers(tmp_path / "out") == tuple(sorted(leftovers))
    assert all((tmp_path / "out" / name).exists() for name in (*others, ".aobake-folder12.part"))
    assert outside.exists()
    assert link.is_symlink()
    assert remove_leftovers(tmp_path / "nowhere") == ()

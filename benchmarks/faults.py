"""What faults do to a batch: kills, full disks, folders that cannot be written, signals, rivals, changes, clocks.

    python benchmarks faults [--quick]

Each fault is done to a batch of its own; then it is gone, and the batch is run again. Lost: outputs of an undisturbed
run that are not there in the end. Half-written: files with other bytes than there, or unfinished ones that are
left at the end. Twice: bakes that were done more than once. The same: every file, and the state of every
asset, is as after an undisturbed run.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from drill import AHEAD, LIGHT, Drill, Left, assets, until
from tables import Cell, Skipped, Table

__all__ = ["Fault", "faults", "run", "suffered"]

ASSETS, QUICK_ASSETS = 200, 25
EARLY = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"  # an asset as it was, and as it is then
LATE = b"v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n"
DAY_S = 86400.0

Whole = Mapping[str, Collection[str]]


@dataclass(frozen=True)
class Fault:
    """Something that happens to a batch. happens : does it, and says in a few words what the batch made of it

    again : what the batch is given in addition, before and after
    """

    name: str
    happens: Callable[[Drill, ExitStack], str]
    again: Callable[[Drill], Sequence[object]] = lambda _: ()


def suffered(fault: Fault, drill: Drill, expected: Left, whole: Whole) -> list[Cell]:
    """A row: what the fault did, and what was left of that when it was gone and the batch was run again.

    expected : what an undisturbed run leaves     whole : the digests that a file may have
    """
    shutil.rmtree(drill.target, ignore_errors=True)
    drill.target.mkdir()
    drill.log.unlink(missing_ok=True)
    drill = replace(drill, arguments=(*drill.arguments, *fault.again(drill)))
    with ExitStack() as undo:
        told = fault.happens(drill, undo)
        before = drill.left()
        drill.run()
        after = drill.left()
    lost = len(expected.written.keys() - after.written.keys())
    torn = [name for name, digest in before.written.items() if digest not in whole.get(name, ())]
    same = "yes" if not (wrong := _differences(after, expected)) else f"NO: {wrong}"
    return [fault.name, told, lost, len(torn) + len(after.parts), drill.twice(), same]


def _differences(found: Left, expected: Left) -> str:
    """What is not as it should be, in a few words; '' for nothing."""
    names = found.written.keys() | expected.written.keys()
    files = sum(found.written.get(name) != expected.written.get(name) for name in names)
    states = found.states.items() - expected.states.items()
    return ", ".join([*([f"{files} files"] if files else []), *map(" ".join, sorted(states))])


def killed(share: float) -> Callable[[Drill, ExitStack], str]:
    """kill -9 of the parent once a share of all assets is baked."""

    def happens(drill: Drill, _: ExitStack) -> str:
        process = drill.start()
        found = until(lambda: drill.outputs() > share * _size(drill), process)
        process.kill()
        process.wait()
        return f"{_baked(drill)} files were there" if found else "too late"

    return happens


def killed_again_and_again(drill: Drill, _: ExitStack) -> str:
    """kill -9 of the parent as soon as a run has added something, until there is nothing to add."""
    kills = 0
    while True:
        process, there = drill.start(), drill.outputs()
        if not until(lambda there=there: drill.outputs() > there, process):  # type: ignore[misc]
            return f"{kills} kills"
        process.kill()
        process.wait()
        kills += 1
        if kills == 12:
            return f"{kills} kills, {_baked(drill)} files were there"


def workers_killed(drill: Drill, _: ExitStack) -> str:
    """kill -9 of workers, several times in one run."""
    import psutil

    process, kills = drill.start(), 0
    for share in (0.1, 0.3, 0.5, 0.7):
        if not until(lambda share=share: drill.outputs() > share * _size(drill), process):  # type: ignore[misc]
            break
        for child in psutil.Process(process.pid).children()[:1]:
            with contextlib.suppress(psutil.NoSuchProcess):
                child.kill()
                kills += 1
    said = process.communicate()[1]
    lost = sum("its process crashed (killed" in line for line in said.splitlines())
    return f"{kills} kills, {lost} assets failed alone, exit status {process.returncode}"


def full_disk(drill: Drill, undo: ExitStack) -> str:
    """The target is full after a part of the batch."""
    room = undo.enter_context(_small_disk(drill.target, 2048.0 * _size(drill)))
    status, said = drill.run()
    room("64m")
    failed = sum("No space left" in line for line in said)
    return f"exit status {status}, {failed} assets failed alone, {_baked(drill)} files were there"


def full_disk_for_the_state(drill: Drill, undo: ExitStack) -> str:
    """The folder of the manifest is full after a part of the batch."""
    room = undo.enter_context(_small_disk(_state(drill), 160 << 10))
    status, said = drill.run()
    room("64m")
    return f"exit status {status}, {_last(said)}"


def too_large_files(drill: Drill, _: ExitStack) -> str:
    """No file may be larger than those of some assets, nor than the manifest would be."""
    import resource

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (40 << 10, 40 << 10))

    status, said = drill.run(limit=limit)
    return f"exit status {status}, {_last(said)}"


def read_only(drill: Drill, undo: ExitStack) -> str:
    """The target cannot be written from the beginning."""
    release = undo.enter_context(_closed(drill.target))
    status, said = drill.run()
    release()
    return f"exit status {status}, {_last(said)}"


def closed_meanwhile(drill: Drill, undo: ExitStack) -> str:
    """Folders of the target take no more files after a part of the batch."""
    process = drill.start()
    until(lambda: drill.outputs() > 0.3 * _size(drill), process)
    folders = [path for path in drill.target.iterdir() if path.name.startswith("set")]
    release = [undo.enter_context(_closed(folder)) for folder in folders]
    said = process.communicate()[1].splitlines()
    for one in release:
        one()
    failed = sum("set" in line for line in said) - _size(drill) // 5
    return f"exit status {process.returncode}, {max(0, failed)} assets failed alone"


def signalled(number: signal.Signals) -> Callable[[Drill, ExitStack], str]:
    """A wish to stop in mid-run, with grace."""

    def happens(drill: Drill, _: ExitStack) -> str:
        process = drill.start("--grace", 5)
        until(lambda: drill.outputs() > 0.3 * _size(drill), process)
        process.send_signal(number)
        said = process.communicate()[1].splitlines()
        return f"exit status {process.returncode}, {_last(said)}"

    return happens


def two_at_once(drill: Drill, _: ExitStack) -> str:
    """A second batch into the same target, while the first is at work."""
    process = drill.start()
    until(lambda: drill.outputs() > 0, process)
    status, said = drill.run()
    process.communicate()
    return f"the second: exit status {status}, {_last(said)}"


def changed_meanwhile(drill: Drill, _: ExitStack) -> str:
    """An asset is saved anew between being read and being written."""
    late = drill.source / "late.obj"
    late.write_bytes(EARLY)
    late.with_suffix(".ready").write_bytes(LATE)
    status, _said = drill.run()
    return f"exit status {status}, the result of what was read"


def clock_turned_back(drill: Drill, _: ExitStack) -> str:
    """The first run takes place a year ahead, on a clock that goes back; an asset of old date follows."""
    late = drill.source / "late.obj"
    stamp = late.stat()
    late.write_bytes(EARLY)
    os.utime(late, (stamp.st_atime + 365 * DAY_S, stamp.st_mtime + 365 * DAY_S))
    ahead = replace(drill, environment={**drill.environment, AHEAD: str(365 * DAY_S)})
    status, _said = ahead.run()
    late.write_bytes(LATE)
    os.utime(late, (0.0, 0.0))
    return f"exit status {status}"


def faults() -> list[Fault]:
    """All of them, in the order of the table."""
    shares = (0.0, 0.25, 0.5, 0.75)
    return [
        *(Fault(f"kill -9 of the parent after {share:.0%}", killed(share)) for share in shares),
        Fault("kill -9 of the parent, again and again", killed_again_and_again),
        Fault("kill -9 of workers", workers_killed),
        Fault("full disk", full_disk, _with_state),
        Fault("full disk for the manifest", full_disk_for_the_state, _with_state),
        Fault("no file above 40 KiB", too_large_files),
        Fault("read-only target", read_only),
        Fault("folders closed in mid-run", closed_meanwhile),
        Fault("SIGINT", signalled(signal.SIGINT)),
        Fault("SIGTERM", signalled(signal.SIGTERM)),
        Fault("two batches at once", two_at_once),
        Fault("input saved while it is baked", changed_meanwhile),
        Fault("clock a year ahead, going back", clock_turned_back),
    ]


def _size(drill: Drill) -> int:
    """How many assets there are."""
    return sum(path.suffix in {".obj", ".ply", ".gltf", ".glb"} for path in drill.source.rglob("*"))


def _baked(drill: Drill) -> int:
    return len(drill.left().written)


def _state(drill: Drill) -> Path:
    return drill.target.with_name("state")


def _with_state(drill: Drill) -> Sequence[object]:
    shutil.rmtree(_state(drill), ignore_errors=True)
    return ("--state", _state(drill))


def _last(said: Sequence[str]) -> str:
    """What was found, by the last line that was said: without the name of the file, and without the cure."""
    line = said[-1].removeprefix("aobake: error: ") if said else "nothing said"
    finding = line.split(": ", 1)[-1].split(". ")[0].split(": process")[0]
    return finding.rstrip(".")


@contextlib.contextmanager
def _small_disk(folder: Path, size: float) -> Iterator[Callable[[str], None]]:
    """A disk of so many bytes in place of a folder; gives what makes it larger."""
    folder.mkdir(exist_ok=True)
    _mount("-t", "tmpfs", "-o", f"size={int(size)}", "aobake", folder)
    try:
        yield lambda larger: _mount("-o", f"remount,size={larger}", folder)
    finally:
        subprocess.run(["umount", folder], check=True)


@contextlib.contextmanager
def _closed(folder: Path) -> Iterator[Callable[[], None]]:
    """A folder that takes no new files, whoever asks; gives what ends that."""
    if os.geteuid():
        folder.chmod(0o555)
        yield lambda: folder.chmod(0o755)
        return

    def immutable(sign: str) -> None:
        words = ["chattr", f"{sign}i", str(folder)]
        done = subprocess.run(words, check=False, capture_output=True, text=True)
        if done.returncode:
            raise Skipped(f"folders cannot be closed here: {done.stderr.strip()}")

    immutable("+")
    try:
        yield lambda: immutable("-")
    finally:
        immutable("-")


def _mount(*words: object) -> None:
    done = subprocess.run(["mount", *map(str, words)], check=False, capture_output=True, text=True)
    if done.returncode:
        raise Skipped(f"nothing can be mounted here: {done.stderr.strip()}")


def undisturbed(drill: Drill) -> tuple[Left, Whole]:
    """What a batch leaves that nothing happens to, and the digests of outputs with either content of late.obj."""
    late = drill.source / "late.obj"
    late.write_bytes(EARLY)
    drill.run()
    early = drill.left()
    late.write_bytes(LATE)
    drill.run()
    expected = drill.left()
    names = early.written.keys() | expected.written.keys()
    both = (early.written, expected.written)
    return expected, {name: {w[name] for w in both if name in w} for name in names}


def table(folder: Path, count: int, *, light: bool) -> Table:
    """All faults, one after another."""
    drill = Drill(
        assets(folder / "in", count),
        folder / "out",
        ("--rays", 4, "--pictures", "none", "--processes", 2, "--timeout", 8),
        {LIGHT: "1"} if light else {},
    )
    expected, whole = undisturbed(drill)
    rows: list[list[Cell]] = []
    for fault in faults():
        try:
            rows.append(suffered(fault, drill, expected, whole))
        except Skipped as reason:
            rows.append([fault.name, f"skipped: {reason}", None, None, None, "-"])
    good = sum(state == "done" for state in expected.states.values())
    return Table(
        f"{len(expected.states)} assets, of which {good} can be baked",
        ("fault", "what happened", "lost", "half-written", "baked twice", "the same in the end"),
        rows,
        {"files of an undisturbed run": len(expected.written)},
    )


def run(quick: bool) -> Iterator[Table]:
    """200 assets that are baked, or a few that are copied."""
    with tempfile.TemporaryDirectory() as scratch:
        yield table(Path(scratch), QUICK_ASSETS if quick else ASSETS, light=quick)

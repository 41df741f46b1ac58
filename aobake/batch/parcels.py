"""A task whose folders are not on this machine: brought here, done as any other, and its files taken back."""

from __future__ import annotations

import posixpath
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from aobake.batch.remote import RemoteFolder
from aobake.batch.tasks import Outcome, Remote, Task
from aobake.errors import InputError
from aobake.meshes.formats.references import references

__all__ = ["delivered"]

MOST_REFERENCES = 10_000  # each is asked for over the network
PARENT = ".."


def delivered(task: Task, work: Callable[[Task], Outcome]) -> Outcome:
    """Do a task whose folders are remote.

    work : does the same task with its files in folders of this machine
    The asset and every file that it refers to come into a temporary folder; what is written there is put in
    place file by file, each whole, the one asked for last. Nothing is put in place unless the outcome is
    "done". In the outcome, files are named by where they belong.
    Raises InputError where the asset cannot be fetched, OutputError where a file cannot be put in place.
    """
    remote = task.remote
    if remote is None:
        return work(task)
    with tempfile.TemporaryDirectory(prefix="aobake-") as folder:
        visit = _visit(task, remote, Path(folder).resolve())
        visit.fetch()
        outcome = visit.named(work(visit.task))
        if outcome.status == "done":
            visit.deliver(outcome)
        return outcome


@dataclass(frozen=True)
class _Folder:
    """A folder of a batch. here : where its files are on this machine; there : where they belong, None: here."""

    name: str
    here: Path
    there: RemoteFolder | None


@dataclass(frozen=True)
class _Visit:
    """The two folders of a task, and the task with the paths of this machine.

    asset : its name in the source folder; root : the folder there that it may read from besides its own
    """

    source: _Folder
    target: _Folder
    asset: str
    root: str
    task: Task

    def fetch(self) -> None:
        """Bring the asset, every file that it refers to, and the parts that the task needs."""
        if self.source.there is not None:
            self._fetch_asset(self.source.there)
        if self.target.there is not None:
            self.target.here.mkdir(parents=True, exist_ok=True)
            for name in self.task.part.needs if self.task.part else ():
                self.target.there.fetch(name, self.target.here / name)

    def _fetch_asset(self, source: RemoteFolder) -> None:
        here = self.source.here / self.asset
        if not source.fetch(self.asset, here):
            raise InputError(f"{source.shown(self.asset)}: there is no such file.")
        asked = {self.asset}
        while new := [name for name in self._referred(here) if name not in asked]:
            asked.update(new)
            if len(asked) > MOST_REFERENCES:
                raise InputError(
                    f"{source.shown(self.asset)}: it refers to more than {MOST_REFERENCES} files. "
                    "Pack it into one, as GLB."
                )
            for name in new:
                source.fetch(name, self.source.here / name)

    def _referred(self, here: Path) -> Iterator[str]:
        """The files that the asset may read: below its folder, or below the root."""
        folder = posixpath.dirname(self.asset)
        for name in references(here):
            full = posixpath.normpath(posixpath.join(folder, name))
            if any(_is_below(full, limit) for limit in (folder, self.root)):
                yield full

    def deliver(self, outcome: Outcome) -> None:
        """Put in place what was written, the file that was asked for last."""
        if self.target.there is None:
            return
        fetched = set(self.task.part.needs if self.task.part else ())
        here = (path for path in sorted(self.target.here.rglob("*")) if path.is_file())
        names = [path.relative_to(self.target.here).as_posix() for path in here]
        first = [name for name, _ in outcome.outputs[:1]]
        for name in [name for name in names if name not in {*first, *fetched}] + first:
            self.target.there.deliver(self.target.here / name, name)

    def named(self, outcome: Outcome) -> Outcome:
        """The outcome with the URLs of files in place of their paths on this machine."""
        return replace(
            outcome,
            reason=self._shown(outcome.reason),
            report=None
            if outcome.report is None
            else {key: self._renamed(value) for key, value in outcome.report.items()},
        )

    def _shown(self, text: str) -> str:
        # The longer first: one of the folders may lie in the other.
        for folder in sorted((self.source, self.target), key=lambda f: -len(str(f.here))):
            text = text.replace(str(folder.here), folder.name)
        return text

    def _renamed(self, value: object) -> object:
        if isinstance(value, str):
            return self._shown(value)
        if isinstance(value, dict):
            return {key: self._renamed(item) for key, item in value.items()}
        if isinstance(value, list):
            return [self._renamed(item) for item in value]
        return value


def _visit(task: Task, remote: Remote, room: Path) -> _Visit:
    source = _folder(remote.source, remote, room)
    target = _folder(remote.target, remote, room)
    job, root = task.job, task.job.reading.root
    here = replace(
        job,
        input=source.here / job.input,
        output=target.here / job.output,
        reading=replace(job.reading, root=None if root is None else source.here / root),
    )
    return _Visit(
        source=source,
        target=target,
        asset=job.input.as_posix(),
        root=PARENT if root is None else posixpath.normpath(root.as_posix()),
        task=replace(task, job=here, source=source.here, target=target.here, remote=None),
    )


def _folder(name: str, remote: Remote, room: Path) -> _Folder:
    if "://" not in name:
        return _Folder(name, Path(name), None)
    there = RemoteFolder(name, remote.options)
    return _Folder(there.name, room / there.mirror, there)


def _is_below(name: str, folder: str) -> bool:
    """Whether a name lies in a folder, both within the same one; nothing lies in PARENT."""
    if name == PARENT or name.startswith(f"{PARENT}/"):
        return False
    return folder in {"", "."} or name.startswith(f"{folder}/")

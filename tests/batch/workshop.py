"""A batch without rays: assets that are any bytes, and a bake that is a digest of all it depends on."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from aobake.batch.keys import recipe
from aobake.batch.manifest import Manifest
from aobake.batch.places import LocalFolder, local_folder
from aobake.batch.standing import Standing
from aobake.batch.tasks import Outcome, Planned
from aobake.config import Configured
from aobake.jobs import Job
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

__all__ = ["SETTINGS", "CountingFolder", "Workshop", "digest"]

SETTINGS = BakeSettings(rays=16)


@dataclass(frozen=True)
class CountingFolder(LocalFolder):
    """A folder that writes down which files were read."""

    read_names: list[str]

    def digest(self, name: str) -> str:
        self.read_names.append(name)
        return super().digest(name)


def digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


class Workshop:
    """Two folders and a manifest. sides : asset -> files that it refers to, relative to the source."""

    def __init__(self, folder: Path) -> None:
        self.read_names: list[str] = []
        for name in ("in", "out", "out/.aobake"):
            (folder / name).mkdir(exist_ok=True)
        of_in, of_out = local_folder(folder / "in"), local_folder(folder / "out")
        self.source = CountingFolder(of_in.name, of_in.folder, self.read_names)
        self.target = CountingFolder(of_out.name, of_out.folder, self.read_names)
        self.database = folder / "out" / ".aobake" / "batch.sqlite"
        self.sides: dict[str, tuple[str, ...]] = {}

    def asset(self, name: str, content: str = "box") -> None:
        """A file of the source folder, in place of what is there."""
        path = self.source.path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode())

    def rename(self, before: str, after: str) -> None:
        self.source.path(after).parent.mkdir(parents=True, exist_ok=True)
        self.source.path(before).rename(self.source.path(after))

    def planned(self, name: str, bake: BakeSettings = SETTINGS, target: str = "") -> Planned:
        target = target or name
        chosen = Configured(bake=bake, store=StoreSettings(), image=ImageSettings())
        source = self.source.path(name)
        job = Job(
            command="vertex",
            input=source,
            output=self.target.path(target),
            chosen=chosen,
            force=True,
        )
        size = source.stat().st_size if source.exists() else 0
        return Planned(source=name, target=target, job=job, size=size)

    def all_planned(self, bake: BakeSettings = SETTINGS) -> list[Planned]:
        """All assets there are, but for textures."""
        found = (f.name for f in self.source.files(lambda _: True) if not f.name.endswith(".png"))
        return [self.planned(name, bake) for name in found]

    def open(self) -> Manifest:
        return Manifest.open(self.database, self.source, self.target)

    def output(self, planned: Planned) -> bytes:
        """What a bake gives: other bytes for another content or other settings, and for nothing else."""
        read = b"".join(self.source.path(name).read_bytes() for name in self._reads(planned))
        return b"baked " + digest(read + recipe(planned.job).encode()).encode()

    def baked(self, planned: Planned, *, copies: bool = True) -> Outcome:
        """Bake an asset: its output, beside copies of its side files where they are not there already."""
        written = {planned.target: self.output(planned)}
        home, there = Path(planned.source).parent, Path(planned.target).parent
        for name in self._reads(planned)[1:] if copies else ():
            copy = os.path.normpath(there / Path(name).relative_to(home))
            content = self.source.path(name).read_bytes()
            if not self.target.path(copy).exists():
                written[Path(copy).as_posix()] = content
        for name, content in written.items():
            self.target.path(name).parent.mkdir(parents=True, exist_ok=True)
            self.target.path(name).write_bytes(content)
        inputs = {name: self.source.path(name).read_bytes() for name in self._reads(planned)}
        absent = [name for name in self.sides.get(planned.source, ()) if name not in inputs]
        return Outcome(
            number=0,
            status="done",
            report={"inputs": list(inputs), "settings": {"rays": planned.job.chosen.bake.rays}},
            inputs=(*_digests(inputs), *((name, "") for name in absent)),
            outputs=_digests(written),
            seconds=2.5,
            peak_bytes=1000,
            pictures={"after": b"PNG of " + planned.source.encode("utf-8", "surrogatepass")},
        )

    def run(self, *jobs: Planned) -> dict[str, Standing]:
        """One run over all assets, or these jobs, as the runner does it; target -> how it stood."""
        planned = list(jobs or self.all_planned())
        with self.open() as manifest:
            manifest.begin({})
            pairs = list(zip(planned, manifest.standings(planned), strict=True))
            manifest.keep([pair for pair in pairs if pair[1].kind == "unchanged"])
            again = manifest.adopt([pair for pair in pairs if pair[1].kind == "moved"])
            for job, _ in [*(pair for pair in pairs if pair[1].to_bake), *again]:
                manifest.record(job, self.baked(job))
            manifest.finish({})
        return {job.target: standing for job, standing in pairs}

    def kinds(self, *jobs: Planned) -> dict[str, str]:
        return {target: standing.kind for target, standing in self.run(*jobs).items()}

    def look(self, *jobs: Planned) -> Standing:
        """How a single job stands; nothing is written."""
        with self.open() as manifest:
            return manifest.standings(jobs)[0]

    def is_right(self) -> bool:
        """Whether every output is what a bake of its asset gives."""
        return all(
            self.target.path(job.target).read_bytes() == self.output(job)
            for job in self.all_planned()
        )

    def _reads(self, planned: Planned) -> list[str]:
        sides = [s for s in self.sides.get(planned.source, ()) if self.source.path(s).exists()]
        return [planned.source, *sides]


def _digests(files: Mapping[str, bytes]) -> tuple[tuple[str, str], ...]:
    return tuple((name, digest(content)) for name, content in files.items())

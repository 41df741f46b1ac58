"""How a job stands: whether what an earlier run made of it is still good, and if not, why not."""

from __future__ import annotations

import posixpath
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from aobake import __version__
from aobake.batch.keys import difference, fingerprint, follows_content, recipe
from aobake.batch.places import Stamp
from aobake.batch.tasks import Planned
from aobake.batch.tree import Tree

__all__ = ["UNSURE", "Kind", "Known", "Record", "Role", "Standing", "from_here", "judge", "shown"]

Kind = Literal[
    "unchanged",
    "moved",
    "refused",
    "new",
    "version changed",
    "settings changed",
    "input changed",
    "output missing",
    "output changed",
    "failed before",
]

Role = Literal["in", "out", "side", "left"]
"""What a file is to a job: read; written; needed beside the output and there already; or written by an
earlier bake, and of no use any more."""


UNSURE = "?"
"""The digest of a file that was written while it was baked: nobody knows which content was read."""


@dataclass(frozen=True, slots=True)
class Record:
    """A file of a job as the manifest has it.

    name : in the source folder for what was read (absolute where it lies outside), in the target folder else
    stamp : when its digest was known to be right; `changed` is '' where it never was
    sha256 : of its content; '' for a file that was referred to and was not there; or UNSURE
    """

    role: Role
    name: str
    stamp: Stamp
    sha256: str


@dataclass(frozen=True, slots=True)
class Known:
    """What the manifest knows of a job.

    job : its number     source : the asset of its last good bake
    failure : how its last run failed, in one line; '' where it did not
    version, fingerprint, seconds, peak_bytes, files : of its last good bake; version '' where there is none
    """

    job: int
    target: str
    source: str
    failure: str
    version: str
    fingerprint: str
    seconds: float
    peak_bytes: int
    files: tuple[Record, ...]

    def of(self, *roles: Role) -> list[Record]:
        """Its files in these roles; of those read, the asset comes first."""
        return [file for file in self.files if file.role in roles]


@dataclass(frozen=True, kw_only=True)
class Standing:
    """How a job stands before a run.

    reason : why, in one line; '' where it is unchanged
    seconds, peak_bytes : of its last good bake; None where there is none
    reuse : of a job that is moved, the target whose output it can have
    renewed : files whose content is the same under a new stamp
    """

    kind: Kind
    reason: str = ""
    seconds: float | None = None
    peak_bytes: int | None = None
    reuse: str = ""
    renewed: tuple[Record, ...] = ()

    @property
    def to_bake(self) -> bool:
        """Whether there is anything to bake."""
        return self.kind not in {"unchanged", "moved", "refused"}


def judge(
    planned: Sequence[Planned],
    known: Mapping[str, Known],
    recipes: Mapping[str, str],
    source: Tree,
    target: Tree,
) -> list[Standing]:
    """How each of the jobs stands, in their order.

    known : target -> what is known of it     recipes : fingerprint -> recipe, of everything known
    No file is read but those whose stamp differs, and assets that may be others under new names.
    """
    donors = _Donors(known.values(), source, target)
    found = []
    for job in planned:
        if job.refused:
            found.append(Standing(kind="refused", reason=job.refused))
            continue
        wanted, own = recipe(job.job), known.get(job.target)
        alone = _compared(job, own, wanted, recipes, source, target)
        found.append(_with_the_others(job, own, wanted, alone, donors))
    return found


def _with_the_others(
    job: Planned, known: Known | None, wanted: str, alone: Standing, donors: _Donors
) -> Standing:
    """How a job stands, after what it does by its own last bake: another one may have its output."""
    found = alone
    if known is not None and known.version:
        found = replace(found, seconds=known.seconds, peak_bytes=known.peak_bytes)
    if found.kind == "unchanged":
        return found
    donor = donors.of(job, wanted)
    if donor is not None:
        reason = f"its content is that of {shown(donor.source)} before"
        return replace(found, kind="moved", reason=reason, reuse=donor.target, renewed=())
    if known is not None and known.failure:
        return replace(found, kind="failed before", reason=f"it failed before: {known.failure}")
    return found


def _compared(
    job: Planned,
    known: Known | None,
    wanted: str,
    recipes: Mapping[str, str],
    source: Tree,
    target: Tree,
) -> Standing:
    """The job against its own last good bake; what costs nothing is compared first."""
    if known is None or not known.version:
        return Standing(kind="new", reason="it was not baked before")
    if known.version != __version__:
        return Standing(
            kind="version changed", reason=f"aobake was {known.version} and is {__version__}"
        )
    if known.fingerprint != fingerprint(wanted):
        changes = difference(recipes.get(known.fingerprint, "{}"), wanted)
        return Standing(kind="settings changed", reason=changes)
    if known.source != job.source:
        return Standing(
            kind="input changed", reason=f"it was made from {shown(known.source)} before"
        )
    renewed: list[Record] = []
    trouble = next(_troubles(known, source, target, renewed.append), None)
    return trouble or Standing(kind="unchanged", renewed=tuple(renewed))


def _troubles(
    known: Known, source: Tree, target: Tree, renew: Callable[[Record], None]
) -> Iterator[Standing]:
    """What is not as it was among the files of a job; those with a new stamp alone are renewed."""
    for file in known.of("in"):
        if finding := _finding(file, source, renew):
            yield Standing(kind="input changed", reason=finding)
    for file in known.of("out", "side"):
        if finding := _finding(file, target, renew):
            gone = target.stamp(file.name) is None
            yield Standing(kind="output missing" if gone else "output changed", reason=finding)


def _finding(file: Record, tree: Tree, renew: Callable[[Record], None]) -> str:
    """How a file differs from its record, in words; '' where it does not."""
    now = tree.stamp(file.name)
    if now is None:
        return f"{shown(file.name)} is gone" if file.sha256 else ""
    if not file.sha256:
        return f"{shown(file.name)} is there now"
    if file.sha256 == UNSURE:
        return f"{shown(file.name)} changed while it was baked"
    if now == file.stamp:
        return ""
    if now.size == file.stamp.size and tree.digest(file.name) == file.sha256:
        renew(replace(file, stamp=now))
        return ""
    return f"{shown(file.name)} is another one"


class _Donors:
    """Good bakes of this version, to be found again by the content of their asset."""

    def __init__(self, known: Iterable[Known], source: Tree, target: Tree) -> None:
        self._source, self._target = source, target
        self._sizes: set[tuple[str, int]] = set()
        self._bakes: dict[tuple[str, str], list[Known]] = defaultdict(list)
        for bake in known:
            outputs, inputs = bake.of("out", "side"), bake.of("in")
            if bake.version == __version__ and inputs and len(outputs) == 1:
                self._sizes.add((bake.fingerprint, inputs[0].stamp.size))
                self._bakes[bake.fingerprint, inputs[0].sha256].append(bake)

    def of(self, job: Planned, wanted: str) -> Known | None:
        """A bake of the same files with the same recipe, whose output is as it was; None where there is none.

        An asset is read for it only where one of its size was baked in this way before.
        """
        print_, now = fingerprint(wanted), self._source.stamp(job.source)
        if now is None or (print_, now.size) not in self._sizes or not follows_content(job.job):
            return None
        candidates = self._bakes.get((print_, self._source.digest(job.source)), ())
        return next((bake for bake in candidates if self._serves(bake, job)), None)

    def _serves(self, bake: Known, job: Planned) -> bool:
        _, *sides = bake.of("in")
        for side in sides:
            name = from_here(side.name, bake.source, job.source)
            if name is None or self._content(name) != side.sha256:
                return False
        return not any(
            _finding(file, self._target, lambda _: None) for file in bake.of("out", "side")
        )

    def _content(self, name: str) -> str:
        """The digest of a file, whatever its stamp: that of another file says nothing. '' where there is none."""
        return "" if self._source.stamp(name) is None else self._source.digest(name)


def from_here(side: str, asset: str, other: str) -> str | None:
    """The name of a side file of one asset, as the same reference gives it from another asset.

    None where it does not lie below the folder of its asset: what it is then to the other one, the names
    alone do not say.
    """
    relative = posixpath.relpath(side, posixpath.dirname(asset) or ".")
    if posixpath.isabs(side) or relative.split("/")[0] == "..":
        return None
    return posixpath.join(posixpath.dirname(other), relative)


def shown(name: str) -> str:
    """A name as it can stand in a line: as it is, or quoted where it holds what cannot be printed."""
    return name if name.isprintable() else ascii(name)

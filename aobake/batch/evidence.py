"""The files of a bake as it was just done: what a later run compares to tell that it still stands."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import replace

from aobake.batch.places import Place, Stamp
from aobake.batch.standing import UNSURE, Record, Role, from_here
from aobake.batch.tasks import Outcome, Planned
from aobake.batch.tree import Tree
from aobake.errors import InputError

__all__ = ["evidence"]

_NEVER = Stamp(0, "")


def evidence(
    planned: Planned,
    outcome: Outcome,
    earlier: Iterable[Record],
    source: Place,
    before: Tree | None,
    target: Place,
) -> tuple[Record, ...]:
    """What was read, written, needed beside the output, and left over from the bake before; the asset first.

    earlier : the files of the bake before     before : the source folder as it was when the run began
    """
    names = (planned.source, *(name for name, _ in outcome.inputs[1:]))
    read = [
        Record("in", name, source.stamp(name) or _NEVER, sha256)
        for name, (_, sha256) in zip(names, outcome.inputs, strict=False)
    ]
    written = {
        name: Record("out", name, target.stamp(name) or _NEVER, sha256)
        for name, sha256 in outcome.outputs
    }
    ours = {file.name: file for file in earlier if file.role in {"out", "left"}}
    for file in _beside(planned, read[1:], target):
        role: Role = "out" if file.name in ours else "side"
        written.setdefault(file.name, replace(file, role=role))
    left = [
        replace(file, role="left")
        for name, file in ours.items()
        if name not in written and target.stamp(name) is not None
    ]
    return (*(_vouched(file, before) for file in read), *written.values(), *left)


def _vouched(file: Record, before: Tree | None) -> Record:
    """A file that was read. Its stamp vouches for its digest only where it is the one from before the run.

    Where it is another one, the file was written meanwhile, and whether before it was read, or between that
    and the digest, cannot be told. Where it was not met before the run, the next one compares its digest.
    """
    seen = before.seen(file.name) if before else None
    if seen == file.stamp:
        return file
    never = replace(file, stamp=replace(file.stamp, changed=""))
    return never if seen is None else replace(never, sha256=UNSURE)


def _beside(planned: Planned, sides: Sequence[Record], target: Place) -> list[Record]:
    """Copies of side files that lie beside the output already, with the content that it needs.

    A texture that two assets share is written with the first; the second needs it as much.
    """
    found = []
    for side in sides:
        name = from_here(side.name, planned.source, planned.target)
        stamp = None if name is None else target.stamp(name)
        if name is None or stamp is None or stamp.size != side.stamp.size:
            continue
        # Where it is gone by now, or cannot be read, it is not that file.
        with contextlib.suppress(InputError):
            if target.digest(name) == side.sha256:
                found.append(Record("side", name, stamp, side.sha256))
    return found

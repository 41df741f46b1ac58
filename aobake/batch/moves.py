"""Outputs of assets that were renamed, moved or swapped: copied from their old names instead of baked."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from aobake.batch.database import Database
from aobake.batch.evidence import evidence
from aobake.batch.memory import Bake, bake_of, put_bake, put_job
from aobake.batch.places import Place
from aobake.batch.standing import Known, Standing, from_here
from aobake.batch.tasks import Outcome, Planned
from aobake.batch.tree import STATE, Tree
from aobake.errors import OutputError
from aobake.files import UNFINISHED

__all__ = ["adopt"]


@dataclass(frozen=True, kw_only=True)
class _Gift:
    """What is known of a bake, and the file in the target that is its output now."""

    giver: Known
    bake: Bake
    file: str


def adopt(
    moves: Sequence[tuple[Planned, Standing]],
    known: Mapping[str, Known],
    database: Database,
    places: tuple[Place, Place],
    before: Tree,
    run: int,
) -> list[tuple[Planned, Standing]]:
    """Copy the outputs, and take over what is known of them; those that could not be had are returned.

    known : target -> what is known of it     places : source and target     before : the source when the run began
    An output that is written over and that another job still needs (two assets that swapped names, a row of
    them that moved up by one) is set aside first. Raises OutputError where the database cannot be written.
    """
    target = places[1]
    written = {planned.target for planned, _ in moves}
    wanted = {standing.reuse for _, standing in moves}
    left: list[tuple[Planned, Standing]] = []
    aside: dict[str, _Gift] = {}
    try:
        for number, giver in enumerate(sorted(wanted & written)):
            with contextlib.suppress(OutputError):  # what has no copy is baked
                aside[giver] = _set_aside(_gift(known[giver], database), number, target)
        with database.writing() as connection:
            for planned, standing in moves:
                gift = aside.get(standing.reuse)
                if gift is None and standing.reuse not in written:
                    gift = _gift(known[standing.reuse], database)
                if gift is None or not _copied(gift.file, planned.target, target):
                    left.append((planned, standing))
                    continue
                job = put_job(connection, planned, run, "moved", standing.reason)
                put_bake(connection, job, _renamed(gift, planned, known, places, before))
    finally:
        for kept in aside.values():
            with contextlib.suppress(OutputError):
                target.remove(kept.file)
    return left


def _copied(file: str, to: str, target: Place) -> bool:
    """Whether a copy could be made; where not, the bake will say why, if it cannot write there either."""
    try:
        target.copy(file, to)
    except OutputError:
        return False
    return True


def _gift(giver: Known, database: Database) -> _Gift:
    (output,) = giver.of("out")
    return _Gift(giver=giver, bake=bake_of(database, giver), file=output.name)


def _set_aside(gift: _Gift, number: int, target: Place) -> _Gift:
    """A copy under a name that is swept up with the leftovers, should this run be killed."""
    name = f"{STATE}/{UNFINISHED}{number:08}.part"
    target.copy(gift.file, name)
    return replace(gift, file=name)


def _renamed(
    gift: _Gift,
    planned: Planned,
    known: Mapping[str, Known],
    places: tuple[Place, Place],
    before: Tree,
) -> Bake:
    """The bake of the giver as that of the job: the same, but for the names."""
    source, target = places
    asset, *sides = gift.giver.of("in")
    names = [from_here(side.name, gift.giver.source, planned.source) or side.name for side in sides]
    inputs = [(planned.source, asset.sha256)]
    inputs += [(name, side.sha256) for name, side in zip(names, sides, strict=True)]
    outputs = ((planned.target, gift.giver.of("out")[0].sha256),)
    done = Outcome(number=0, status="done", inputs=tuple(inputs), outputs=outputs)
    own = known.get(planned.target)
    report = dict(gift.bake.report)
    report["inputs"] = _records(inputs, source)
    report["outputs"] = _records(outputs, target)
    return replace(
        gift.bake,
        report=report,
        files=evidence(planned, done, own.files if own else (), source, before, target),
    )


def _records(files: Sequence[tuple[str, str]], place: Place) -> list[dict[str, str]]:
    """Files as the report of a job tells them."""
    return [{"path": str(place.path(name)), "sha256": sha256} for name, sha256 in files if sha256]

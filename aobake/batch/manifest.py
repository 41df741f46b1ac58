"""The memory of a batch: what was planned, what became of it, and what of that still stands.

One database in the target, written in one transaction for each job: a run that is killed loses the jobs in
flight and no other. An output that appeared but was not recorded is baked again, to the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, Self

from aobake import __version__
from aobake.batch.closing import Closing
from aobake.batch.database import Database, name_stored, open_database
from aobake.batch.evidence import evidence
from aobake.batch.keys import fingerprint, recipe
from aobake.batch.memory import (
    ENTRIES,
    Bake,
    entry_of,
    known_jobs,
    pictures_of,
    put_bake,
    put_job,
)
from aobake.batch.moves import adopt
from aobake.batch.places import Place
from aobake.batch.pruning import Pruned, prune, stale_files
from aobake.batch.standing import Known, Standing, judge
from aobake.batch.tasks import Entry, Outcome, Planned
from aobake.batch.tree import Tree

__all__ = ["Manifest", "Pruned"]

Pairs = Iterable[tuple[Planned, Standing]]

_NO_ASSETS = "there is no asset at all: remove it by hand if that is meant"


class Manifest(Closing):
    """What is known of all jobs of a target."""

    def __init__(self, database: Database, source: Place, target: Place) -> None:
        self._database, self._source, self._target = database, source, target
        self._run = 0
        self._before: Tree | None = None
        self._known: dict[str, Known] = {}

    @classmethod
    def open(cls, path: Path | None, source: Place, target: Place) -> Self:
        """Open the manifest in a file, or begin a new one; None: one in memory, for a look.

        source, target : the two folders of the batch
        One process at a time can have it open. Raises InputError where the file is damaged, of a newer
        aobake or not one of aobake's, and OutputError where it cannot be written.
        """
        return cls(open_database(path), source, target)

    def close(self) -> None:
        """Let go of the file."""
        self._database.close()

    def begin(self, facts: Mapping[str, object]) -> int:
        """Begin a run; its number.

        facts : what to remember of it, as JSON takes it; no secrets
        """
        with self._database.writing() as connection:
            ((self._run,),) = connection.execute(
                "INSERT INTO runs (started, facts) VALUES (?, ?) RETURNING id",
                (_now(), json.dumps(dict(facts))),
            ).fetchall()
        return self._run

    def finish(self, facts: Mapping[str, object]) -> None:
        """End the run; facts are added to those that it began with."""
        with self._database.writing() as connection:
            ((before,),) = connection.execute("SELECT facts FROM runs WHERE id = ?", (self._run,))
            connection.execute(
                "UPDATE runs SET finished = ?, facts = ? WHERE id = ?",
                (_now(), json.dumps(json.loads(before) | dict(facts)), self._run),
            )
            connection.execute(
                "DELETE FROM recipes WHERE fingerprint NOT IN "
                "(SELECT recipe FROM jobs UNION SELECT recipe FROM bakes)"
            )

    def facts(self, run: int) -> Mapping[str, object]:
        """What is known of a run: "started" and "finished" (None: it was not), and its facts; {} for none."""
        for started, finished, facts in self._database.rows(
            "SELECT started, finished, facts FROM runs WHERE id = ?", run
        ):
            return {"started": started, "finished": finished, **json.loads(str(facts))}
        return {}

    def standings(self, planned: Sequence[Planned]) -> list[Standing]:
        """How each of the jobs stands, in their order; nothing is written.

        Both folders are walked once; files are read only where their stamp differs, or where one may be
        another under a new name.
        """
        self._before = Tree(self._source)
        self._known = known_jobs(self._database)
        recipes = {
            str(print_): str(text)
            for print_, text in self._database.rows("SELECT fingerprint, recipe FROM recipes")
        }
        return judge(planned, self._known, recipes, self._before, Tree(self._target))

    def keep(self, pairs: Pairs) -> None:
        """Take over jobs that are unchanged into the run; stamps of files that are the same are renewed."""
        with self._database.writing() as connection:
            for planned, standing in pairs:
                job = put_job(connection, planned, self._run, "unchanged")
                connection.executemany(
                    "UPDATE files SET size = ?, changed = ? WHERE job = ? AND role = ? AND name = ?",
                    [
                        (
                            file.stamp.size,
                            file.stamp.changed,
                            job,
                            file.role,
                            name_stored(file.name),
                        )
                        for file in standing.renewed
                    ],
                )

    def note(
        self, planned: Iterable[Planned], state: Literal["failed", "stopped"], reason: str = ""
    ) -> None:
        """Jobs that this run did not even start.

        reason : why; '': what each says of itself (Planned.refused)
        """
        with self._database.writing() as connection:
            for job in planned:
                put_job(connection, job, self._run, state, reason or job.refused)

    def record(self, planned: Planned, outcome: Outcome, *, attempts: int = 1) -> None:
        """What became of a job, in one transaction; where it failed, its last good bake stays known."""
        done = outcome.status == "done"
        bake = self._bake(planned, outcome) if done else None
        with self._database.writing() as connection:
            number = put_job(
                connection,
                planned,
                self._run,
                "baked" if done else outcome.status,
                outcome.reason,
                attempts=attempts,
                seconds=outcome.seconds,
                peak_bytes=outcome.peak_bytes,
            )
            if bake is not None:
                put_bake(connection, number, bake)

    def _bake(self, planned: Planned, outcome: Outcome) -> Bake:
        known = self._known.get(planned.target)
        earlier = known.files if known else ()
        return Bake(
            version=__version__,
            fingerprint=fingerprint(recipe(planned.job)),
            seconds=outcome.seconds,
            peak_bytes=outcome.peak_bytes,
            report=outcome.report or {},
            files=evidence(planned, outcome, earlier, self._source, self._before, self._target),
            pictures=outcome.pictures,
        )

    def adopt(self, pairs: Pairs) -> list[tuple[Planned, Standing]]:
        """Give jobs that are moved the outputs of those whose content they have, before anything is baked.

        Returns those that could not be helped so after all, to be baked.
        """
        places = (self._source, self._target)
        return adopt(list(pairs), self._known, self._database, places, self._walked(), self._run)

    def stale(self, planned: Sequence[Planned]) -> tuple[str, ...]:
        """Outputs of assets that are there no more, or that are written elsewhere now: sorted names.

        Assets that are there and only were not asked for keep theirs.
        """
        stale = stale_files(known_jobs(self._database), planned, self._walked())
        return tuple(name for name in stale.files if self._target.stamp(name) is not None)

    def prune(self, planned: Sequence[Planned]) -> Pruned:
        """Remove what is stale, where it still has the content that was written; the rest is kept, and said.

        Where nothing is planned nothing is removed: such a folder is rather not mounted than empty.
        """
        known = known_jobs(self._database)
        stale = stale_files(known, planned, self._walked())
        if not planned:
            return Pruned(removed=(), kept=tuple((name, _NO_ASSETS) for name in stale.files))
        return prune(stale, known, self._database, self._target)

    def entries(self, run: int) -> Iterator[Entry]:
        """Every job of a run, sorted by source and target, as it is read; the last run has all of its own."""
        for row in self._database.rows(ENTRIES, run):
            yield entry_of(self._database, row)

    def pictures(self, target: str) -> Mapping[str, bytes]:
        """Name -> content of the pictures of a job; empty where there are none."""
        return pictures_of(self._database, target)

    def _walked(self) -> Tree:
        """The source folder as it was when the jobs were compared."""
        if self._before is None:
            self._before = Tree(self._source)
        return self._before


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")

"""A batch from beginning to end: plan, compare with what stands, bake what does not, report.

    plan_batch -> Manifest.standings -> Schedule -> Executor -> Manifest.record -> reports

All that lasts is in the manifest, one transaction a job: whenever this is killed, the next run goes on from there.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

from aobake.batch.discovery import plan_batch
from aobake.batch.leftovers import remove_leftovers
from aobake.batch.lock import hold
from aobake.batch.manifest import Manifest, Pruned
from aobake.batch.places import LocalFolder, Place
from aobake.batch.progress import SILENT, Watcher
from aobake.batch.remote import RemoteFolder
from aobake.batch.schedule import Cost, Schedule, estimated
from aobake.batch.settings import BatchSettings
from aobake.batch.standing import Standing
from aobake.batch.summary import RunFacts, Totals, totals_of, write_json
from aobake.batch.tasks import Executor, Outcome, Planned, Remote, Task
from aobake.errors import AobakeError
from aobake.files import make_folder
from aobake.jobs import Reading

__all__ = ["Batch", "Ended", "Pairs", "Reports", "compare", "run_batch"]

POLL_S = 0.25  # how often the watcher hears that time passes
NOT_BEGUN = "the batch was stopped before it was begun"
AGAIN = {"crashed", "memory", "timeout"}  # what a second attempt may cure

Pairs = list[tuple[Planned, Standing]]
Costed = list[tuple[Planned, Cost]]


@dataclass(frozen=True, kw_only=True)
class Reports:
    """Where the reports go; page and data stand beside each other. None: that one is not written."""

    data: Path | None = None
    page: Path | None = None
    junit: Path | None = None


@dataclass(frozen=True, kw_only=True)
class Batch:
    """What is to be baked, and how.

    flags : settings of bakes that were given by hand and have the last word: field -> value
    reading : how every asset is read
    state : the folder on this machine for the manifest and the lock
    force : bakes what stands as well; prune : removes outputs of assets that are there no more
    command : what the lock tells others of this run
    """

    source: Place
    target: Place
    settings: BatchSettings = field(default_factory=BatchSettings)
    flags: Mapping[str, object] = field(default_factory=dict)
    reading: Reading = field(default_factory=Reading)
    state: Path
    reports: Reports = field(default_factory=Reports)
    force: bool = False
    prune: bool = False
    command: str = "aobake batch"


@dataclass(frozen=True, kw_only=True)
class Ended:
    """What became of a batch.

    stale : outputs in the target of assets that are there no more, and that are still there
    pruned : those that were removed, or not, when that was asked for
    interrupted : whether it was stopped; what had not begun is baked by the next run
    """

    totals: Totals
    stale: tuple[str, ...]
    pruned: Pruned | None
    interrupted: bool
    leftovers: tuple[str, ...]


def compare(batch: Batch) -> Pairs:
    """Every job of a batch with what an earlier run left of it; writes nothing.

    Raises what plan_batch and Manifest.open do.
    """
    file = batch.state / "batch.sqlite"
    planned = _planned(batch)
    with Manifest.open(file if file.exists() else None, batch.source, batch.target) as manifest:
        return list(zip(planned, manifest.standings(planned), strict=True))


def run_batch(
    batch: Batch,
    executor: Callable[[], AbstractContextManager[Executor]],
    *,
    watcher: Watcher = SILENT,
    stop: threading.Event | None = None,
) -> Ended:
    """Bake a batch; assets that cannot be baked fail alone.

    executor : makes what runs the tasks; called only where there is something to run
    watcher : is told what happens, in the calling thread
    stop : when set, nothing more begins, and what runs has settings.grace seconds to end
    Raises SettingsError for settings that do not fit; OutputError where another batch writes into the same
    target, or the manifest or a report cannot be written: what was baked until then stands.
    """
    began = datetime.now(UTC)
    stop = stop or threading.Event()
    planned = _planned(batch)
    make_folder(batch.state)
    with hold(batch.state / "lock", command=batch.command):
        leftovers = _tidied(batch.target)
        with Manifest.open(batch.state / "batch.sqlite", batch.source, batch.target) as manifest:
            run = manifest.begin({"source": batch.source.name, "target": batch.target.name})
            pairs = list(zip(planned, manifest.standings(planned), strict=True))
            to_bake = _settled(batch, manifest, pairs, watcher)
            if to_bake and not stop.is_set():
                with executor() as workers:
                    _Run(batch, manifest, workers, watcher, stop).bake(to_bake)
            elif to_bake:
                manifest.note([job for job, _ in to_bake], "stopped", NOT_BEGUN)
            interrupted = stop.is_set()
            pruned = manifest.prune(planned) if batch.prune and not interrupted else None
            manifest.finish({"interrupted": interrupted})
            totals = totals_of(manifest.entries(run))
            facts = RunFacts(
                source=batch.source.name,
                target=batch.target.name,
                started=began,
                finished=datetime.now(UTC),
                interrupted=interrupted,
                settings=batch.settings,
                totals=totals,
            )
            _report(batch.reports, facts, manifest, run)
            stale = manifest.stale(planned)
    return Ended(
        totals=totals, stale=stale, pruned=pruned, interrupted=interrupted, leftovers=leftovers
    )


def _planned(batch: Batch) -> list[Planned]:
    found = plan_batch(batch.source, batch.target, batch.settings, batch.flags)
    return [replace(one, job=replace(one.job, reading=batch.reading)) for one in found]


def _tidied(target: Place) -> tuple[str, ...]:
    """What a killed run left in a target, which is removed."""
    if isinstance(target, RemoteFolder):
        return target.remove_leftovers()
    return remove_leftovers(target.path(""))


def _settled(batch: Batch, manifest: Manifest, pairs: Pairs, watcher: Watcher) -> Costed:
    """Note what needs no bake, reuse what was moved; what is left to bake, numbered."""
    refused = [(job, standing) for job, standing in pairs if standing.kind == "refused"]
    others = [(job, standing) for job, standing in pairs if standing.kind != "refused"]
    if batch.force:
        to_bake = others
    else:
        manifest.keep([pair for pair in others if pair[1].kind == "unchanged"])
        again = manifest.adopt([pair for pair in others if pair[1].kind == "moved"])
        to_bake = [pair for pair in others if pair[1].to_bake] + list(again)
    manifest.note([job for job, _ in refused], "failed")
    skipped = len(others) - len(to_bake)
    costed = [(pair[0], _cost(number, *pair)) for number, pair in enumerate(to_bake)]
    watcher.planned(len(pairs), skipped, sum(cost.seconds for _, cost in costed))
    for job, _ in refused:
        watcher.refused(job.source, job.refused)
    return costed


def _cost(number: int, planned: Planned, standing: Standing) -> Cost:
    return estimated(
        number, planned.job, planned.size, seconds=standing.seconds, peak=standing.peak_bytes
    )


class _Run:
    """The tasks of one run. It is told from outside to stop; nothing else changes it."""

    def __init__(
        self,
        batch: Batch,
        manifest: Manifest,
        executor: Executor,
        watcher: Watcher,
        stop: threading.Event,
    ) -> None:
        self._batch, self._manifest, self._executor = batch, manifest, executor
        self._watcher, self._stop = watcher, stop
        self._schedule = Schedule()
        self._attempts: dict[int, int] = {}
        self._settled: set[int] = set()
        self._jobs: Sequence[Planned] = ()
        self._costs: Sequence[Cost] = ()

    def bake(self, costed: Costed) -> None:
        """Start tasks as there is room for them, and record what becomes of each."""
        self._jobs = [planned for planned, _ in costed]
        self._costs = [cost for _, cost in costed]
        for cost in self._costs:
            self._schedule.add(cost)
        try:
            self._until_done()
        except Exception:
            # The executor may be used for another run, which must hear nothing of the tasks of this one.
            with contextlib.suppress(AobakeError):
                self._executor.stop(0.0)
            raise

    def _until_done(self) -> None:
        self._start_some()
        while (self._schedule.pending or self._schedule.running) and not self._stop.is_set():
            outcomes = self._executor.finished(POLL_S)
            ended = self._without_retries(outcomes)
            self._start_some()  # before anything is recorded: no worker waits for a disk
            self._record(ended)
            self._watcher.tick()
        if self._stop.is_set():
            grace = self._batch.settings.grace
            self._watcher.stopping(self._schedule.running, grace)
            self._record(self._without_retries(self._executor.stop(grace)))
            rest = [job for number, job in enumerate(self._jobs) if number not in self._settled]
            self._manifest.note(rest, "stopped", NOT_BEGUN)

    def _start_some(self) -> None:
        if self._stop.is_set():
            return
        for number, threads in self._schedule.next(self._executor.capacity, time.monotonic()):
            self._attempts[number] = self._attempts.get(number, 0) + 1
            task = self._task(number, threads)
            self._executor.start(task)
            self._watcher.started(task, self._costs[number].seconds)

    def _task(self, number: int, threads: int) -> Task:
        batch, settings = self._batch, self._batch.settings
        source, target = _local(batch.source), _local(batch.target)
        return Task(
            number=number,
            job=self._jobs[number].job,
            threads=threads,
            pictures=settings.pictures,
            memory=settings.memory_bytes,
            timeout=settings.timeout,
            attempt=self._attempts[number],
            source=source,
            target=target,
            remote=_remote(batch.source, batch.target),
        )

    def _without_retries(self, outcomes: Iterable[Outcome]) -> list[Outcome]:
        """Give back what the tasks held, put those that are tried again into the queue; the others."""
        last = []
        for outcome in outcomes:
            number = outcome.number
            self._schedule.ended(number)
            left = self._batch.settings.retries + 1 - self._attempts[number]
            if outcome.status in AGAIN and left > 0 and not self._stop.is_set():
                self._schedule.add(self._costs[number])
                self._watcher.ended(outcome, again=True)
            else:
                last.append(outcome)
        return last

    def _record(self, outcomes: Iterable[Outcome]) -> None:
        for outcome in outcomes:
            number, pictures = outcome.number, dict(outcome.pictures)
            page, viewer = self._batch.reports.page, pictures.pop("viewer", None)
            if page is not None and viewer is not None:
                from aobake.batch.page import keep_viewer

                keep_viewer(page, self._jobs[number].target, viewer)
            shown = replace(outcome, pictures=pictures)
            self._manifest.record(self._jobs[number], shown, attempts=self._attempts[number])
            self._settled.add(number)
            self._watcher.ended(outcome)


def _local(place: Place) -> Path | None:
    return place.path("") if isinstance(place, LocalFolder) else None


def _remote(source: Place, target: Place) -> Remote | None:
    """Where workers find a batch of which a folder is not on this machine."""
    if not isinstance(source, RemoteFolder) and not isinstance(target, RemoteFolder):
        return None
    urls = [
        place.name if isinstance(place, RemoteFolder) else str(place.path(""))
        for place in (source, target)
    ]
    return Remote(source=urls[0], target=urls[1])


def _report(reports: Reports, facts: RunFacts, manifest: Manifest, run: int) -> None:
    if reports.data is not None:
        write_json(reports.data, facts, manifest.entries(run))
    if reports.junit is not None:
        from aobake.batch.junit import write_junit

        write_junit(reports.junit, facts, manifest.entries(run))
    if reports.page is not None:
        from aobake.batch.page import write_page

        write_page(
            reports.page,
            facts,
            manifest.entries(run),
            lambda entry: manifest.pictures(entry.target),
        )

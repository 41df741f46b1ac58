"""An executor on a cluster: tasks go to the workers of a dask scheduler. The one file that knows dask.

Dask brings tasks to workers, and to other ones where a worker is lost. Everything else it leaves to
cluster_worker.perform, which does each task as on one machine: in a process of its own, within its limits.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import queue
import secrets
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from aobake import __version__
from aobake.batch.closing import Closing
from aobake.batch.cluster_worker import end, perform, retire, unseen
from aobake.batch.places import LocalFolder, Place
from aobake.batch.roster import Roster, gone
from aobake.batch.tasks import Capacity, Executor, Outcome, Status, Task
from aobake.batch.tiles import TiledExecutor
from aobake.errors import OutputError, SettingsError
from aobake.files import PART

if TYPE_CHECKING:
    from distributed import Client, Future

__all__ = ["ClusterExecutor", "on_cluster"]

PATIENCE_S = 30.0  # for the scheduler to answer, and for the first worker to come
GATHER_S = 60.0  # for an outcome to come over; its worker may be lost meanwhile
CLOSE_S = 5.0  # to say goodbye; nobody may be there to hear it
END_S = 15.0  # for workers to end what they were told to end
DOCS = "docs/cluster.md"


@dataclass(frozen=True, eq=False)
class _Sent:
    """A task on its way; worker : the address where it was sent first."""

    key: str
    task: Task
    future: Future[Outcome]
    worker: str


@contextlib.contextmanager
def on_cluster(
    address: str, source: Place, target: Place, tiles: Literal["auto", "on", "off"] = "auto"
) -> Iterator[Executor]:
    """An executor on a cluster whose workers are known to reach both folders, and that cuts textures in tiles.

    Raises what ClusterExecutor and its check_shared do.
    """
    cluster = ClusterExecutor(address)
    with TiledExecutor(cluster, tiles) as executor:
        folders = [
            place.path("") if isinstance(place, LocalFolder) else None for place in (source, target)
        ]
        cluster.check_shared(*folders)
        yield executor


class ClusterExecutor(Closing):
    """Runs tasks on the workers of a dask cluster. Close it, or use it as a context."""

    def __init__(self, address: str, *, patience: float = PATIENCE_S) -> None:
        """Connect to a scheduler.

        address : tcp://HOST:PORT, or tls://HOST:PORT with the certificates that dask's own settings name
        patience : seconds to wait for the scheduler to answer, and for a first worker
        Raises SettingsError where nobody answers, where there is no worker, and where one has another version
        of aobake.
        """
        _refuse(address)
        self._address = address
        self._batch = secrets.token_hex(8)
        self._sent: dict[str, _Sent] = {}
        self._ended: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._stopping = False
        self._is_gone = False  # the scheduler
        with contextlib.ExitStack() as done:
            done.enter_context(_silent())
            self._client = _connected(address, patience)
            done.callback(self._leave)
            self._roster = Roster(self._client, address)
            self._roster.await_first(patience)
            self._done = done.pop_all()

    @property
    def capacity(self) -> Capacity:
        """What the workers have that are there now."""
        return self._roster.capacity()

    def check_shared(self, source: Path | None, target: Path | None) -> None:
        """Raise SettingsError where a worker does not see these folders at the same place as this machine.

        source, target : folders that are there, None: in a store; OutputError where nothing can be written into
        the second
        """
        content = secrets.token_hex(16)
        with _probe(target, content) as probe:
            asked = ("" if source is None else str(source), probe, content)
            told = self._client.run(unseen, *asked, on_error="ignore")
        for worker, folder in sorted(told.items()):
            if folder:
                raise SettingsError(
                    f"{folder}: the worker {worker} does not see this folder, or may not use it. Mount it at "
                    f"the same place on every machine, or keep assets and outputs in a store ({DOCS})."
                )

    def start(self, task: Task) -> None:
        """Take a task; returns at once. It goes to the worker that has the most threads to spare."""
        worker = self._roster.freest(
            [(sent.worker, sent.task.threads) for sent in self._sent.values()]
        )
        key = f"aobake-{self._batch}-{task.number}-{secrets.token_hex(4)}"
        future = self._client.submit(
            perform,
            task,
            self._batch,
            __version__,
            key=key,
            pure=False,
            workers=[worker] if worker else None,
            allow_other_workers=bool(worker),  # where that one is lost
        )
        self._sent[key] = _Sent(key, task, future, worker)
        self._await(self._sent[key])

    def finished(self, timeout: float) -> Sequence[Outcome]:
        """Outcomes since the last call; waits up to `timeout` seconds for the first.

        Raises EngineError where the scheduler is gone.
        """
        keys = []
        with contextlib.suppress(queue.Empty):
            keys.append(self._ended.get(timeout=max(0.0, timeout)))
            while True:
                keys.append(self._ended.get_nowait())
        outcomes = []
        for key in keys:
            sent = self._sent.get(key)
            outcome = None if sent is None else self._outcome(sent)
            if outcome is not None:
                self._forget(key)
                outcomes.append(outcome)
        if self._is_gone and not outcomes:
            raise gone(self._address)
        return outcomes

    def stop(self, grace: float) -> Sequence[Outcome]:
        """Let running tasks end for `grace` seconds, end the others ("stopped"); their outcomes."""
        self._stopping = True
        outcomes = self._until(time.monotonic() + grace)
        if self._sent:
            self._everywhere(end, self._batch)
            outcomes += self._until(time.monotonic() + END_S)
        for key, sent in list(self._sent.items()):
            outcomes.append(
                _failed(sent.task, "stopped", "the batch was stopped before it was done.")
            )
            self._forget(key)
        return outcomes

    def close(self) -> None:
        """Leave the cluster. Its workers stay; what they were doing for this batch is ended."""
        self._done.close()

    def _leave(self) -> None:
        if self._sent:
            self._everywhere(end, self._batch)
        for key in list(self._sent):
            self._forget(key)
        self._everywhere(retire)
        self._client.close(timeout=CLOSE_S)

    def _await(self, sent: _Sent) -> None:
        sent.future.add_done_callback(lambda _: self._ended.put(sent.key))

    def _until(self, moment: float) -> list[Outcome]:
        outcomes: list[Outcome] = []
        while self._sent and (left := moment - time.monotonic()) > 0.0:
            outcomes += self.finished(left)
        return outcomes

    def _outcome(self, sent: _Sent) -> Outcome | None:
        """What became of a task; None where it is under way again, or the scheduler is gone."""
        status = sent.future.status
        if status == "finished":
            try:
                return sent.future.result(timeout=GATHER_S)
            except TimeoutError:  # its worker was lost at the end, so it is baked again
                self._await(sent)
                return None
            except Exception as error:  # noqa: BLE001 - the same, and it ended otherwise this time
                return _lost(sent.task, error)
        if status == "error":
            return _lost(sent.task, sent.future.exception())
        if self._stopping:
            return _failed(sent.task, "stopped", "the batch was stopped before it was done.")
        self._is_gone = True
        return None

    def _forget(self, key: str) -> None:
        sent = self._sent.pop(key)
        with contextlib.suppress(Exception):
            sent.future.cancel() if sent.future.status == "pending" else sent.future.release()

    def _everywhere(self, function: Callable[..., None], *arguments: str) -> None:
        """Call one of ours on every worker; those that do not answer are lost anyway."""
        if self._client.status != "running":  # it would wait for the scheduler to come back
            return
        with contextlib.suppress(Exception):
            self._client.run(function, *arguments, on_error="ignore")


@contextlib.contextmanager
def _probe(folder: Path | None, content: str) -> Iterator[str]:
    """A file with this content for a while; '' without a folder."""
    if folder is None:
        yield ""
        return
    try:
        file = tempfile.NamedTemporaryFile(  # noqa: SIM115 - below, where errors are others
            "w", prefix=PART, suffix=".part", dir=folder, encoding="ascii"
        )
    except OSError as error:
        why = error.strerror or error
        raise OutputError(f"{folder}: nothing can be written there ({why}).") from error
    with file:
        file.write(content)
        file.flush()
        yield file.name


def _refuse(address: str) -> None:
    """Raise SettingsError for what is no address, and where dask is missing."""
    if "://" not in address:
        raise SettingsError(
            f"{address}: this is not the address of a scheduler. Give it as tcp://HOST:8786."
        )
    try:
        import distributed  # noqa: F401 - now: its import sets the levels that _silent changes
    except ImportError as error:
        raise SettingsError(
            f"{address}: a cluster needs the package distributed, not installed here. "
            'Install the extra: pip install "aobake[cluster]".'
        ) from error


def _connected(address: str, patience: float) -> Client:
    from distributed import Client

    try:
        _knock(address, patience)
        return Client(address, timeout=patience, set_as_default=False, name="aobake")
    except Exception as error:  # dask raises whatever its network and its certificates do
        why = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise SettingsError(
            f"{address}: no scheduler can be reached there ({why[:160]}). Start one with dask scheduler; for "
            f"tls:// name the certificates in dask's settings ({DOCS})."
        ) from error


def _knock(address: str, patience: float) -> None:
    """Raise whatever dask does where nobody answers. A Client that fails takes a minute, and speaks while it dies."""
    from distributed import Security
    from distributed.comm.core import connect

    async def knock() -> None:
        arguments = Security().get_connection_args("client")
        comm = await connect(address, timeout=patience, **arguments)
        await comm.close()

    # This thread may have a loop of its own, as that of a notebook does.
    with ThreadPoolExecutor(1) as apart:
        apart.submit(asyncio.run, knock()).result()


def _lost(task: Task, error: BaseException | None) -> Outcome:
    """The outcome of a task that came to nothing outside of its own process."""
    from distributed.scheduler import KilledWorker

    if isinstance(error, KilledWorker):
        times = error.allowed_failures + 1
        why = f"{times} workers were lost while they baked it; the last was {error.last_worker.address}."
        return _failed(task, "crashed", why)
    text = (str(error).splitlines() or [""])[0][:160]
    return _failed(task, "failed", f"a worker cannot do it ({type(error).__name__}: {text}).")


def _failed(task: Task, status: Status, why: str) -> Outcome:
    return Outcome(number=task.number, status=status, reason=f"{task.job.input}: {why}")


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Within it dask does not log to stderr: whatever matters is in an outcome or an error."""
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)

"""Which workers a cluster has now, what they have to give, and whether they can do our work."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from aobake import __version__
from aobake.batch.cluster_worker import about
from aobake.batch.tasks import Capacity
from aobake.errors import EngineError, SettingsError

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["Roster", "gone"]

LOOK_S = 1.0  # between two looks at which workers there are
NO_LIMIT = 1 << 62  # bytes of memory of a worker that was given no limit


@dataclass(frozen=True)
class _Worker:
    threads: int
    memory: int


class Roster:
    """The workers of a scheduler, looked up now and then. Those with another aobake are not used."""

    def __init__(self, client: Client, address: str) -> None:
        """Look up nothing yet. address : of the scheduler, for messages"""
        self._client = client
        self._address = address
        self._workers: dict[str, _Worker] = {}
        self._others: dict[str, str] = {}  # workers that are not used -> their version of aobake
        self._looked = -LOOK_S

    def capacity(self) -> Capacity:
        """What all of them have to give. Raises EngineError where the scheduler is gone."""
        self._look()
        workers = self._workers.values()
        return Capacity(
            threads=sum(worker.threads for worker in workers),
            most_threads=max((worker.threads for worker in workers), default=1),
            memory=min(NO_LIMIT, sum(worker.memory for worker in workers)),
            workers=len(workers),
        )

    def freest(self, load: Iterable[tuple[str, int]]) -> str:
        """The worker with the most threads to spare; '' where there is none.

        load : a worker and the threads of a task that it has, for each task
        Raises EngineError where the scheduler is gone.
        """
        self._look()
        spare = {address: worker.threads for address, worker in self._workers.items()}
        for address, threads in load:
            if address in spare:
                spare[address] -= threads
        return max(spare, key=lambda address: (spare[address], address), default="")

    def await_first(self, patience: float) -> None:
        """Wait for a worker. Raises SettingsError where none comes, and where one has another aobake."""
        until = time.monotonic() + patience
        while True:
            self._looked = -LOOK_S
            self._look()
            for address, version in self._others.items():
                raise SettingsError(
                    f"{self._address}: its worker {address} has aobake {version}, and this machine has "
                    f"{__version__}. Install the same version everywhere."
                )
            if self._workers:
                return
            if time.monotonic() > until:
                raise SettingsError(
                    f"{self._address}: the scheduler has no worker. Start one: dask worker {self._address}"
                )
            time.sleep(0.1)

    def _look(self) -> None:
        if time.monotonic() - self._looked < LOOK_S:
            return
        try:
            found = self._client.scheduler_info(n_workers=-1)["workers"]
            known = self._workers.keys() | self._others.keys()
            new = [address for address in found if address not in known]
            versions = self._client.run(about, workers=new, on_error="return") if new else {}
        except Exception as error:  # dask raises whatever its network does
            raise gone(self._address, error) from error
        self._others |= {
            address: version if isinstance(version, str) else "missing"
            for address, version in versions.items()
            if version != __version__
        }
        self._workers = {
            address: _Worker(facts["nthreads"], facts["memory_limit"] or NO_LIMIT)
            for address, facts in found.items()
            if facts.get("status", "running") == "running" and address not in self._others
        }
        self._looked = time.monotonic()


def gone(address: str, error: Exception | None = None) -> EngineError:
    """What to raise where a scheduler was lost."""
    why = f" ({str(error).splitlines()[0][:160]})" if error is not None and str(error) else ""
    return EngineError(
        f"{address}: the scheduler is gone{why}. Start it and the batch again: what was done, is done."
    )

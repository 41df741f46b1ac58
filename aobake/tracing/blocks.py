"""Blocks of points over threads: small enough to stop promptly, large enough to cost nothing."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

import numpy as np
from numpy.typing import NDArray

__all__ = ["over_blocks"]

IntArray = NDArray[np.int64]

BLOCK_RAYS = 1 << 18  # about 40 ms of one thread
LEAST_BLOCK_RAYS = 1 << 14
MOST_POINTS = 4096
POLL_SECONDS = 0.1


def over_blocks(
    pool: ThreadPoolExecutor,
    stop: threading.Event,
    function: Callable[[IntArray], None],
    points: IntArray,
    rays: int,
    progress: Callable[[int], None] | None,
) -> None:
    """Call a function for all points, in blocks, in the threads of the pool.

    rays : of a point, in the mean
    """

    def run(block: IntArray) -> int:
        if not stop.is_set():
            function(block)
        return len(block)

    threads = pool._max_workers  # noqa: SLF001 - as many as it was made with
    blocks = [points[block] for block in _blocks(len(points), rays, threads)]
    _watch([pool.submit(run, block) for block in blocks], progress)


def _blocks(count: int, rays: int, threads: int) -> Iterator[slice]:
    """Blocks of points, smaller towards the end, so that no thread waits long for the last one.

    Source: guided self-scheduling, C. Polychronopoulos, D. Kuck, IEEE Transactions on Computers 36, 1987.
    """
    most, least = max(1, BLOCK_RAYS // rays), max(1, LEAST_BLOCK_RAYS // rays)
    first = 0
    while first < count:
        size = min(most, MOST_POINTS, max(least, (count - first) // (4 * threads)))
        yield slice(first, min(first + size, count))
        first += size


def _watch(pending: Sequence[Future[int]], progress: Callable[[int], None] | None) -> None:
    """Wait for all blocks, waking up often enough to notice an interrupt and to report."""
    done, waiting = 0, set(pending)
    while waiting:
        finished, waiting = wait(waiting, POLL_SECONDS, FIRST_COMPLETED)
        done += sum(future.result() for future in finished)
        if progress is not None:
            progress(done)

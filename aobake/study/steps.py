"""The steps of a study, counted for whoever shows how far it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

__all__ = ["Progress", "Steps"]

Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with (stage, done, total); whatever it raises stops the study."""


class Steps:
    """Counts steps for a progress bar."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._done, self._total = progress, 0, total

    def next(self, stage: str) -> None:
        """A step begins."""
        if self._progress is not None:
            self._progress(stage, self._done, self._total)
        self._done += 1

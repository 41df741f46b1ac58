"""The settings of a batch: the one source of its flags, defaults and help."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal, get_args

from aobake.checks import check_choice, check_whole, check_words
from aobake.config import COMMANDS, Command
from aobake.errors import SettingsError
from aobake.patterns import pattern

__all__ = ["BatchSettings", "Pictures", "Tiles"]

Pictures = Literal["none", "thumbnails", "viewers"]
Tiles = Literal["auto", "on", "off"]

MEMORY = re.compile(r"(\d{1,9}(?:\.\d{1,9})?) ?(?:([KMGT])(I?)B?|B)?", re.IGNORECASE | re.ASCII)
POWERS = {"": 0, "K": 1, "M": 2, "G": 3, "T": 4}
LEAST_MEMORY = (
    64 * 2**20
)  # less than an empty worker holds; a number without a unit would mean bytes
MOST_PROCESSES, MOST_RETRIES = 4096, 100


@dataclass(frozen=True, kw_only=True)
class BatchSettings:
    """What is baked in a folder, and how the work is run.

    Only bake, format and preset change a byte of what is written. Threads, of all assets together, are a
    setting of the bake.
    """

    bake: tuple[Command, ...] = ("vertex",)
    """What to bake. Both, once for each: outputs then end in _vertex and _texture."""

    format: str | None = None
    """Ending of the outputs, such as glb. None: that of the asset where it can hold the result, else glb."""

    preset: str | None = None
    """Name of a [preset.NAME] in aobake.toml that applies to every asset, unless a pattern names another."""

    only: tuple[str, ...] = ()
    """Takes only assets whose path below the folder fits, such as props/**/*.glb. Once for each."""

    skip: tuple[str, ...] = ()
    """Leaves out assets and folders whose path fits. Once for each."""

    processes: int | None = None
    """Assets that are baked at the same time. None: as many as threads and memory allow."""

    memory_per_job: str | None = None
    """Memory that an asset may take before it is given up, such as 4GB. None: no limit."""

    timeout: float | None = None
    """Seconds that an asset may take before it is given up. None: no limit."""

    retries: int = 0
    """How often an asset is tried again whose process crashed, ran out of memory or of time."""

    grace: float = 10.0
    """Seconds that running assets may still take when the batch is interrupted."""

    pictures: Pictures = "thumbnails"
    """What the page shows of each asset: nothing, pictures before and after, or a viewer as well."""

    tiles: Tiles = "auto"
    """Whether a texture is cut into tiles that several workers of a cluster trace: auto cuts those of 4096
    texels a side and more. The result is the same."""

    def __post_init__(self) -> None:
        _word("preset", self.preset, "the name of a preset")
        _word("format", self.format, "an ending such as glb")
        self._settle_bake()
        self._settle_format()
        for name in ("only", "skip"):
            object.__setattr__(self, name, _patterns(name, getattr(self, name)))
        if self.processes is not None:
            check_whole("processes", self.processes, 1, MOST_PROCESSES)
        _ = self.memory_bytes
        if self.timeout is not None:
            _seconds("timeout", self.timeout, above_0=True)
        check_whole("retries", self.retries, 0, MOST_RETRIES)
        _seconds("grace", self.grace, above_0=False)
        check_choice("pictures", self.pictures, get_args(Pictures))
        check_choice("tiles", self.tiles, get_args(Tiles))

    @property
    def memory_bytes(self) -> int | None:
        """What memory_per_job says, in bytes; None for no limit. GB counts in powers of 1000, GiB of 1024."""
        given: object = self.memory_per_job
        if given is None:
            return None
        found = MEMORY.fullmatch(given.strip()) if isinstance(given, str) else None
        if found is None:
            raise SettingsError(
                f"memory_per_job is {given!r}; a size is needed, such as 4GB or 512MiB."
            )
        number, unit, binary = found.groups(default="")
        size = float(number) * (1024 if binary else 1000) ** POWERS[unit.upper()]
        if size < LEAST_MEMORY:
            raise SettingsError(
                f"memory_per_job is {given!r}; at least {LEAST_MEMORY // 2**20} MiB are needed, and a unit."
            )
        return int(size)

    def _settle_bake(self) -> None:
        given: object = self.bake
        several = [given] if isinstance(given, str) else given
        if not isinstance(several, list | tuple) or not several:
            raise SettingsError(f"bake is {given!r}; {' or '.join(COMMANDS)}, or both, is needed.")
        for word in several:
            check_choice("bake", word, COMMANDS)
        object.__setattr__(self, "bake", tuple(word for word in COMMANDS if word in several))

    def _settle_format(self) -> None:
        if self.format is None:
            return
        ending = self.format.lstrip(".").lower()
        if not ending.isalnum():
            raise SettingsError(f"format is {self.format!r}; an ending such as glb is needed.")
        object.__setattr__(self, "format", ending)


def _patterns(name: str, given: object) -> tuple[str, ...]:
    several = check_words(name, given)
    for words in several:
        try:
            pattern(words)
        except SettingsError as error:
            raise SettingsError(f"{name} {error}") from error
    return several


def _word(name: str, given: object, needed: str) -> None:
    if given is not None and not isinstance(given, str):
        raise SettingsError(f"{name} is {given!r}; {needed} is needed.")


def _seconds(name: str, value: object, *, above_0: bool) -> None:
    number = value if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    if not (0.0 < number < math.inf or (number == 0.0 and not above_0)):
        raise SettingsError(
            f"{name} is {value!r}; seconds{' above 0' if above_0 else ''} are needed."
        )

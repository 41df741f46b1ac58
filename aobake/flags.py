"""Settings in the words of the command line."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

from aobake.settings import (
    AtlasSettings,
    ImageSettings,
    StoreSettings,
    TraceSettings,
    VertexSettings,
)

if TYPE_CHECKING:
    from aobake.jobs import Job

__all__ = ["as_flags", "changed_settings", "command_line", "flag_name", "in_flags"]

TAKEN = {
    "vertex": (StoreSettings, VertexSettings, TraceSettings),
    "texture": (ImageSettings, AtlasSettings, TraceSettings),
}
"""Command -> the settings that it has flags for."""


def flag_name(field: str) -> str:
    """The flag of a field of the settings: max_distance -> --max-distance."""
    return f"--{field.replace('_', '-')}"


def as_flags(text: str, settings: type) -> str:
    """What is said of settings, in the words of the command line: flags, and None as what is left out."""
    for field in dataclasses.fields(settings):
        if "_" in field.name:
            text = re.sub(rf"\b{field.name}\b", flag_name(field.name), text)
    return re.sub(r"(\()?None:", lambda found: "(left out:" if found[1] else "Left out:", text)


def in_flags(message: str, settings: type) -> str:
    """A message about settings, which begins with the name of one, in the words of the command line."""
    name, _, rest = message.partition(" ")
    known = {field.name for field in dataclasses.fields(settings)}
    return as_flags(f"{flag_name(name)} {rest}" if name in known else message, settings)


def changed_settings(job: Job) -> list[str]:
    """The settings of a job that matter to it and are not the defaults, as flags: --max-distance=2.0."""
    chosen = job.chosen
    values = {
        name: value
        for settings in (chosen.bake, chosen.store, chosen.image)
        for name, value in dataclasses.asdict(settings).items()
    }
    return [
        flag
        for kind in TAKEN[job.command]
        for field in dataclasses.fields(kind)
        if values[field.name] != field.default
        for flag in _flags(field.name, values[field.name])
    ]


def command_line(job: Job, threads: int | None = None) -> list[str]:
    """The words of the command that does a job alone, whatever any aobake.toml says; it replaces the output.

    threads : that it may use, where that is not for the settings to say; they change nothing in the result
    """
    words = [flag for flag in changed_settings(job) if threads is None or "--threads=" not in flag]
    reading = [flag for name, value in vars(job.reading).items() for flag in _flags(name, value)]
    return [
        "aobake",
        job.command,
        str(job.input),
        f"--output={job.output}",
        "--force",
        "--no-config",
        *reading,
        *words,
        *([] if threads is None else [f"--threads={threads}"]),
    ]


def _flags(name: str, value: object) -> Iterator[str]:
    """The flag that gives a setting its value: one, or one for each word; none for what was left out."""
    if value is True:
        yield flag_name(name)
    elif isinstance(value, tuple):
        yield from (f"{flag_name(name)}={word}" for word in value)
    elif value is not None:
        yield f"{flag_name(name)}={value}"

"""What a batch bakes: the assets in a folder, the settings of each, and where its outputs go."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath

from aobake.batch.choices import Choices, configs_of
from aobake.batch.outputs import check_format, output_name, without_clashes
from aobake.batch.places import Found, LocalFolder, Place
from aobake.batch.settings import BatchSettings
from aobake.batch.tasks import Planned
from aobake.config import Command, Configured, configured
from aobake.errors import SettingsError
from aobake.jobs import Job
from aobake.meshes.formats import READABLE
from aobake.patterns import Pattern, pattern

__all__ = ["plan_batch"]


def plan_batch(
    source: Place,
    target: Place,
    settings: BatchSettings,
    flags: Mapping[str, object] | None = None,
) -> list[Planned]:
    """The jobs of a batch, sorted by the names of their assets; nothing is written.

    flags : settings of bakes, which have the last word
    An asset that cannot be baked is planned as refused, with the reason: it cannot be read, an aobake.toml
    above it is wrong, or another asset has the same output. Empty where there is no asset.
    Raises SettingsError for settings and flags that fit no asset, and for a target that lies in the source
    (unless it is excluded) or around it; InputError where the source cannot be read.
    """
    excluded = [pattern(words) for words in settings.skip]
    included = [pattern(words) for words in settings.only]
    _check_apart(source, target, excluded)
    if settings.format is not None:
        for command in settings.bake:
            check_format(command, settings.format)
    found = list(source.files(lambda folder: not _left_out(folder, excluded)))
    choices = Choices(configs_of(source, found), settings, flags or {})
    nothing = configured(None)
    planned = (
        one
        for file in found
        if _is_wanted(file, included, excluded)
        for one in _planned(file, source, target, choices, nothing)
    )
    return list(without_clashes(planned))


def _left_out(folder: str, excluded: Sequence[Pattern]) -> bool:
    return _is_hidden(folder) or any(words.takes(folder) for words in excluded)


def _is_hidden(name: str) -> bool:
    """What begins with a dot: version control, the state of a batch, the shadows (._chair.glb) of a Mac."""
    return name.rpartition("/")[2].startswith(".")


def _is_wanted(file: Found, included: Sequence[Pattern], excluded: Sequence[Pattern]) -> bool:
    """Whether it is an asset to bake, or a folder that cannot be read and may hold some."""
    if file.folder:
        return True
    return (
        PurePosixPath(file.name).suffix.lower() in READABLE
        and not _is_hidden(file.name)
        and (not included or any(words.fits(file.name) for words in included))
        and not any(words.fits(file.name) for words in excluded)
    )


def _planned(
    file: Found, source: Place, target: Place, choices: Choices, nothing: Configured
) -> Iterator[Planned]:
    """The jobs of an asset: none, one, or one for each command. nothing : settings for what is refused"""
    path = source.path(file.name)

    def planned(command: Command, name: str, chosen: Configured, refused: str = "") -> Planned:
        job = Job(command=command, input=path, output=target.path(name), chosen=chosen)
        reason = " ".join(refused.splitlines())  # a file may have a line break in its name
        size = file.stamp.size
        shown = "" if reason else name
        return Planned(source=file.name, target=shown, job=job, size=size, refused=reason)

    command = choices.settings.bake[0]
    if file.problem:
        yield planned(command, file.name, nothing, f"{path}: {file.problem}")
        return
    choice = choices.of(path.as_posix())
    if isinstance(choice, str):
        yield planned(command, file.name, nothing, choice)
        return
    for command in () if choice.skip else choice.bake:
        try:
            name = output_name(file.name, command, choice.format, alone=len(choice.bake) == 1)
            yield planned(command, name, choice.chosen)
        except SettingsError as error:
            yield planned(command, file.name, choice.chosen, f"{path}: {error}")


def _check_apart(source: Place, target: Place, excluded: Sequence[Pattern]) -> None:
    """Raise SettingsError where outputs would lie among assets, or assets among outputs."""
    assets, outputs = _spot(source), _spot(target)
    if assets == outputs:
        raise SettingsError(
            f"{target.name}: the assets are in this folder. Write the outputs somewhere else."
        )
    if assets.startswith(f"{outputs.rstrip('/')}/"):
        raise SettingsError(
            f"{target.name}: the folder of the assets, {source.name}, lies in it. Write the outputs elsewhere."
        )
    if outputs.startswith(f"{assets.rstrip('/')}/"):
        way = outputs[len(assets.rstrip("/")) + 1 :].split("/")
        folders = ["/".join(way[: depth + 1]) for depth in range(len(way))]
        if not any(_left_out(folder, excluded) for folder in folders):
            raise SettingsError(
                f"{target.name}: this folder is among the assets of {source.name}, and outputs would be baked "
                f"again. Leave it out (--skip {'/'.join(way)}/), or write the outputs somewhere else."
            )


def _spot(place: Place) -> str:
    """Where a place really is."""
    if isinstance(place, LocalFolder):
        return Path(os.path.realpath(place.folder)).as_posix()
    return place.name.rstrip("/")

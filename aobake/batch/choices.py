"""What applies to each asset of a batch: its settings, and what the batch makes of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from aobake.batch.places import Found, LocalFolder, Place
from aobake.batch.settings import BatchSettings
from aobake.config import NAME, Command, Configs, Configured, Layer, layers, local_configs, settled
from aobake.config_file import MOST_BYTES, ConfigFile, parsed
from aobake.errors import InputError, SettingsError

__all__ = ["Choice", "Choices", "configs_of"]


@dataclass(frozen=True, kw_only=True)
class Choice:
    """bake : what is baked; format : the ending of the output, None to keep it; skip : whether it is left out."""

    chosen: Configured
    bake: tuple[Command, ...]
    format: str | None
    skip: bool


@dataclass(frozen=True)
class Choices:
    """Puts settings together, once for all assets that the same tables apply to."""

    configs: Configs
    settings: BatchSettings
    flags: Mapping[str, object]
    made: dict[tuple[Layer, ...], Choice | str] = field(default_factory=dict)

    def of(self, asset: str) -> Choice | str:
        """What applies to an asset, or in one line what is wrong with the aobake.toml files above it.

        asset : its path in terms of the configs
        Raises SettingsError where it is a flag that is wrong.
        """
        try:
            above = self.configs.above(asset)
            found = layers(asset, above, None)
        except SettingsError as error:
            return str(error)
        if self.settings.preset is not None:
            found = layers(asset, above, self.settings.preset)
        if found not in self.made:
            self.made[found] = self._made(found)
        return self.made[found]

    def _made(self, found: tuple[Layer, ...]) -> Choice | str:
        try:
            chosen = settled(found, self.flags)
        except SettingsError:
            wrong = _wrong(found)
            if wrong:
                return wrong
            raise
        bake, ending, skip = self.settings.bake, self.settings.format, False
        for layer in found:
            bake = bake if layer.bake is None else layer.bake
            ending = ending if layer.format is None else layer.format
            skip = skip if layer.skip is None else layer.skip
        return Choice(chosen=chosen, bake=bake, format=ending, skip=skip)


def _wrong(found: Sequence[Layer]) -> str:
    """What is wrong with layers also without any flag; '' where nothing is."""
    try:
        settled(found, {})
    except SettingsError as error:
        return str(error)
    return ""


def configs_of(source: Place, found: Sequence[Found]) -> Configs:
    """The aobake.toml files that count for a batch: of a folder on this machine also those above it.

    found : everything in the source
    """
    if isinstance(source, LocalFolder):
        return local_configs()
    there = {file.name for file in found if not file.problem}

    def look(folder: str) -> ConfigFile | None:
        name = f"{folder}/{NAME}" if folder else NAME
        if name not in there:
            return None
        try:
            return parsed(Path(name), source.read(name, MOST_BYTES + 1))
        except InputError as error:
            raise SettingsError(str(error)) from error

    return Configs(look)

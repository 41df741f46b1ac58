"""Settings as they were asked for: defaults, then every aobake.toml above the asset, then flags.

    files  ->  layers, weakest first  ->  Configured

Files come from the topmost folder down to the asset's own, and the nearest has the last word, key by key.
In a file, what it says of everything is followed by its presets and its patterns, in the order written.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from aobake.config_file import COMMANDS, NAME, Command, ConfigFile, FilePattern, Layer, read
from aobake.errors import SettingsError, nearest
from aobake.flags import in_flags
from aobake.render_settings import RenderSettings
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

__all__ = [
    "COMMANDS",
    "NAME",
    "Command",
    "Configs",
    "Configured",
    "Layer",
    "configured",
    "layers",
    "local_configs",
    "rendering",
    "settled",
]

MOST_LETTERS = 400  # of a message that quotes a file

T = TypeVar("T", BakeSettings, StoreSettings, ImageSettings, RenderSettings)


@dataclass(frozen=True, kw_only=True)
class Configured:
    """What applies to an asset.

    files : the aobake.toml files that contributed, the nearest last
    """

    bake: BakeSettings
    store: StoreSettings
    image: ImageSettings
    files: tuple[Path, ...] = ()


class Configs:
    """The aobake.toml files of folders, each looked for and read once.

    look : a folder, with forward slashes, '' at the top, -> its file; None where it has none
    """

    def __init__(self, look: Callable[[str], ConfigFile | None]) -> None:
        self._look = look
        self._known: dict[str, ConfigFile | SettingsError | None] = {}

    def above(self, asset: str) -> tuple[ConfigFile, ...]:
        """Those that apply to an asset, the nearest last. Raises SettingsError for one that is no good.

        asset : its path in terms of the folders that `look` knows
        """
        found = []
        folder = asset
        while folder:
            folder = folder.rpartition("/")[0]
            file = self._in(folder)
            if file is not None:
                found.append(file)
                if file.root:
                    break
        return tuple(reversed(found))

    def _in(self, folder: str) -> ConfigFile | None:
        if folder not in self._known:
            try:
                self._known[folder] = self._look(folder)
            except SettingsError as error:
                self._known[folder] = error
        known = self._known[folder]
        if isinstance(known, SettingsError):
            raise SettingsError(
                str(known)
            ) from known  # a new one: each time it is raised it would grow
        return known


def local_configs() -> Configs:
    """The aobake.toml files on this machine; their folders are absolute."""

    def look(folder: str) -> ConfigFile | None:
        path = Path(f"{folder}/", NAME)
        there = os.path.isfile(path)  # noqa: PTH113 - False, not an error, where nothing may be looked at
        return read(path) if there and path.is_absolute() else None

    return Configs(look)


def configured(
    asset: Path | None, *flags: Mapping[str, object] | None, preset: str | None = None
) -> Configured:
    """The settings for an asset, from the flags that were given and the aobake.toml files above it.

    asset : the file that is baked; None for what is in no file, and has no aobake.toml either
    preset : the one that applies where no pattern names another
    Raises SettingsError, which names the file or the flag.
    """
    given = {name: value for group in flags for name, value in (group or {}).items()}
    name = "" if asset is None else _absolute(asset)
    return settled(layers(name, local_configs().above(name), preset), given)


def rendering(asset: Path | None, flags: Mapping[str, object] | None) -> RenderSettings:
    """The settings of a picture of an asset, from the tables [render] and the flags that were given.

    They have a table of their own, since a picture and a lightmap both have a size. asset : as in configured
    Raises SettingsError, which names the file or the flag.
    """
    above = () if asset is None else local_configs().above(_absolute(asset))
    pictures = [Layer(file=file.path, values=file.picture) for file in above]
    return _settings(RenderSettings, pictures, flags or {})


def _absolute(asset: Path) -> str:
    return Path(os.path.abspath(asset)).as_posix()  # noqa: PTH100 - the folders as named, not behind links


def layers(asset: str, files: Sequence[ConfigFile], preset: str | None) -> tuple[Layer, ...]:
    """What the files say of an asset, the weakest first. Raises SettingsError for a preset that is nowhere.

    asset : its path, in terms of the folders of the files; preset : where no pattern names another
    """
    fitting = [_fitting(asset, file) for file in files]
    naming = [fit for fits in fitting for fit in fits if fit.preset is not None]
    found: list[Layer] = []
    for file, fits in zip(files, fitting, strict=True):
        found.append(file.general)
        if preset is not None and not naming and preset in file.presets:
            found.append(file.presets[preset])
        for fit in fits:
            if naming and fit is naming[-1]:
                found += _preset(fit, files)
            found.append(fit.layer)
    if preset is not None and not _named(preset, files):
        raise SettingsError(f"--preset is {preset!r}, and {_presets_of(preset, files)}")
    return tuple(found)


def _fitting(asset: str, file: ConfigFile) -> list[FilePattern]:
    folder = file.path.parent.as_posix()
    name = asset[len(folder) :].lstrip("/") if folder != "." else asset
    return [entry for entry in file.patterns if entry.pattern.fits(name)]


def _preset(fit: FilePattern, files: Sequence[ConfigFile]) -> list[Layer]:
    """The preset that a pattern starts from, in every file that has one of its name."""
    name = str(fit.preset)
    found = _named(name, files)
    if not found:
        where = f'[files."{fit.pattern.words}"]'
        raise SettingsError(
            f"{fit.layer.file}: preset in {where} is {name!r}, and {_presets_of(name, files)}"
        )
    return found


def _named(preset: str, files: Sequence[ConfigFile]) -> list[Layer]:
    return [file.presets[preset] for file in files if preset in file.presets]


def _presets_of(wrong: str, files: Sequence[ConfigFile]) -> str:
    known = {name for file in files for name in file.presets}
    if not known:
        return f"no {NAME} above the asset has a preset. Write one, as [preset.NAME]."
    return f"no {NAME} above the asset has it.{nearest(wrong, known)}"


def settled(found: Sequence[Layer], given: Mapping[str, object]) -> Configured:
    """The settings that layers, the weakest first, and the flags that were given come to.

    Raises SettingsError, which names the file or the flag.
    """
    files = [layer.file for layer in found if layer.values]
    return Configured(
        bake=_settings(BakeSettings, found, given),
        store=_settings(StoreSettings, found, given),
        image=_settings(ImageSettings, found, given),
        files=tuple(dict.fromkeys(files)),
    )


def _settings(kind: type[T], found: Sequence[Layer], given: Mapping[str, object]) -> T:
    known = {field.name for field in dataclasses.fields(kind)}
    sources = {name: layer.file for layer in found for name in layer.values if name in known}
    ours = {name: layer.values[name] for layer in found for name in layer.values if name in known}
    flags = {name: value for name, value in given.items() if name in known}
    try:
        return _made(kind, ours | flags)
    except SettingsError as error:
        message = str(error)
        if sources and message == _complaint(kind, ours):
            named = message.partition(" ")[0]
            file = sources.get(named) or list(sources.values())[-1]
            raise SettingsError(f"{file}: {_clipped(message)}") from error
        raise SettingsError(in_flags(message, kind)) from error


def _made(kind: type[T], values: Mapping[str, object]) -> T:
    checked: dict[str, Any] = dict(values)  # by __post_init__, which does not trust annotations
    return kind(**checked)


def _complaint(kind: type[T], values: Mapping[str, object]) -> str:
    try:
        _made(kind, values)
    except SettingsError as error:
        return str(error)
    return ""


def _clipped(message: str) -> str:
    return message if len(message) <= MOST_LETTERS else f"{message[:MOST_LETTERS]} ..."

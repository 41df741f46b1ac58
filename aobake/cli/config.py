"""Settings as they were asked for: defaults, then the nearest aobake.toml, then flags."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from aobake import BakeSettings, ImageSettings, SettingsError, StoreSettings
from aobake.cli.options import as_flags, flag_name
from aobake.errors import nearest
from aobake.render_settings import RenderSettings

__all__ = ["NAME", "Configured", "configured", "find", "in_flags", "read", "rendering"]

NAME = "aobake.toml"
RENDER = "render"

T = TypeVar("T", BakeSettings, StoreSettings, ImageSettings, RenderSettings)


@dataclass(frozen=True, kw_only=True)
class Configured:
    """bake, store, image : what applies; file : the aobake.toml that contributed, or None."""

    bake: BakeSettings
    store: StoreSettings
    image: ImageSettings
    file: Path | None


def configured(asset: Path | None, *flags: Mapping[str, object] | None) -> Configured:
    """The settings for an asset, from the flags that were given and the aobake.toml nearest to it.

    asset : the file that is baked; None for what is in no file, and has no aobake.toml either
    Raises SettingsError, which names the file or the flag.
    """
    given = {name: value for group in flags for name, value in (group or {}).items()}
    file = None if asset is None else find(asset)
    table = {} if file is None else read(file)
    return Configured(
        bake=_settings(BakeSettings, file, table, given),
        store=_settings(StoreSettings, file, table, given),
        image=_settings(ImageSettings, file, table, given),
        file=file,
    )


def rendering(asset: Path, flags: Mapping[str, object] | None) -> RenderSettings:
    """The settings of a picture of an asset, from the table [render] and the flags that were given.

    They have a table of their own, since a picture and a lightmap both have a size.
    Raises SettingsError, which names the file or the flag.
    """
    file = find(asset)
    table = {} if file is None else read(file).get(RENDER, {})
    return _settings(RenderSettings, file, table, flags or {})


def find(asset: Path) -> Path | None:
    """The aobake.toml in the folder of an asset, or in the nearest folder above; None where there is none."""
    folder = asset.absolute().parent
    for place in (folder, *folder.parents):
        if (place / NAME).is_file():
            return place / NAME
    return None


def read(file: Path) -> dict[str, Any]:
    """The tables in an aobake.toml. Raises SettingsError for a key that is no setting."""
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(f"{file}: it cannot be read ({error.strerror or error}).") from error
    except ValueError as error:  # not TOML, or not UTF-8
        raise SettingsError(f"{file}: this is no TOML ({error}).") from error
    known = _fields(BakeSettings) | _fields(StoreSettings) | _fields(ImageSettings)
    pictures = table.get(RENDER, {})
    if not isinstance(pictures, dict):
        raise SettingsError(f"{file}: {RENDER} is {pictures!r}; a table [{RENDER}] is needed.")
    _refuse_unknown(file, "", table, known | {RENDER})
    _refuse_unknown(file, f" in [{RENDER}]", pictures, _fields(RenderSettings))
    return table


def _refuse_unknown(
    file: Path, where: str, table: Mapping[str, object], known: Collection[str]
) -> None:
    for key in table:
        if key not in known:
            raise SettingsError(f'{file}: there is no setting "{key}"{where}.{nearest(key, known)}')


def _settings(
    kind: type[T], file: Path | None, table: Mapping[str, object], given: Mapping[str, object]
) -> T:
    ours = {name: value for name, value in table.items() if name in _fields(kind)}
    flags = {name: value for name, value in given.items() if name in _fields(kind)}
    try:
        return _made(kind, ours | flags)
    except SettingsError as error:
        if file is not None and str(error) == _complaint(kind, ours):
            raise SettingsError(f"{file}: {error}") from error
        raise SettingsError(in_flags(str(error), kind)) from error


def _made(kind: type[T], values: Mapping[str, object]) -> T:
    checked: dict[str, Any] = dict(values)  # by __post_init__, which does not trust annotations
    return kind(**checked)


def _complaint(kind: type[T], values: Mapping[str, object]) -> str:
    try:
        _made(kind, values)
    except SettingsError as error:
        return str(error)
    return ""


def in_flags(message: str, kind: type[T]) -> str:
    """The message in the words of the command line."""
    name, _, rest = message.partition(" ")
    return as_flags(f"{flag_name(name)} {rest}" if name in _fields(kind) else message, kind)


def _fields(kind: type) -> set[str]:
    return {field.name for field in dataclasses.fields(kind)}

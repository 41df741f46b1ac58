"""One aobake.toml: read, checked and taken apart. It holds settings and patterns, and can name no path."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NoReturn, get_args

from aobake.errors import SettingsError, nearest
from aobake.patterns import Pattern, pattern
from aobake.render_settings import RenderSettings
from aobake.settings import BakeSettings, ImageSettings, StoreSettings

__all__ = [
    "COMMANDS",
    "MOST_BYTES",
    "NAME",
    "PICTURE",
    "SETTINGS",
    "Command",
    "ConfigFile",
    "FilePattern",
    "Layer",
    "parsed",
    "read",
]

NAME = "aobake.toml"
ROOT, RENDER, PRESET, FILES = "root", "render", "preset", "files"
BAKE, FORMAT, SKIP = "bake", "format", "skip"
MOST_BYTES = 64 * 1024  # ten times what a large studio needs
MOST_BYTES_A_LINE = 1000  # a key a.a.a. of 60 kB keeps tomllib busy for half a minute
MOST_LETTERS = 80  # of what was found, in a message

Command = Literal["vertex", "texture"]
COMMANDS: tuple[Command, ...] = get_args(Command)
SETTINGS = {
    f.name
    for kind in (BakeSettings, StoreSettings, ImageSettings)
    for f in dataclasses.fields(kind)
}
PICTURE = {f.name for f in dataclasses.fields(RenderSettings)}


@dataclass(frozen=True, eq=False, kw_only=True)
class Layer:
    """What one table says.

    file : that it stands in
    values : setting -> value, as it is written; they are checked when they are put together
    bake, format, skip : what a batch makes of the asset; None where the table does not say
    """

    file: Path
    values: Mapping[str, object]
    bake: tuple[Command, ...] | None = None
    format: str | None = None
    skip: bool | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class FilePattern:
    """A table [files."PATTERN"]. preset : the name of the one that it starts from, or None."""

    pattern: Pattern
    preset: str | None
    layer: Layer


@dataclass(frozen=True, eq=False, kw_only=True)
class ConfigFile:
    """An aobake.toml.

    general : what it says of everything below its folder; picture : the table [render]
    root : whether those above it do not count
    """

    path: Path
    general: Layer
    picture: Mapping[str, object] = field(default_factory=dict)
    presets: Mapping[str, Layer] = field(default_factory=dict)
    patterns: tuple[FilePattern, ...] = ()
    root: bool = False


def read(path: Path) -> ConfigFile:
    """The aobake.toml at a path. Raises SettingsError, which names it and the table."""
    try:
        with path.open("rb") as stream:
            return parsed(path, stream.read(MOST_BYTES + 1))
    except OSError as error:
        raise SettingsError(f"{path}: it cannot be read ({error.strerror or error}).") from error


def parsed(path: Path, content: bytes) -> ConfigFile:
    """The same from the bytes of a file, of which MOST_BYTES + 1 are enough. Raises SettingsError."""
    table = _decoded(path, content)
    _refuse_unknown(path, "", table, SETTINGS | {ROOT, RENDER, PRESET, FILES})
    picture = _table(path, RENDER, table.get(RENDER, {}))
    _refuse_unknown(path, f" in [{RENDER}]", picture, PICTURE)
    presets = _table(path, PRESET, table.get(PRESET, {}))
    patterns = _table(path, FILES, table.get(FILES, {}))
    return ConfigFile(
        path=path,
        general=Layer(file=path, values=_settings_in(table)),
        picture=picture,
        presets={name: _preset(path, name, inner) for name, inner in presets.items()},
        patterns=tuple(_pattern(path, words, inner) for words, inner in patterns.items()),
        root=_switch(path, ROOT, table.get(ROOT, False)),
    )


def _decoded(path: Path, content: bytes) -> dict[str, object]:
    """The table of a file that is neither too long nor too deep."""
    if len(content) > MOST_BYTES:
        raise SettingsError(
            f"{path}: it has more than {MOST_BYTES // 1024} KiB. Settings are short; shorten it."
        )
    for number, line in enumerate(content.splitlines(), start=1):
        if len(line) > MOST_BYTES_A_LINE:
            raise SettingsError(
                f"{path}: line {number} has more than {MOST_BYTES_A_LINE} bytes. Break it, or shorten it."
            )
    try:
        return tomllib.loads(content.decode("utf-8"))
    except ValueError as error:  # not TOML, or not UTF-8
        raise SettingsError(f"{path}: this is no TOML ({error}).") from error
    except RecursionError as error:
        raise SettingsError(f"{path}: this is no TOML that can be read (too deep).") from error


def _preset(path: Path, name: str, given: object) -> Layer:
    title = f"{PRESET}.{name}"
    table = _table(path, title, given)
    _refuse_unknown(path, f" in [{title}]", table, SETTINGS)
    return Layer(file=path, values=table)


def _pattern(path: Path, words: str, given: object) -> FilePattern:
    title = f'{FILES}."{words}"'
    table = _table(path, title, given)
    _refuse_unknown(path, f" in [{title}]", table, SETTINGS | {PRESET, BAKE, FORMAT, SKIP})
    try:
        compared = pattern(words)
    except SettingsError as error:
        raise SettingsError(f"{path}: the pattern {error}") from error
    preset, ending, skip = table.get(PRESET), table.get(FORMAT), table.get(SKIP)
    if preset is not None and not isinstance(preset, str):
        _refuse(path, PRESET, preset, "the name of a preset")
    return FilePattern(
        pattern=compared,
        preset=preset,
        layer=Layer(
            file=path,
            values=_settings_in(table),
            bake=_commands(path, table[BAKE]) if BAKE in table else None,
            format=None if ending is None else _ending(path, ending),
            skip=None if skip is None else _switch(path, SKIP, skip),
        ),
    )


def _settings_in(table: Mapping[str, object]) -> dict[str, object]:
    return {key: value for key, value in table.items() if key in SETTINGS}


def _commands(path: Path, given: object) -> tuple[Command, ...]:
    several = [given] if isinstance(given, str) else given
    if not isinstance(several, list) or not several:
        _refuse(path, BAKE, given, " or ".join(COMMANDS) + ", or both in a list,")
    for word in several:
        if word not in COMMANDS:
            raise SettingsError(
                f"{path}: {BAKE} is {_short(word)}.{nearest(_short(word), COMMANDS)}"
            )
    return tuple(command for command in COMMANDS if command in several)


def _ending(path: Path, given: object) -> str:
    ending = given.lstrip(".").lower() if isinstance(given, str) else ""
    if not ending.isalnum():
        _refuse(path, FORMAT, given, "an ending such as glb")
    return ending


def _switch(path: Path, name: str, given: object) -> bool:
    if not isinstance(given, bool):
        _refuse(path, name, given, "true or false")
    return given


def _table(path: Path, title: str, given: object) -> dict[str, object]:
    if not isinstance(given, dict):
        _refuse(path, title, given, f"a table [{title}]")
    return given


def _refuse(path: Path, name: str, found: object, needed: str) -> NoReturn:
    raise SettingsError(f"{path}: {name} is {_short(found)}; {needed} is needed.")


def _refuse_unknown(
    path: Path, where: str, table: Mapping[str, object], known: Collection[str]
) -> None:
    for key in table:
        if key not in known:
            word = key[:MOST_LETTERS]
            raise SettingsError(
                f'{path}: there is no setting "{word}"{where}.{nearest(word, known)}'
            )


def _short(found: object) -> str:
    words = repr(found)
    return words if len(words) <= MOST_LETTERS else f"{words[:MOST_LETTERS]} ..."

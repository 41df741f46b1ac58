"""Options that commands share: made from the settings themselves, so that help and defaults cannot differ."""

from __future__ import annotations

import ast
import dataclasses
import functools
import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias, TypedDict, get_args, get_type_hints

from aobake.cli.app import Group, Parameter, Token
from aobake.config import Configured, configured
from aobake.flags import as_flags, flag_name
from aobake.render_settings import RenderSettings
from aobake.settings import (
    AtlasSettings,
    ImageSettings,
    StoreSettings,
    TraceSettings,
    VertexSettings,
)

__all__ = [
    "AtlasFlags",
    "BakeFlags",
    "CommonOptions",
    "ConfigOptions",
    "ImageFlags",
    "Output",
    "RenderFlags",
    "SourceOptions",
    "StoreFlags",
    "TraceFlags",
    "VertexFlags",
    "flags_of",
]

COMMON = Group("Common options", sort_key=5)
SOURCE = Group("Reading", sort_key=4)

Output = Annotated[Path, Parameter(alias="-o", group=Group("Writing", sort_key=1))]


@Parameter(name="*", group=COMMON)
@dataclass(frozen=True, kw_only=True)
class CommonOptions:
    """What every baking command can be told."""

    report: Path | None = None
    """Write what was done to this file, as JSON."""

    force: bool = False
    """Replace output files that exist."""

    quiet: bool = False
    """Say nothing but errors."""

    debug: bool = False
    """Show where in the program an error arose."""


@Parameter(name="*", group=COMMON)
@dataclass(frozen=True, kw_only=True)
class ConfigOptions:
    """What is taken from files aobake.toml."""

    preset: str | None = None
    """Settings by name: those under [preset.NAME] in aobake.toml, unless a pattern there names others."""

    no_config: bool = False
    """Ignore every aobake.toml."""

    def configured(self, asset: Path, *flags: Mapping[str, object] | None) -> Configured:
        """The settings for an asset. Raises SettingsError, which names the file or the flag."""
        return configured(None if self.no_config else asset, *flags, preset=self.preset)


@Parameter(name="*", group=SOURCE)
@dataclass(frozen=True, kw_only=True)
class SourceOptions:
    """How a file is read."""

    scene: str | None = None
    """Name or number of the glTF scene to take. Left out: the one that the file shows by default."""

    pose: str | None = None
    """Moment of a glTF animation to take, as CLIP@SECONDS, such as Walk@0.5. Left out: the rest pose."""

    root: Path | None = None
    """Folder that the asset's side files may lie in. Left out: the asset's own folder."""


@functools.cache
def _classes(module: str) -> list[ast.ClassDef]:
    """The classes in the source of a module: parsed once for all its settings, 5 ms."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except OSError:
        return []
    return [node for node in tree.body if isinstance(node, ast.ClassDef)]


def field_help(settings: type) -> dict[str, str]:
    """Field -> the docstring below it; empty where the source is not at hand."""
    body = next((c.body for c in _classes(settings.__module__) if c.name == settings.__name__), [])
    found = {}
    for field, text in pairwise(body):
        match field, text:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str() as words)),
            ):
                found[name] = " ".join(words.split())
    return found


def _whole(_hint: object, tokens: Sequence[Token]) -> int | None:
    """A whole number, written as one: cyclopts would round 2.5."""
    word = tokens[0].value
    return None if word.lower() in {"none", "null"} else int(word)


def _number(_hint: object, tokens: Sequence[Token]) -> float | str | None:
    """A number, or what else the settings understand: rms:0.01, 5%."""
    word = tokens[0].value
    if word.lower() in {"none", "null"}:
        return None
    try:
        return float(word)
    except ValueError:
        return word


def flags_of(*parts: tuple[type, str, int]) -> object:
    """A TypedDict of the fields of settings: cyclopts fills in those that were given, and no others.

    parts : settings, and the title and the place in the help of their flags
    """
    hints = {name: hint for part in parts for name, hint in _hints(*part).items()}
    flags = TypedDict(parts[0][0].__name__, hints, total=False)  # type: ignore[misc]
    return Annotated[flags | None, Parameter(name="*")]


def _hints(settings: type, title: str, order: int) -> dict[str, object]:
    """Field -> its type, with the parameter that it is on the command line."""
    helps = field_help(settings)
    group = Group(title, sort_key=order)
    hints: dict[str, object] = {}
    types = get_type_hints(settings)
    for field in dataclasses.fields(settings):
        text = as_flags(helps.get(field.name, ""), settings)
        if field.default not in {None, ()}:
            words = field.default if isinstance(field.default, tuple) else [str(field.default)]
            text += f" [default: {' '.join(words)}]"
        hint = types[field.name]
        read: Callable[[object, Sequence[Token]], object] | None = None
        if hint is int or int in get_args(hint):
            read = _whole
        elif field.name in {"tolerance", "max_distance"}:
            read = _number
        parameter = Parameter(name=flag_name(field.name), group=group, help=text, converter=read)
        hints[field.name] = Annotated[hint, parameter]
    return hints


if TYPE_CHECKING:
    Flags: TypeAlias = Mapping[str, object] | None
    TraceFlags: TypeAlias = Flags
    VertexFlags: TypeAlias = Flags
    AtlasFlags: TypeAlias = Flags
    StoreFlags: TypeAlias = Flags
    ImageFlags: TypeAlias = Flags
    RenderFlags: TypeAlias = Flags
    BakeFlags: TypeAlias = Flags
else:
    TRACE = (TraceSettings, "Baking", 2)
    VERTEX = (VertexSettings, "Baking", 2)
    ATLAS = (AtlasSettings, "Texture", 3)
    STORE = (StoreSettings, "Writing", 1)
    IMAGE = (ImageSettings, "Writing", 1)
    TraceFlags, VertexFlags, AtlasFlags = flags_of(TRACE), flags_of(VERTEX), flags_of(ATLAS)
    StoreFlags, ImageFlags = flags_of(STORE), flags_of(IMAGE)
    RenderFlags = flags_of((RenderSettings, "Picture", 2))
    BakeFlags = flags_of(TRACE, VERTEX, ATLAS, STORE, IMAGE)

"""Options that commands share: made from the settings themselves, so that help and defaults cannot differ."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias, TypedDict, get_args, get_type_hints

from aobake.cli.app import Group, Parameter, Token
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
    "CommonOptions",
    "ImageFlags",
    "Output",
    "RenderFlags",
    "SourceOptions",
    "StoreFlags",
    "TraceFlags",
    "VertexFlags",
    "as_flags",
    "flag_name",
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


def flag_name(field: str) -> str:
    """The flag of a field of the settings: max_distance -> --max-distance."""
    return f"--{field.replace('_', '-')}"


def as_flags(text: str, settings: type) -> str:
    """What is said of settings, in the words of the command line: flags, and None as what is left out."""
    for field in dataclasses.fields(settings):
        if "_" in field.name:
            text = re.sub(rf"\b{field.name}\b", flag_name(field.name), text)
    return re.sub(r"(\()?None:", lambda found: "(left out:" if found[1] else "Left out:", text)


def field_help(settings: type) -> dict[str, str]:
    """Field -> the docstring below it; empty where the source is not at hand."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[settings.__module__]))
    except OSError:
        return {}
    classes = (node for node in tree.body if isinstance(node, ast.ClassDef))
    body = next((node.body for node in classes if node.name == settings.__name__), [])
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


def _flags(settings: type, title: str, order: int) -> object:
    """A TypedDict of the settings' fields: cyclopts fills in those that were given, and no others."""
    helps = field_help(settings)
    group = Group(title, sort_key=order)
    hints, types = {}, get_type_hints(settings)
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
    flags = TypedDict(settings.__name__, hints, total=False)  # type: ignore[misc]
    return Annotated[flags | None, Parameter(name="*")]


if TYPE_CHECKING:
    Flags: TypeAlias = Mapping[str, object] | None
    TraceFlags: TypeAlias = Flags
    VertexFlags: TypeAlias = Flags
    AtlasFlags: TypeAlias = Flags
    StoreFlags: TypeAlias = Flags
    ImageFlags: TypeAlias = Flags
    RenderFlags: TypeAlias = Flags
else:
    TraceFlags = _flags(TraceSettings, "Baking", 2)
    VertexFlags = _flags(VertexSettings, "Baking", 2)
    AtlasFlags = _flags(AtlasSettings, "Texture", 3)
    StoreFlags = _flags(StoreSettings, "Writing", 1)
    ImageFlags = _flags(ImageSettings, "Writing", 1)
    RenderFlags = _flags(RenderSettings, "Picture", 2)

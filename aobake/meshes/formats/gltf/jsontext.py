"""JSON text in and out, so that no value is lost on the way.

Python's parser would drop all but the last of equal keys, turn 1e400 into infinity (which is no JSON)
and -0 into 0; the first two are refused, the third is kept. Numbers come back as the same double.
"""

from __future__ import annotations

import json
import math
import re
from typing import TypeAlias

from aobake.errors import InputError, OutputError

__all__ = ["JsonObject", "JsonText", "parse", "serialise"]

JsonObject: TypeAlias = dict[str, object]

BOM = b"\xef\xbb\xbf"
MOST_INDENTED_LINES = 200_000  # the indenting encoder is pure Python: 1 s for this many lines


class JsonText:
    """How a JSON text was laid out: what serialise needs to give it back in the same dress."""

    def __init__(self, text: bytes) -> None:
        self.bom = text.startswith(BOM)
        indent = re.match(rb"\s*\{[ \t]*\r?\n([ \t]+)\"", text[3:] if self.bom else text)
        indented = indent is not None and text.count(b"\n") <= MOST_INDENTED_LINES
        self.indent = indent[1].decode("ascii") if indent is not None and indented else None


def parse(text: bytes, where: str) -> JsonObject:
    """The object that a JSON text holds.

    text : UTF-8, with or without a byte order mark
    where : the file, for messages
    Raises InputError where it is no JSON, no object, or holds what could not be written back.
    """
    try:
        decoded = text.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{where}: its JSON is not UTF-8 (byte {error.start}). Save it again as UTF-8."
        ) from error
    # The hook costs 150 ns a number, so it is set only where the text holds a "-0".
    whole = _whole if re.search(r"-0(?![\d.eE])", decoded) else None
    try:
        value = json.loads(
            decoded,
            object_pairs_hook=_unique,
            parse_float=_finite,
            parse_int=whole,
            parse_constant=_constant,
        )
    except RecursionError as error:
        raise InputError(f"{where}: its JSON is nested too deeply. Is it a glTF file?") from error
    except ValueError as error:
        raise InputError(f"{where}: its JSON cannot be read ({error}). Export it again.") from error
    if not isinstance(value, dict):
        raise InputError(f"{where}: its JSON is a {type(value).__name__}, and glTF is an object.")
    return value


def serialise(value: JsonObject, dress: JsonText | None = None) -> bytes:
    """UTF-8 text of a JSON object: keys in their order, compact unless it was indented.

    dress : the layout of the text that it was parsed from
    Raises OutputError where it is nested too deeply.
    """
    indent = dress.indent if dress else None
    separators = (",", ": ") if indent else (",", ":")
    for ascii_only in (False, True):  # a lone surrogate (\ud800) can be written as an escape only
        try:
            text = json.dumps(
                value,
                ensure_ascii=ascii_only,
                allow_nan=False,
                check_circular=False,
                indent=indent,
                separators=separators,
            )
            return (BOM if dress and dress.bom else b"") + text.encode("utf-8")
        except UnicodeEncodeError:
            continue
        except RecursionError as error:
            raise OutputError(
                "the JSON of the asset is nested too deeply to be written."
            ) from error
    raise OutputError("the JSON of the asset holds text that cannot be written.")


def _unique(pairs: list[tuple[str, object]]) -> JsonObject:
    found = dict(pairs)
    if len(found) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice!r} stands twice in one object")
    return found


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"the number {text[:20]} is too large for a double")
    return value


def _whole(text: str) -> int | float:
    return -0.0 if text == "-0" else int(text)


def _constant(text: str) -> object:
    raise ValueError(f"{text} is no JSON number")

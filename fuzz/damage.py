"""Ways to damage a file that get past its first lines: JSON values, tokens and lines rather than bytes."""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Callable
from typing import Any

__all__ = ["damaged"]

Bytes = Callable[[bytes, random.Random], bytes]

STRANGE: tuple[object, ...] = (
    None, True, -1, 0, 1, 2**31, 2**32 - 1, 2**53, 2**70, 1.5, -0.0, 1e300, 1e-320, "x", "", [], {}, [[]],
    [0], {"a": 1}, "data:,", "http://host/b", "../x", "a\0b", "\ud800", [0, 1, 2], "VEC3", "SCALAR", 5121, 5126,
)  # fmt: skip
TOKENS = (
    b"nan", b"inf", b"-inf", b"1e39", b"1e400", b"-0", b"0", b"1", b"-1", b"2147483648", b"4294967296", b"1//1",
    b"1/1/1", b"//", b"-1/-1", b"\\", b"#", b"f", b"v", b"vn", b"vt", b"p", b"g", b"usemtl", b"uchar", b"double",
    b"list", b"property", b"element", b"face", b"vertex", b"end_header", b"ascii", b"binary_big_endian", b"\xff",
    b"\xef\xbb\xbf", b"\0", b"", b"99999999999999999999", b"1_000", b"0x10", b"\xd9\xa1",
)  # fmt: skip


def damaged(data: bytes, suffix: str, rng: random.Random, plain: Bytes) -> bytes:
    """A copy of a file with a few changes that suit its format.

    plain : how bytes are damaged without knowing what they are
    """
    if rng.random() < 0.3:
        return plain(data, rng)
    if suffix == ".glb":
        return _glb(data, rng, plain)
    if suffix == ".gltf":
        return _json(data, rng) or plain(data, rng)
    return _lines(data, rng) if rng.random() < 0.3 else _tokens(data, rng)


def _glb(data: bytes, rng: random.Random, plain: Bytes) -> bytes:
    """Damage to one chunk, in a file whose lengths are right again."""
    try:
        size = struct.unpack_from("<I", data, 12)[0]
    except struct.error:
        return plain(data, rng)
    text, rest = data[20 : 20 + size], data[28 + size :]
    if rng.random() < 0.8:
        text = _json(text, rng) or plain(text, rng)
    else:
        rest = plain(rest, rng)
    text += b" " * (-len(text) % 4)
    rest += b"\0" * (-len(rest) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    if rest:
        body += struct.pack("<I4s", len(rest), b"BIN\0") + rest
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _json(text: bytes, rng: random.Random) -> bytes:
    """A few values replaced, shifted, copied or removed; empty where it is no JSON."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return b""
    places = _places(document, ())
    for _ in range(rng.choice((1, 1, 2, 4)) if places else 0):
        *path, last = rng.choice(places)
        holder = document
        try:
            for key in path:
                holder = holder[key]
            _change(holder, last, rng)
        except (KeyError, IndexError, TypeError):
            continue  # an earlier change took this place away
    return json.dumps(document).encode("utf-8", "surrogatepass")


def _change(holder: Any, key: Any, rng: random.Random) -> None:
    way, value = rng.random(), holder[key]
    if way < 0.2:
        del holder[key]
    elif way < 0.3 and isinstance(holder, list):
        holder.append(value)
    elif way < 0.6 and isinstance(value, int) and not isinstance(value, bool):
        holder[key] = value + rng.choice((-1, 1, 2, 3, 100))
    else:
        holder[key] = rng.choice(STRANGE)


def _places(value: object, path: tuple[object, ...]) -> list[tuple[object, ...]]:
    """Paths of all values within a JSON value."""
    found = [path] if path else []
    if isinstance(value, dict):
        for key, item in value.items():
            found += _places(item, (*path, key))
    elif isinstance(value, list):
        for number, item in enumerate(value[:50]):
            found += _places(item, (*path, number))
    return found


def _lines(data: bytes, rng: random.Random) -> bytes:
    """Lines swapped, doubled or dropped."""
    lines = data.split(b"\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    way = rng.randrange(3)
    if way == 0:
        lines[one], lines[other] = lines[other], lines[one]
    elif way == 1:
        lines.insert(one, lines[other])
    else:
        del lines[one]
    return b"\n".join(lines)


def _tokens(data: bytes, rng: random.Random) -> bytes:
    """A few words of the first lines replaced by strange ones, or by others of the file."""
    head, body = data[:4000], data[4000:]
    words = head.split(b" ")
    for _ in range(rng.choice((1, 1, 2, 3))):
        at = rng.randrange(len(words))
        word = rng.choice(TOKENS) if rng.random() < 0.7 else rng.choice(words)
        before, line_break, _ = words[at].partition(b"\n")
        words[at] = (
            word if not line_break or rng.random() < 0.2 else word + words[at][len(before) :]
        )
    return b" ".join(words) + body

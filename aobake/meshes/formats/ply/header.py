"""The header of a PLY file: which elements follow, with which properties, and where each line stands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast, get_args

from aobake.errors import InputError, nearest

__all__ = ["Element", "Encoding", "Header", "Property", "parse_header"]

Encoding = Literal["ascii", "binary_little_endian", "binary_big_endian"]

TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
    "int64": "i8",
    "uint64": "u8",
}
MOST_BYTES = 1 << 22  # nobody writes four megabytes of comments
CURE = "Export the file again."


@dataclass(frozen=True)
class Property:
    """One property of an element.

    type : numpy's name of it without the byte order ("f4"); of the items where it is a list
    count_type : of the number of items; None where it is no list
    begin, end : span of its line in the file, the line end included
    """

    name: str
    type: str
    count_type: str | None
    begin: int
    end: int

    @property
    def item_bytes(self) -> int:
        """Bytes of one value."""
        return int(self.type[1])


@dataclass(frozen=True)
class Element:
    """A table of the file: so many rows, each with these properties."""

    name: str
    count: int
    properties: tuple[Property, ...]

    def scalar(self, name: str) -> Property | None:
        """The first property of that name that is no list."""
        return next((p for p in self.properties if p.name == name and p.count_type is None), None)


@dataclass(frozen=True)
class Header:
    """newline : what its lines end with; size : bytes up to the body; comments : without the keyword"""

    encoding: Encoding
    elements: tuple[Element, ...]
    comments: tuple[str, ...]
    newline: bytes
    size: int

    def element(self, name: str) -> Element | None:
        """The first element of that name."""
        return next((element for element in self.elements if element.name == name), None)


@dataclass
class _Draft:
    encoding: str | None
    elements: list[tuple[str, int]]
    properties: list[list[Property]]
    comments: list[str]


def parse_header(data: bytes, where: str) -> Header:
    """Read the header of a PLY file.

    where : the file, for messages. Raises InputError, with the line, for what is not as it must be.
    """
    newline = _newline(data, where)
    if data.find(b"end_header", 0, MOST_BYTES) < 0:
        raise InputError(f"{where}: the PLY header has no end_header line. {CURE}")
    draft = _Draft(None, [], [], [])
    begin, number = 0, 0
    while True:
        number += 1
        end = data.find(newline, begin)
        line = data[begin : end if end >= 0 else len(data)]
        after = end + len(newline) if end >= 0 else len(data)
        words = line.decode("ascii", "replace").split()
        if words == ["end_header"]:
            break
        if end < 0:
            raise InputError(f"{where}: the PLY header has no end_header line. {CURE}")
        if number > 1 and words:
            _take(draft, words, (begin, after), f"{where}: line {number}")
        begin = after
    return _finished(draft, newline, after, where)


def _newline(data: bytes, where: str) -> bytes:
    for newline in (b"\r\n", b"\n", b"\r"):
        if data.startswith(b"ply" + newline):
            return newline
    if data[:3] == b"ply" and data[3:4].isspace():
        end = data.find(b"\n")
        if end >= 0 and not data[3:end].strip():
            return b"\n"
    raise InputError(
        f"{where}: it does not begin with the line `ply`, so it is no PLY file. {CURE}"
    )


def _take(draft: _Draft, words: list[str], span: tuple[int, int], line: str) -> None:
    match words:
        case ["comment" | "obj_info", *rest]:
            draft.comments.append(" ".join(rest))
        case ["format", encoding, _]:
            if encoding not in get_args(Encoding):
                raise InputError(
                    f"{line}: {encoding} is no PLY encoding.{nearest(encoding, get_args(Encoding))}"
                )
            draft.encoding = encoding
        case ["element", name, count]:
            if not (count.isascii() and count.isdigit() and len(count) < 19):
                raise InputError(f"{line}: {count[:40]!r} is no number of rows. {CURE}")
            draft.elements.append((name, int(count)))
            draft.properties.append([])
        case ["property", "list", count_type, item_type, name]:
            counted = _type(count_type, line)
            if counted[0] == "f":
                raise InputError(
                    f"{line}: a list is counted in whole numbers, not {count_type}. {CURE}"
                )
            _add(draft, Property(name, _type(item_type, line), counted, *span), line)
        case ["property", scalar_type, name]:
            _add(draft, Property(name, _type(scalar_type, line), None, *span), line)
        case _:
            shown = " ".join(words)[:60]
            raise InputError(f"{line}: {shown!r} is no line of a PLY header. {CURE}")


def _type(name: str, line: str) -> str:
    if name not in TYPES:
        raise InputError(
            f"{line}: {name[:40]!r} is no type of a PLY property.{nearest(name, TYPES)}"
        )
    return TYPES[name]


def _add(draft: _Draft, found: Property, line: str) -> None:
    if not draft.properties:
        raise InputError(f"{line}: property {found.name} comes before any element. {CURE}")
    draft.properties[-1].append(found)


def _finished(draft: _Draft, newline: bytes, size: int, where: str) -> Header:
    if draft.encoding is None:
        raise InputError(f"{where}: the PLY header has no format line. {CURE}")
    elements = tuple(
        Element(name, count, tuple(properties))
        for (name, count), properties in zip(draft.elements, draft.properties, strict=True)
    )
    return Header(cast(Encoding, draft.encoding), elements, tuple(draft.comments), newline, size)

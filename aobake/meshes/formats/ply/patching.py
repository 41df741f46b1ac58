"""The bytes of a PLY file with properties replaced in, removed from and appended to its vertices."""

from __future__ import annotations

from itertools import chain

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats.ply.body import BinaryBody, Body, Numbers, open_body
from aobake.meshes.formats.ply.columns import Changes, NewColumn, changes
from aobake.meshes.formats.ply.header import Element, Header, Property
from aobake.meshes.formats.ply.layout import Layout, layouts, row_ends, scalar_places
from aobake.meshes.formats.tokens import IndexArray, spliced, word_spans
from aobake.settings import StoreSettings

__all__ = ["patched"]

SHORT_NAMES = {"u1": "uchar", "f4": "float"}
SIZED_NAMES = {"u1": "uint8", "f4": "float32"}


def patched(
    data: bytes,
    header: Header,
    ao: NDArray[np.float32],
    distance: NDArray[np.float32] | None,
    store: StoreSettings,
    where: str,
) -> list[bytes | memoryview]:
    """The pieces of the file with ambient occlusion at its vertices; all other bytes are the same.

    ao : (V,) float32; distance : the same of mean distances, or None
    Raises OutputError where it does not fit the file.
    """
    body = open_body(data, header, where)
    layout = next(rows for rows in layouts(body, header, where) if rows.element.name == "vertex")
    if len(ao) != layout.element.count:
        raise OutputError(
            f"{where}: {len(ao)} values for the {layout.element.count} vertices of the PLY file; bake it again."
        )
    change = changes(body, layout, ao, distance, store, where)
    head = _header(data, header, layout.element, change)
    if isinstance(body, BinaryBody) and layout.stride is not None:
        rows = _binary_rows(body, layout, change)
        return [
            head,
            memoryview(data)[header.size : layout.begin],
            rows,
            memoryview(data)[layout.end :],
        ]
    spans = _text_spans(data, header) if not isinstance(body, BinaryBody) else None
    return [head, _spliced_rows(data, header, body, layout, change, spans)]


def _header(data: bytes, header: Header, element: Element, change: Changes) -> bytes:
    """The header, with a line for each new property after the last one of the vertices."""
    lines = data[element.properties[0].begin : element.properties[-1].end]
    sized = any(name in lines for name in (b"float32", b"float64", b"uint8", b"int32"))
    names = SIZED_NAMES if sized else SHORT_NAMES
    added = b"".join(
        f"property {names[new.type]} {new.name}".encode() + header.newline for new in change.new
    )
    after = element.properties[-1].end
    edits = [(prop.begin, prop.end, b"") for prop in change.removed] + [(after, after, added)]
    starts, ends, texts = zip(*edits, strict=True)
    return spliced(data[: header.size], starts, ends, texts)


def _binary_rows(body: BinaryBody, layout: Layout, change: Changes) -> memoryview:
    """Rows that are all alike, changed as one table of bytes."""
    count, stride = layout.element.count, layout.stride or 0
    old = np.frombuffer(body.data, np.uint8, count * stride, layout.begin).reshape(count, stride)
    rows = old.copy()
    for prop, values in change.replaced:
        begin = _column(body, layout, prop)
        rows[:, begin : begin + prop.item_bytes] = _bytes(values, body.order + prop.type)
    for prop in change.removed:
        begin = _column(body, layout, prop)
        rows = np.delete(rows, np.s_[begin : begin + prop.item_bytes], axis=1)
    added = [_bytes(new.values, body.order + new.type) for new in change.new]
    changed: NDArray[np.uint8] = np.concatenate([rows, *added], axis=1)
    return changed.reshape(-1).data


def _column(body: BinaryBody, layout: Layout, prop: Property) -> int:
    places = scalar_places(body, layout, prop)
    return int(places[0]) - layout.begin if len(places) else 0


def _bytes(values: Numbers, dtype: str) -> NDArray[np.uint8]:
    """(count, size of a value) the bytes of each value."""
    column = np.ascontiguousarray(values, dtype)
    return column.view(np.uint8).reshape(len(column), column.itemsize)


def _text_spans(data: bytes, header: Header) -> tuple[IndexArray, IndexArray]:
    starts, ends = word_spans(np.frombuffer(data, np.uint8, offset=header.size))
    return starts + header.size, ends + header.size


def _spliced_rows(
    data: bytes,
    header: Header,
    body: Body,
    layout: Layout,
    change: Changes,
    words: tuple[IndexArray, IndexArray] | None,
) -> bytes:
    """The body, changed value by value: text, and binary rows that differ in length.

    words : spans of the words where the body is text
    """
    edits = [
        (*_span(scalar_places(body, layout, prop), prop, words), _written(values, prop.type, body))
        for prop, values in change.replaced
    ]
    for prop in change.removed:
        starts, ends = _removed(layout.element, prop, scalar_places(body, layout, prop), words)
        edits.append((starts, ends, [b""] * len(starts)))
    after = row_ends(layout)
    ends = words[1][after - 1] if words is not None else after
    edits.append((ends, ends, _appended(change.new, layout.element.count, body)))
    # Within a row by place, then row by row: the edits of the file in ascending order.
    edits.sort(key=lambda edit: int(edit[0][0]) if len(edit[0]) else 0)
    starts_of, ends_of, texts_of = zip(*edits, strict=True)
    begins = np.stack(starts_of, axis=1).reshape(-1) - header.size
    stops = np.stack(ends_of, axis=1).reshape(-1) - header.size
    texts = chain.from_iterable(zip(*texts_of, strict=True))
    return spliced(data[header.size :], begins.tolist(), stops.tolist(), texts)


def _span(
    places: IndexArray, prop: Property, words: tuple[IndexArray, IndexArray] | None
) -> tuple[IndexArray, IndexArray]:
    """Bytes of the values at these places."""
    if words is None:
        return places, places + prop.item_bytes
    return words[0][places], words[1][places]


def _removed(
    element: Element,
    prop: Property,
    places: IndexArray,
    words: tuple[IndexArray, IndexArray] | None,
) -> tuple[IndexArray, IndexArray]:
    """Bytes of the values at these places; in text, with the white space that parts them from the row."""
    if words is None:
        return places, places + prop.item_bytes
    starts, ends = words
    if prop is element.properties[0]:
        return starts[places], starts[places + 1]
    return ends[places - 1], ends[places]


def _appended(new: tuple[NewColumn, ...], count: int, body: Body) -> list[bytes]:
    """What comes after each row."""
    columns = [_written(column.values, column.type, body) for column in new]
    if isinstance(body, BinaryBody):
        return [b"".join(row) for row in zip(*columns, strict=True)] if columns else [b""] * count
    return (
        [b"".join(b" " + word for word in row) for row in zip(*columns, strict=True)]
        if columns
        else [b""] * count
    )


def _written(values: Numbers, type_: str, body: Body) -> list[bytes]:
    """Each value as the file writes it."""
    if isinstance(body, BinaryBody):
        return [row.tobytes() for row in _bytes(values, body.order + type_)]
    digits = b"%.7g" if type_[0] == "f" else b"%d"
    return [digits % value for value in values.tolist()]

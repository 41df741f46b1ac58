"""Where each row and each property of a PLY element stands, in places of the body."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aobake.errors import InputError
from aobake.meshes.formats.ply.body import Body, Numbers, size_of
from aobake.meshes.formats.ply.header import Element, Header, Property
from aobake.meshes.formats.tokens import IndexArray

__all__ = ["Layout", "layouts", "list_values", "row_ends", "scalar_places", "scalar_values"]


@dataclass(frozen=True, eq=False)
class Layout:
    """The rows of one element.

    begin, end : places of the element
    stride : places from row to row, where all rows are alike; else None
    lists : per list property, the (count,) places of its items and how many there are
    rows : (count + 1,) place of each row and of the end, where the rows differ; else None
    """

    element: Element
    begin: int
    end: int
    stride: int | None
    sizes: tuple[int, ...]
    lists: tuple[tuple[IndexArray, IndexArray], ...]
    rows: IndexArray | None


def layouts(body: Body, header: Header, where: str) -> Iterator[Layout]:
    """The layout of every element, in order.

    Raises InputError where the header claims more than the body can hold, before memory is claimed.
    """
    place = body.begin
    for element in header.elements:
        layout = _layout(body, element, place, where)
        place = layout.end
        yield layout


def _layout(body: Body, element: Element, begin: int, where: str) -> Layout:
    least = sum(size_of(body, prop) for prop in element.properties)
    if element.count * least > body.end - begin:
        raise InputError(
            f"{where}: the header claims {element.count} rows of element {element.name!r}, and the file has "
            f"room for {max(0, body.end - begin) // least} at most. The file is cut off or damaged: export it again."
        )
    sizes = _sizes_of_row(body, element, begin, where) if element.count else ()
    stride = least + sum(
        size * body.step(prop.type) for prop, size in zip(_lists(element), sizes, strict=False)
    )
    if _all_alike(body, element, begin, stride, sizes):
        end = begin + stride * element.count
        return Layout(element, begin, end, stride, sizes, (), None)
    return _walked(body, element, begin, where)


def _lists(element: Element) -> list[Property]:
    return [prop for prop in element.properties if prop.count_type is not None]


def _sizes_of_row(body: Body, element: Element, place: int, where: str) -> tuple[int, ...]:
    """How many items each list of the row at a place has."""
    sizes = []
    for prop in element.properties:
        if prop.count_type is None:
            place += body.step(prop.type)
            continue
        after = place + body.step(prop.count_type)
        size = body.counter(prop.count_type)(place) if after <= body.end else -1
        if size < 0:
            raise _broken_list(element, prop, 0, where)
        sizes.append(size)
        place = after + size * body.step(prop.type)
    return tuple(sizes)


def _all_alike(
    body: Body, element: Element, begin: int, stride: int, sizes: tuple[int, ...]
) -> bool:
    if element.count == 0:
        return True
    if begin + stride * element.count > body.end:
        return False
    offset = 0
    of_list = iter(sizes)
    for prop in element.properties:
        if prop.count_type is None:
            offset += body.step(prop.type)
            continue
        size = next(of_list)
        counts = body.grid(begin + offset, stride, element.count, 1, prop.count_type)
        if not bool((counts == size).all()):
            return False
        offset += body.step(prop.count_type) + size * body.step(prop.type)
    return True


def _walked(body: Body, element: Element, begin: int, where: str) -> Layout:
    """Row by row: 0.5 s for a million faces of mixed sizes, against 0.1 s for faces that are all alike."""
    lists = _lists(element)
    gaps, tail = _gaps(body, element)
    places = np.empty((len(lists), element.count), np.int64)
    counts = np.empty((len(lists), element.count), np.int64)
    rows = np.empty(element.count + 1, np.int64)
    steps = [
        (gap, size_of(body, prop), body.counter(prop.count_type or ""), body.step(prop.type))
        for gap, prop in zip(gaps, lists, strict=True)
    ]
    place, end = begin, body.end
    for row in range(element.count):
        rows[row] = place
        for number, (gap, head, counter, item) in enumerate(steps):
            first = place + gap + head
            if first > end:
                raise _cut_off(element, row, where)
            size = counter(first - head)
            if size < 0:
                raise _broken_list(element, lists[number], row, where)
            place = first + size * item
            if place > end:
                raise _cut_off(element, row, where)
            places[number, row] = first
            counts[number, row] = size
        place += tail
        if place > end:
            raise _cut_off(element, row, where)
    rows[element.count] = place
    found = tuple((places[number], counts[number]) for number in range(len(lists)))
    return Layout(element, begin, place, None, (), found, rows)


def _gaps(body: Body, element: Element) -> tuple[list[int], int]:
    """Places of scalars before each list, and after the last one."""
    gaps, gap = [], 0
    for prop in element.properties:
        if prop.count_type is None:
            gap += body.step(prop.type)
        else:
            gaps.append(gap)
            gap = 0
    return gaps, gap


def _cut_off(element: Element, row: int, where: str) -> InputError:
    return InputError(
        f"{where}: it ends within row {row} (from 0) of the {element.count} rows of element "
        f"{element.name!r}. The file is cut off or damaged: export it again."
    )


def _broken_list(element: Element, prop: Property, row: int, where: str) -> InputError:
    return InputError(
        f"{where}: row {row} (from 0) of element {element.name!r} has no valid number of items in its list "
        f"{prop.name!r}. The file is cut off or damaged: export it again."
    )


def scalar_places(body: Body, layout: Layout, wanted: Property) -> IndexArray:
    """(count,) place of a property that is no list, in each row."""
    if layout.rows is None:
        stride = np.int64(layout.stride or 0)
        return (
            layout.begin + _offset(body, layout, wanted) + np.arange(layout.element.count) * stride
        )
    base, offset = layout.rows[:-1], 0
    lists = iter(layout.lists)
    for prop in layout.element.properties:
        if prop is wanted:
            break
        if prop.count_type is None:
            offset += body.step(prop.type)
        else:
            place, size = next(lists)
            base, offset = place + size * body.step(prop.type), 0
    return base + offset


def row_ends(layout: Layout) -> IndexArray:
    """(count,) one past the last place of each row."""
    if layout.rows is not None:
        return layout.rows[1:]
    stride = np.int64(layout.stride or 0)
    return layout.begin + (np.arange(layout.element.count) + 1) * stride


def scalar_values(body: Body, layout: Layout, wanted: Property) -> Numbers:
    """(count,) values of a property that is no list."""
    if layout.rows is not None:
        return body.take(scalar_places(body, layout, wanted), wanted.type)
    begin = layout.begin + _offset(body, layout, wanted)
    return body.grid(begin, layout.stride or 0, layout.element.count, 1, wanted.type)[:, 0]


def list_values(body: Body, layout: Layout, wanted: Property) -> tuple[Numbers, IndexArray]:
    """The items of a list property, row after row, and (count,) how many each row has."""
    number = _lists(layout.element).index(wanted)
    count = layout.element.count
    if count == 0:
        return np.zeros(0, wanted.type), np.zeros(0, np.int64)
    if layout.rows is None:
        size = layout.sizes[number]
        begin = layout.begin + _offset(body, layout, wanted) + size_of(body, wanted)
        values = body.grid(begin, layout.stride or 0, count, size, wanted.type)
        return values.reshape(-1), np.full(count, size, np.int64)
    place, sizes = layout.lists[number]
    first = np.cumsum(sizes) - sizes
    within = np.arange(int(sizes.sum())) - np.repeat(first, sizes)
    places = np.repeat(place, sizes) + within * body.step(wanted.type)
    return body.take(places, wanted.type), sizes


def _offset(body: Body, layout: Layout, wanted: Property) -> int:
    """Places from the begin of a row to a property, where all rows are alike."""
    offset = 0
    sizes = iter(layout.sizes)
    for prop in layout.element.properties:
        if prop is wanted:
            break
        offset += size_of(body, prop)
        if prop.count_type is not None:
            offset += next(sizes, 0) * body.step(prop.type)
    return offset

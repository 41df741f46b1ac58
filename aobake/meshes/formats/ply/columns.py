"""What a bake puts into the vertices of a PLY file: which properties are replaced, and which are new."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aobake.errors import OutputError
from aobake.meshes.formats.ply.body import Body, Numbers
from aobake.meshes.formats.ply.header import Element, Property
from aobake.meshes.formats.ply.layout import Layout, scalar_values
from aobake.settings import StoreSettings

__all__ = [
    "AO",
    "COLOR",
    "MEAN_DISTANCE",
    "Changes",
    "Held",
    "NewColumn",
    "byte_colors",
    "changes",
    "held_by",
]

COLOR = ("red", "green", "blue")
AO, MEAN_DISTANCE = "ao", "mean_distance"


@dataclass(frozen=True, eq=False)
class NewColumn:
    """A property that is appended. type : numpy's name of it, without the byte order"""

    name: str
    type: str
    values: Numbers


@dataclass(frozen=True, eq=False)
class Changes:
    """replaced : (property, its new values), the type kept     removed : properties that go

    new : properties that come after the last one
    """

    replaced: tuple[tuple[Property, Numbers], ...]
    removed: tuple[Property, ...]
    new: tuple[NewColumn, ...]


@dataclass(frozen=True, eq=False)
class Held:
    """What the vertices have already. colors : those to be multiplied     ao : the property of that name"""

    colors: tuple[Property, ...]
    ao: Property | None


def held_by(element: Element, store: StoreSettings, where: str) -> Held:
    """What the vertices hold, as far as a bake with this store is concerned with it.

    Raises OutputError where colours are there in part, or as lists.
    """
    ao = _number(element, AO, where)
    colors = _color_properties(element, where) if store.store == "color" else []
    return Held(tuple(colors), ao)


def _number(element: Element, name: str, where: str) -> Property | None:
    """A property of the vertices that is a number, or None. Raises OutputError for a list of this name."""
    found = element.scalar(name)
    if found is None and any(prop.name == name for prop in element.properties):
        raise OutputError(
            f"{where}: the vertices have a list named {name}. Rename it, or write GLB instead."
        )
    return found


def byte_colors(ao: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(V,) ambient occlusion as a colour of one byte, to the nearest."""
    rounded: NDArray[np.uint8] = np.rint(np.clip(ao.astype(np.float64), 0.0, 1.0) * 255.0).astype(
        np.uint8
    )
    return rounded


def changes(
    body: Body,
    layout: Layout,
    ao: NDArray[np.float32],
    distance: NDArray[np.float32] | None,
    store: StoreSettings,
    where: str,
) -> Changes:
    """What has to be done to the vertex element so that it holds ambient occlusion.

    ao : (V,) float32; distance : the same of mean distances, or None
    Existing colours are multiplied and keep their type. A property `ao` that is there is overwritten
    where it is a float or a double, and else replaced by a float; so is `mean_distance`.
    Raises OutputError where colours are there in part, or as lists.
    """
    held = held_by(layout.element, store, where)
    replaced: list[tuple[Property, Numbers]] = []
    removed: list[Property] = []
    new: list[NewColumn] = []
    if store.store == "color":
        replaced += [
            (prop, _multiplied(scalar_values(body, layout, prop), prop, ao)) for prop in held.colors
        ]
        if not held.colors:
            new += [NewColumn(name, "u1", byte_colors(ao)) for name in COLOR]
    numbers = {AO: (held.ao, ao)}
    if distance is not None:
        numbers[MEAN_DISTANCE] = _number(layout.element, MEAN_DISTANCE, where), distance
    for name, (before, values) in numbers.items():
        if before is not None and before.type[0] == "f":
            replaced.append((before, values.astype(before.type)))
            continue
        if before is not None:
            removed.append(before)
        new.append(NewColumn(name, "f4", values.astype(np.float32)))
    return Changes(tuple(replaced), tuple(removed), tuple(new))


def _color_properties(element: Element, where: str) -> list[Property]:
    """The properties red, green and blue, or none of them."""
    found = [prop for prop in map(element.scalar, COLOR) if prop is not None]
    named = {prop.name for prop in element.properties if prop.name in COLOR}
    if len(found) in (0, 3) and len(named) == len(found):
        return found
    raise OutputError(
        f"{where}: the vertices have {', '.join(sorted(named))} of red, green and blue, so there is no color to "
        "darken. Keep the values apart with --store attribute."
    )


def _multiplied(values: Numbers, prop: Property, ao: NDArray[np.float32]) -> Numbers:
    product = values.astype(np.float64) * np.clip(ao.astype(np.float64), 0.0, 1.0)
    return (np.rint(product) if prop.type[0] != "f" else product).astype(prop.type)
